"""Recordings in NGSIM tables by their clocks: shifted clocks make none, units are named, arterials are none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.formats.ngsim_published import PublishedFile
from rearl_jax.data.recordings import count_recordings, iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.data.formats.ngsim_files import published, text_of
from tests.refusal import refused

QUARTER = 15 * 60_000  # ms


def _file(folder, rows: pd.DataFrame, name: str = "trajectories.csv") -> PublishedFile:
    rows.to_csv(folder / name, index=False)
    return PublishedFile(folder / name, DataConfig())


def _shifted(rows: pd.DataFrame, where: pd.Series, by: int) -> pd.DataFrame:
    return rows.assign(Global_Time=rows["Global_Time"] + by * where)


@pytest.mark.parametrize(
    ("vehicles", "frames"),
    [((3,), (120, 130)), ((3,), (100, 130)), ((3,), (140, 160)), ((3,), (100, 160)), ((1, 3), (120, 130))],
)
def test_rows_with_a_shifted_clock_are_no_recording(tmp_path, vehicles, frames):
    rows = published()
    where = rows["Vehicle_ID"].isin(vehicles) & rows["Frame_ID"].between(frames[0], frames[1] - 1)
    file = _file(tmp_path, _shifted(rows, where, 20 * 60_000))
    with refused("time-contradicts-frame", column="Global_Time", row=int(np.argmax(where)) + 1) as caught:
        file.recordings()
    assert f"{where.sum()} rows of vehicle {vehicles[0]}" in caught.value.problem.fault


def _fleet(n: int, **columns) -> pd.DataFrame:
    """n vehicles one behind another, whose numbers are 1 .. n."""
    one = published().query("Vehicle_ID == 1").assign(Preceding=0, **columns)
    return pd.concat([one.assign(Vehicle_ID=k, Local_Y=one["Local_Y"] + 50.0 * k) for k in range(1, n + 1)])


def test_whole_tracks_with_a_shifted_clock_are_no_recording(tmp_path):
    rows = _fleet(20).reset_index(drop=True)
    file = _file(tmp_path, _shifted(rows, rows["Vehicle_ID"].isin([3, 17]), 20 * 60_000))
    with refused("time-contradicts-frame", column="Global_Time", row=121):
        file.recordings()
    # Numbers begin anew in a real recording of a few vehicles.
    both = pd.concat([rows, _shifted(rows[rows["Vehicle_ID"] < 3], pd.Series(True, rows.index), QUARTER)])
    assert _file(tmp_path, both).recordings() == ["us101_0750", "us101_0805"]


@pytest.mark.parametrize(
    ("place", "vehicles", "frames", "code"),
    [
        ("i-80", (3,), (100, 130), "location-contradicts-time"),
        ("i-80", (3, 4), (100, 160), "location-contradicts-time"),
        ("lankershim", (3,), (120, 130), "location-contradicts-time"),
        (None, (3,), (100, 160), "location-unknown"),
        ("us-1O1", (3, 4, 5), (100, 160), "location-unknown"),
    ],
)
def test_rows_with_another_place_are_no_recording(tmp_path, place, vehicles, frames, code):
    rows = _fleet(9).reset_index(drop=True)
    where = rows["Vehicle_ID"].isin(vehicles) & rows["Frame_ID"].between(frames[0], frames[1] - 1)
    file = _file(tmp_path, rows.assign(Location=rows["Location"].mask(where, place)))
    with refused(code, column="Location", row=int(np.argmax(where)) + 1):
        file.recordings()


def test_recordings_of_an_unknown_place_and_of_that_of_the_file_name_are_read(tmp_path):
    assert _file(tmp_path, published().assign(Location="Autobahn 8")).recordings() == ["autobahn8_0750"]
    blank = published().assign(Location=lambda rows: rows["Location"].where(rows["Vehicle_ID"] < 3, " "))
    assert _file(tmp_path, blank, "US-101.csv").recordings() == ["us101_0750"]


def test_recordings_of_one_file_stay_apart(tmp_path):
    names = ["us101_0750", "us101_0805"]
    both = pd.concat([published(), published(start=QUARTER)], ignore_index=True)
    assert _file(tmp_path, both).recordings() == names
    # As many other vehicles in a recording that begins in the very next frame.
    later = published(start=QUARTER)
    later[["Frame_ID", "Global_Time", "Vehicle_ID"]] += [60, 6000, 3]
    assert _file(tmp_path, pd.concat([published(), later], ignore_index=True)).recordings() == names


@pytest.mark.parametrize(
    ("unit", "factor"), [("s", 1e-3), ("us", 1e3), ("ns", 1e6), ("min", 1 / 6e4), ("h", 1 / 3.6e6)]
)
@pytest.mark.parametrize("whole", [True, False])
def test_a_time_in_another_unit_is_named(tmp_path, unit, factor, whole):
    if whole and factor < 1e-3:
        pytest.skip("six seconds are no whole minute")
    rows = published()
    time = rows["Global_Time"] * factor
    file = _file(tmp_path, rows.assign(Global_Time=np.floor(time).astype(np.int64) if whole else time))
    with refused("wrong-units", column="Global_Time") as caught:
        file.recordings()
    assert f"in {unit}, not ms" in caught.value.problem.fault


@pytest.mark.parametrize("lossy", [lambda time: time.map("{:.5E}".format), lambda time: time.astype(np.float32)])
def test_times_that_lost_digits_are_named_as_such(tmp_path, lossy):
    rows = published()
    with refused("time-contradicts-frame", column="Global_Time", row=None) as caught:
        _file(tmp_path, rows.assign(Global_Time=lossy(rows["Global_Time"]))).recordings()
    assert "lost digits" in caught.value.problem.fault


def test_whole_numbers_may_be_written_with_a_fraction_of_0(tmp_path):
    expected = _file(tmp_path, published()).read("us101_0750").table
    names = ["Vehicle_ID", "Frame_ID", "Global_Time", "v_Class", "Lane_ID", "Preceding"]
    as_float = published().astype(dict.fromkeys(names, float))
    pd.testing.assert_frame_equal(_file(tmp_path, as_float).read("us101_0750").table, expected)
    with refused("value-unreadable", column="Lane_ID", row=3):
        _file(tmp_path, as_float.assign(Lane_ID=as_float["Lane_ID"].where(as_float.index != 2, 2.5))).read("us101_0750")


@pytest.mark.parametrize("name", ["NGSIM_Peachtree_Vehicle_Trajectories.csv", "lankershim-0830am-0845am.txt"])
def test_an_arterial_is_recognised_by_the_name_of_its_file(tmp_path, name):
    rows = published().drop(columns="Location")
    (tmp_path / name).write_text(text_of(rows) if name.endswith(".txt") else rows.to_csv(index=False))
    with refused("arterials-only", MissingInputError):
        count_recordings(DataConfig(DataFormat.ngsim, str(tmp_path)))


@pytest.mark.parametrize("place", ["lankershim", "Lankershim Blvd"])
def test_a_file_of_arterials_only_says_so(tmp_path, place):
    _file(tmp_path, published().assign(Location=place))
    data = DataConfig(DataFormat.ngsim, str(tmp_path))
    with refused("arterials-only", MissingInputError, file=str(tmp_path)) as caught:
        count_recordings(data)
    assert "lankershim" in caught.value.problem.fault
    assert "peachtree" not in caught.value.problem.fault
    _file(tmp_path, published(), "more.csv")
    assert count_recordings(data) == 1


PROSE = "These are the paths of vehicles that 8 cameras above the 5 lanes of US 101 saw on 15 June 2005 in LA.\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("readme.txt", "these files belong to a course\nask me\n"),
        ("notes.csv", "these files belong to a course\nask me\n"),
        ("readme.txt", PROSE),
        ("detector.csv", "Vehicle_ID,count\n1,2\n"),
    ],
)
def test_a_file_that_is_no_trajectory_table_is_named_as_such(tmp_path, name, text):
    _file(tmp_path, published())
    (tmp_path / name).write_text(text)
    with refused("not-a-table", file=str(tmp_path / name)):
        count_recordings(DataConfig(DataFormat.ngsim, str(tmp_path)))


@pytest.mark.parametrize(
    ("column", "value", "code", "spelling"),
    [
        ("Lane_ID", 0, "lane-out-of-range", "Lane_ID"),
        ("Lane_ID", -1, "lane-out-of-range", "Lane_ID"),
        ("Global_Time", 0, "time-impossible", "Global_Time"),
        ("Global_Time", -1, "time-impossible", "Global_Time"),
        ("Local_Y", -9999.0, "out-of-range", "Local_Y"),
        ("v_Vel", -9999.0, "out-of-range", "v_Vel"),
        ("v_Acc", 9999.0, "out-of-range", "v_Acc"),
    ],
)
def test_a_placeholder_is_named_and_can_be_left_out(tmp_path, column, value, code, spelling):
    rows = published()
    unknown = (rows["Vehicle_ID"] == 3) & rows["Frame_ID"].between(120, 131)
    _file(tmp_path, rows.assign(**{column: rows[column].where(~unknown, value)}))
    data = DataConfig(DataFormat.ngsim, str(tmp_path))
    with refused(code, column=spelling, row=141):
        list(iterate_recordings(data))
    (recording,) = iterate_recordings(replace(data, on_bad=BadRows.drop_row))
    assert recording.dropped == {code.replace("-", "_"): 12, "gap_cuts": 1}


def test_the_remedy_for_a_class_is_a_number_of_the_format(tmp_path):
    rows = published()
    rows.loc[rows["Vehicle_ID"] == 2, "v_Class"] = 0
    with refused("unknown-class", column="v_Class", row=61) as caught:
        _file(tmp_path, rows).read("us101_0750")
    assert "2 (car)" in str(caught.value)


def test_a_text_table_of_an_arterial_is_named(tmp_path):
    line = " ".join(["1 2 3 1118846980200", *(20 * ["0"])])
    (tmp_path / "lankershim.txt").write_text(f"{line}\n{line}\n")
    with refused("format-unsupported", file=str(tmp_path / "lankershim.txt")):
        PublishedFile(tmp_path / "lankershim.txt", DataConfig()).recordings()


def test_times_that_do_not_grow_by_a_frame_are_in_another_unit(tmp_path):
    rows = published()
    with refused("wrong-units", column="Global_Time"):
        _file(tmp_path, rows.assign(Global_Time=rows["Global_Time"] / 100)).recordings()


def test_positions_on_a_map_begin_at_0(tmp_path):
    rows = published().drop(columns="Location")
    far = _file(tmp_path, rows.assign(Local_Y=rows["Local_Y"] + 1.87e6)).read("ngsim_0750")
    near = _file(tmp_path, rows).read("ngsim_0750")
    assert far.info.road_length < near.info.road_length
    assert far.table["position"].min() < 10.0
