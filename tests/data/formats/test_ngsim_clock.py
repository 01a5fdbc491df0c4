"""Recordings in NGSIM tables by their clocks: shifted clocks make none, units are named, arterials are none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig, DataFormat, OnBad
from rearl_jax.data.formats.ngsim_published import PublishedFile
from rearl_jax.data.recordings import count_recordings, iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.data.formats.test_ngsim import _published
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
    rows = _published()
    where = rows["Vehicle_ID"].isin(vehicles) & rows["Frame_ID"].between(frames[0], frames[1] - 1)
    file = _file(tmp_path, _shifted(rows, where, 20 * 60_000))
    with refused("time-contradicts-frame", column="Global_Time", row=int(np.argmax(where)) + 1) as caught:
        file.recordings()
    assert f"{where.sum()} rows of vehicle {vehicles[0]}" in caught.value.problem.fault


def test_recordings_of_one_file_stay_apart(tmp_path):
    names = ["us101_0750", "us101_0805"]
    both = pd.concat([_published(), _published(start=QUARTER)], ignore_index=True)
    assert _file(tmp_path, both).recordings() == names
    # As many other vehicles in a recording that begins in the very next frame.
    later = _published(start=QUARTER)
    later[["Frame_ID", "Global_Time", "Vehicle_ID"]] += [60, 6000, 3]
    assert _file(tmp_path, pd.concat([_published(), later], ignore_index=True)).recordings() == names


@pytest.mark.parametrize(("unit", "factor"), [("s", 1e-3), ("us", 1e3), ("ns", 1e6)])
@pytest.mark.parametrize("whole", [True, False])
def test_a_time_in_another_unit_is_named(tmp_path, unit, factor, whole):
    rows = _published()
    time = rows["Global_Time"] * factor
    file = _file(tmp_path, rows.assign(Global_Time=np.floor(time).astype(np.int64) if whole else time))
    with refused("wrong-units", column="Global_Time") as caught:
        file.recordings()
    assert f"in {unit}, not ms" in caught.value.problem.fault


def test_whole_numbers_may_be_written_with_a_fraction_of_0(tmp_path):
    expected = _file(tmp_path, _published()).read("us101_0750").table
    names = ["Vehicle_ID", "Frame_ID", "Global_Time", "v_Class", "Lane_ID", "Preceding"]
    as_float = _published().astype(dict.fromkeys(names, float))
    pd.testing.assert_frame_equal(_file(tmp_path, as_float).read("us101_0750").table, expected)
    with refused("value-unreadable", column="Lane_ID", row=3):
        _file(tmp_path, as_float.assign(Lane_ID=as_float["Lane_ID"].where(as_float.index != 2, 2.5))).read("us101_0750")


def test_a_file_of_arterials_only_says_so(tmp_path):
    _file(tmp_path, _published().assign(Location="lankershim"))
    data = DataConfig(DataFormat.ngsim, str(tmp_path))
    with refused("arterials-only", MissingInputError, file=str(tmp_path)) as caught:
        count_recordings(data)
    assert "lankershim" in caught.value.problem.fault
    assert "peachtree" not in caught.value.problem.fault
    _file(tmp_path, _published(), "more.csv")
    assert count_recordings(data) == 1


@pytest.mark.parametrize("name", ["readme.txt", "notes.csv"])
def test_a_file_that_is_no_trajectory_table_is_named_as_such(tmp_path, name):
    _file(tmp_path, _published())
    (tmp_path / name).write_text("these files belong to a course\nask me\n")
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
    rows = _published()
    unknown = (rows["Vehicle_ID"] == 3) & rows["Frame_ID"].between(120, 131)
    _file(tmp_path, rows.assign(**{column: rows[column].where(~unknown, value)}))
    data = DataConfig(DataFormat.ngsim, str(tmp_path))
    with refused(code, column=spelling, row=141):
        list(iterate_recordings(data))
    (recording,) = iterate_recordings(replace(data, on_bad=OnBad.drop_row))
    assert recording.dropped == {code.replace("-", "_"): 12, "gap_cuts": 1}
