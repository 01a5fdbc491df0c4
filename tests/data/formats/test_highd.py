"""The highD format: drivers' frame, contradictions between the three files, damaged files."""

import shutil
import sys
from pathlib import Path
from subprocess import run

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.formats.highd import find_recordings, read_recording
from rearl_jax.problems import MissingInputError
from tests.data.made_rows import with_values
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)


@pytest.fixture
def tracks(highd_files, tmp_path) -> Path:
    return highd_files(tmp_path)


def _edit(path: Path, change) -> None:
    table = pd.read_csv(path)
    change(table).to_csv(path, index=False)


def _set(row: int, **values):
    return lambda table: with_values(table, row, **values)


def test_both_directions_are_in_their_drivers_frame(tracks):
    recording = read_recording(tracks, STOP)
    info, table = recording.info, recording.table
    source = pd.read_csv(tracks).sort_values(["id", "frame"])
    assert recording.dropped == {}
    assert (info.id, info.frame_rate, dict(info.lane_count)) == ("highd_01", 25.0, {1: 2, 2: 2})
    assert info.road_length == pytest.approx((source["x"] + source["width"]).max())
    assert info.speed_limit == 33.33
    assert info.lane_markings == {1: (0.0, 3.75, 7.5), 2: (0.0, 3.75, 7.5)}
    assert set(table["direction"]) == {1, 2}
    # Slow and obvious: row by row.
    for row, (_, raw) in zip(table.itertuples(), source.iterrows(), strict=True):
        right = raw["id"] % 2 == 0
        xc, yc = raw["x"] + raw["width"] / 2, raw["y"] + raw["height"] / 2
        assert (row.track_id, row.frame) == (raw["id"], raw["frame"])
        assert row.time == pytest.approx((raw["frame"] - 6) / 25.0)
        assert (row.x, row.y, row.length, row.width) == pytest.approx((xc, yc, raw["width"], raw["height"]))
        assert row.position == pytest.approx(xc if right else info.road_length - xc)
        assert row.lateral == pytest.approx(yc - 20.0 if right else 15.5 - yc)
        assert row.lane == (raw["laneId"] - 5 if right else 3 - raw["laneId"])
        assert row.speed == abs(raw["xVelocity"])
        assert row.acceleration == pytest.approx(0.1)
        assert row.vehicle_class == ("truck" if raw["id"] % 4 == 0 else "car")
        assert row.leader_id is pd.NA if raw["precedingId"] == 0 else row.leader_id == raw["precedingId"]


def test_positions_rise_and_every_lane_change_is_to_the_left_in_both_directions(tracks):
    table = read_recording(tracks, STOP).table
    for direction in (1, 2):
        here = table[table["direction"] == direction]
        assert (here.groupby("track_id")["position"].diff().dropna() > 0).all()
        change = here.groupby("track_id")["lane"].agg(["first", "last"])
        assert (change["first"] == 1).all()
        assert (change["last"] == 0).sum() == 2
        centre = 3.75 * (here["lane"].astype(float) + 0.5)
        assert (np.abs(here["lateral"] - centre) <= 3.75 / 2 + 0.01).all()


def test_lanes_count_from_the_markings_where_nobody_uses_the_left_one(highd_files, tmp_path):
    tracks = highd_files(tmp_path, n_vehicles=2)
    assert set(pd.read_csv(tracks)["laneId"]) == {2, 6}
    assert set(read_recording(tracks, STOP).table["lane"]) == {1}


def test_lane_ids_beside_the_markings_count_among_themselves(tracks):
    _edit(tracks, lambda t: t.assign(laneId=t["laneId"] + 1))
    recording = read_recording(tracks, STOP)
    assert len(recording.info.notes) == 2
    assert "laneId outside the lane markings" in recording.info.notes[0]
    assert set(recording.table["lane"]) == {0, 1}
    assert dict(recording.info.lane_count) == {1: 2, 2: 2}


def test_a_single_wrong_lane_id_does_not_move_the_lanes_of_others(tracks):
    sound = read_recording(tracks, STOP).table
    _edit(tracks, _set(7, laneId=99))
    with refused("lane-out-of-range", column="laneId", row=8):
        read_recording(tracks, STOP)
    dropped = read_recording(tracks, DataConfig(on_bad=BadRows.drop_track))
    assert dropped.dropped == {"lane_out_of_range": 150, "tracks": 1}
    assert dict(dropped.info.lane_count) == {1: 2, 2: 2}
    left = sound[sound["track_id"] != 1].reset_index(drop=True)
    left = left.assign(time=left["time"] - left["time"].min())  # vehicle 1 was the first in view
    pd.testing.assert_frame_equal(dropped.table, left, check_categorical=False)


@pytest.mark.parametrize(("track", "lane_id"), [(1, 1), (1, 4), (2, 4), (2, 7)])
def test_a_stripe_beside_the_lanes_is_no_lane_of_a_vehicle_between_the_markings(tracks, track, lane_id):
    table = pd.read_csv(tracks)
    few = table.index[table["id"] == track][20:30]
    _edit(tracks, lambda t: t.assign(laneId=t["laneId"].where(~t.index.isin(few), lane_id)))
    with refused("lane-out-of-range", column="laneId", row=few[0] + 1):
        read_recording(tracks, STOP)
    dropped = read_recording(tracks, DataConfig(on_bad=BadRows.drop_row))
    assert dropped.dropped["lane_out_of_range"] == 10
    assert dict(dropped.info.lane_count) == {1: 2, 2: 2}


@pytest.mark.parametrize("lane_id", [0, -1, 8, 5])
def test_a_vehicle_on_no_lane_of_its_carriageway_does_not_move_the_lanes_of_others(tracks, lane_id):
    _edit(tracks, lambda t: t.assign(laneId=t["laneId"].where(t["id"] != 1, lane_id)))
    with refused("lane-out-of-range", column="laneId", row=1) as caught:
        read_recording(tracks, STOP)
    assert f"laneId {lane_id} of track 1" in caught.value.problem.fault
    dropped = read_recording(tracks, DataConfig(on_bad=BadRows.drop_row))
    assert dropped.dropped == {"lane_out_of_range": 150, "tracks": 1}
    assert dict(dropped.info.lane_count) == {1: 2, 2: 2}


def test_a_preceding_id_that_names_followers_stops(tracks):
    rows = pd.read_csv(tracks)
    following = rows.loc[rows["precedingId"] > 0, ["frame", "precedingId", "id"]]
    following = following.rename(columns={"precedingId": "id", "id": "following"})
    assert len(following) > 100
    swapped = rows.merge(following, on=["frame", "id"], how="left")
    rows.assign(precedingId=swapped["following"].fillna(0).astype(int)).to_csv(tracks, index=False)
    with refused("wrong-leader", column="precedingId") as caught:
        read_recording(tracks, STOP)
    assert "drives behind" in caught.value.problem.fault


def test_a_standing_vehicle_may_have_a_velocity_of_either_sign(tracks):
    standing = {"xVelocity": 0.01, "x": 100.0}
    _edit(tracks, lambda t: t.assign(**{k: t[k].where(t["id"] != 1, v) for k, v in standing.items()}))
    table = read_recording(tracks, STOP).table
    assert (table.loc[table["track_id"] == 1, "speed"] == 0.01).all()


def test_no_speed_limit_is_none(tracks):
    _edit(tracks.with_name("01_recordingMeta.csv"), lambda t: t.assign(speedLimit=-1.0))
    assert read_recording(tracks, STOP).info.speed_limit is None


def test_generated_recordings_say_so(tracks):
    info = read_recording(tracks, STOP, generated=True).info
    assert (info.id, info.generated) == ("generated_01", True)
    assert "no measured data" in info.attribution


def test_one_recording_of_a_folder_may_be_named(highd_files, tmp_path):
    paths = [highd_files(tmp_path, number) for number in ("01", "02")]
    assert find_recordings(tmp_path) == paths
    assert find_recordings(paths[1]) == paths[1:]
    with refused("recordings-missing", MissingInputError):
        find_recordings(tmp_path / "01_tracksMeta.csv")


def test_a_file_cut_inside_a_line_stops_or_loses_the_track(tracks):
    text = tracks.read_text()
    lines = text.splitlines()
    tracks.write_text("\n".join(lines[:-20]) + "\n" + lines[-20][:10])
    with refused("line-broken", row=len(lines) - 20, file=str(tracks)):
        read_recording(tracks, STOP)
    recording = read_recording(tracks, DROP_ROW)
    assert recording.dropped == {"broken_line": 1, "truncated": 130, "tracks": 1}
    assert set(recording.table["track_id"]) == set(range(1, 12))


def test_a_file_cut_between_lines_is_noticed_by_the_number_of_frames(tracks):
    lines = tracks.read_text().splitlines()
    tracks.write_text("\n".join(lines[:-20]) + "\n")
    with refused("truncated", column="id"):
        read_recording(tracks, STOP)
    assert read_recording(tracks, DROP_ROW).dropped == {"truncated": 130, "tracks": 1}


def test_a_file_cut_before_a_track_is_noticed_by_the_missing_track(tracks):
    lines = tracks.read_text().splitlines()
    tracks.write_text("\n".join(lines[:-300]) + "\n")
    with refused("tracks-without-rows", column="id"):
        read_recording(tracks, STOP)
    assert read_recording(tracks, DROP_ROW).dropped == {"tracks_without_rows": 2}


# Which file, how it is spoiled, code, column and row of the problem, what it says of the value.
CONTRADICTIONS = {
    "direction": ("tracksMeta", _set(4, drivingDirection=2), "wrong-direction", "xVelocity", 601, "track 5"),
    "third direction": ("tracksMeta", _set(4, drivingDirection=3), "wrong-direction", "drivingDirection", 5, "(3"),
    "class": ("tracksMeta", _set(4, **{"class": "Tram"}), "unknown-class", "class", 5, "'Tram'"),
    "no class": ("tracksMeta", _set(4, **{"class": None}), "unknown-class", "class", 5, ""),
    "same id": ("tracksMeta", _set(4, id=4), "duplicate", "id", 5, "track 4"),
    "not listed": ("tracksMeta", lambda t: t.drop(index=4), "track-without-meta", "id", 601, "track 5"),
    "no frames": ("tracksMeta", _set(4, numFrames=None), "value-missing", "numFrames", 5, "track 5"),
    "lane": ("tracks", _set(7, laneId=None), "not-finite", "laneId", 8, ""),
    "velocity": ("tracks", _set(7, xVelocity=None), "not-finite", "xVelocity", 8, "nan"),
    "text": ("tracks", _set(7, xVelocity="fast"), "value-unreadable", "xVelocity", 8, "fast"),
    "jump": ("tracks", lambda t: _moved(t, 7, 30.0), "jump", "x", 8, ""),
    "column": ("tracks", lambda t: t.drop(columns="laneId"), "column-missing", "laneId", None, ""),
    "marking": ("recordingMeta", _set(0, upperLaneMarkings="8.0"), "not-a-number", "upperLaneMarkings", 1, "'8.0'"),
    "frame rate": ("recordingMeta", _set(0, frameRate="x"), "not-a-number", "frameRate", 1, "'x'"),
    "slow frame rate": ("recordingMeta", _set(0, frameRate=1e-310), "frame-rate", "frameRate", 1, "1e-310"),
    "no frame rate": ("recordingMeta", lambda t: t.drop(columns="frameRate"), "column-missing", "frameRate", None, ""),
    "two recordings": ("recordingMeta", lambda t: pd.concat([t, t]), "one-row", None, None, "not 2"),
}  # fmt: skip


def _moved(table: pd.DataFrame, row: int, by: float) -> pd.DataFrame:
    table.loc[row, "x"] += by
    return table


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_contradictions_stop_with_file_column_and_row(tracks, case):
    part, spoil, code, column, row, value = CONTRADICTIONS[case]
    _edit(tracks.with_name(f"01_{part}.csv"), spoil)
    with refused(code, column=column, row=row) as caught:
        read_recording(tracks, STOP)
    problem = caught.value.problem
    assert "01_" in problem.file
    assert value in problem.fault


@pytest.mark.parametrize("case", ["direction", "class", "no class", "not listed", "lane", "velocity", "jump"])
def test_contradictions_are_dropped_and_counted_on_request(tracks, case):
    part, spoil, *_ = CONTRADICTIONS[case]
    _edit(tracks.with_name(f"01_{part}.csv"), spoil)
    recording = read_recording(tracks, DataConfig(on_bad=BadRows.drop_track))
    assert recording.dropped["tracks"] == 1
    assert sum(n for name, n in recording.dropped.items() if name != "tracks") == 150
    assert recording.table["track_id"].nunique() == 11


@pytest.mark.parametrize("far", [5000.0, np.inf])
def test_a_row_that_is_dropped_does_not_move_the_others(tracks, far):
    sound = read_recording(tracks, STOP)
    _edit(tracks, _set(170, x=far))
    dropped = read_recording(tracks, DataConfig(on_bad=BadRows.drop_track))
    assert dropped.dropped["tracks"] == 1
    assert dropped.info.road_length == sound.info.road_length
    left = sound.table[sound.table["track_id"] != 2].reset_index(drop=True)
    pd.testing.assert_frame_equal(dropped.table, left, check_categorical=False)


def test_speeds_in_kmh_stop(tracks):
    _edit(tracks, lambda t: t.assign(xVelocity=t["xVelocity"] * 3.6))
    with refused("wrong-units", column="xVelocity", row=2):
        read_recording(tracks, DROP_ROW)


def test_names_in_capitals_are_those_of_the_same_files(tracks):
    expected = read_recording(tracks, STOP)
    for file in list(tracks.parent.iterdir()):
        file.rename(file.with_name(file.name.upper()))
    (found,) = find_recordings(tracks.parent)
    recording = read_recording(found, STOP)
    assert recording.info.id == expected.info.id
    pd.testing.assert_frame_equal(recording.table, expected.table)


def test_missing_files_and_empty_files_stop(tracks, tmp_path):
    with refused("recordings-missing", MissingInputError):
        find_recordings(tmp_path / "elsewhere")
    empty = tmp_path / "02_tracks.csv"
    for part in ("tracksMeta", "recordingMeta"):
        shutil.copy(tmp_path / f"01_{part}.csv", tmp_path / f"02_{part}.csv")
    empty.write_text("")
    with refused("file-empty"):
        read_recording(empty, DROP_ROW)
    empty.write_text(tracks.read_text().splitlines()[0] + "\n")
    with refused("no-rows"):
        read_recording(empty, DROP_ROW)
    tracks.with_name("01_tracksMeta.csv").unlink()
    with refused("file-missing", MissingInputError):
        read_recording(tracks, STOP)


def test_the_published_archive_keeps_them_in_a_subfolder(highd_files, tmp_path):
    tracks = highd_files(tmp_path / "data")
    assert find_recordings(tmp_path) == [tracks]


def test_files_of_the_intersection_sets_are_named(tracks):
    _edit(tracks, lambda t: t.rename(columns={"x": "xCenter"}))
    with refused("format-unsupported", column="xCenter"):
        read_recording(tracks, STOP)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_recordings(highd_files, tmp_path):
    """Recordings with as many rows as those of highD have on average (37 million in 60)."""
    highd_files(tmp_path, n_vehicles=1842, n_frames=335)
    for number in range(2, 9):
        for part in ("tracksMeta", "recordingMeta"):
            (tmp_path / f"{number:02d}_{part}.csv").hardlink_to(tmp_path / f"01_{part}.csv")
        header, first, rest = (tmp_path / "01_tracks.csv").read_text().split("\n", 2)
        values = dict(zip(header.split(","), first.split(","), strict=True))
        values["y"] = f"{float(values['y']) + number / 100:.2f}"  # the same rows twice would be refused
        text = "\n".join([header, ",".join(values.values()), rest])
        (tmp_path / f"{number:02d}_tracks.csv").write_text(text)
    program = (
        "import sys\n"
        "from rearl_jax.timing.measurement import peak_memory_bytes\n"
        "from rearl_jax.config.data import DataConfig, DataFormat\n"
        "from rearl_jax.data.recordings import iterate_recordings\n"
        "data = DataConfig(DataFormat.highd, sys.argv[1], recordings=sys.argv[2])\n"
        "rows = sum(len(recording.table) for recording in iterate_recordings(data))\n"
        "print(rows, peak_memory_bytes() / 2**20)\n"
    )

    def read(pattern: str) -> tuple[int, float]:
        command = [sys.executable, "-c", program, str(tmp_path), pattern]
        rows, mib = run(command, capture_output=True, text=True, check=True).stdout.split()
        return int(rows), float(mib)

    (rows_two, two), (rows_all, eight) = read("highd_0[12]"), read("*")
    assert (rows_two, rows_all) == (2 * 617_070, 8 * 617_070)
    assert eight < 1024.0
    assert eight < two + 150.0


def test_whole_numbers_may_be_written_with_a_fraction_of_0(tracks):
    expected = read_recording(tracks, STOP).table
    for file in (tracks, tracks.with_name("01_tracksMeta.csv")):
        _edit(file, lambda t: t.astype({name: float for name in t.select_dtypes("integer").columns}))
        assert ".0," in file.read_text()
    pd.testing.assert_frame_equal(read_recording(tracks, STOP).table, expected)
    _edit(tracks, _set(4, precedingId=0.5))
    with refused("value-unreadable", column="precedingId", row=5):
        read_recording(tracks, STOP)


@pytest.mark.parametrize("column", ["xVelocity", "x", "y", "width", "height"])
def test_a_placeholder_is_named_and_can_be_left_out(tracks, column):
    _edit(
        tracks, lambda t: t.assign(**{column: t[column].where(~((t["id"] == 2) & t["frame"].between(50, 61)), -9999)})
    )
    with refused("out-of-range", column=column):
        read_recording(tracks, STOP)
    assert read_recording(tracks, DataConfig(on_bad=BadRows.drop_row)).dropped == {"out_of_range": 12, "gap_cuts": 1}
