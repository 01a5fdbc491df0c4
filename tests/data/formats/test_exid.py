"""exiD: lanelets of a map as lanes of a straight road, ramps that leave it, and files that contradict each other."""

from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.sensor_layouts import LANE_WIDTH, exid_meta, exid_rows, traffic
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.data.made_rows import with_values
from tests.refusal import refused

RATE = 10.0
"""Frames per second: fewer rows than the 25 of the data set."""
INFO = pd.DataFrame([{"recordingId": 0, "locationId": 0, "frameRate": RATE, "speedLimit": 33.33}])
FEW = 18


@pytest.fixture(scope="module")
def tracks() -> pd.DataFrame:
    return pd.concat([exid_rows(vehicle, RATE) for vehicle in islice(traffic(RATE), FEW)], ignore_index=True)


@pytest.fixture(scope="module")
def meta() -> pd.DataFrame:
    return pd.DataFrame([exid_meta(vehicle, RATE) for vehicle in islice(traffic(RATE), FEW)])


@pytest.fixture
def read(meta, tmp_path: Path):
    def read(
        tracks: pd.DataFrame, on_bad: BadRows = BadRows.stop, meta: pd.DataFrame = meta, info: pd.DataFrame = INFO
    ):
        for table, name in ((tracks, "tracks"), (meta, "tracksMeta"), (info, "recordingMeta")):
            table.to_csv(tmp_path / f"00_{name}.csv", index=False)
        data = DataConfig(DataFormat.exid, str(tmp_path), on_bad=on_bad)
        assert data_id(data).startswith("exid-")
        (recording,) = iterate_recordings(data)
        return recording

    return read


def test_lanelets_side_by_side_are_lanes_and_those_in_line_are_one(tracks, read):
    recording = read(tracks)
    info, table = recording.info, recording.table
    assert (info.id, info.frame_rate, info.lane_count) == ("exid_00", RATE, {1: 3, 2: 3})
    assert (info.speed_limit, recording.dropped, len(table)) == (33.33, {}, len(tracks))
    assert tracks["laneletId"].nunique() > 6
    for (_, lane), lateral in table.groupby(["direction", "lane"])["lateral"]:
        assert lateral.median() == pytest.approx(LANE_WIDTH * (lane + 0.5), abs=0.15)
    step = table.groupby("track_id")["position"].diff()
    np.testing.assert_allclose(step.dropna(), 0.1 * table["speed"][step.notna()], atol=0.2)


def test_a_lane_change_in_the_file_is_one_in_the_table(tracks, read):
    own = read(tracks).table.query("track_id == 7")
    assert own["lane"].tolist() == sorted(own["lane"])
    assert own["lane"].nunique() == 2


def test_rows_outside_the_map_are_counted(tracks, read):
    out = tracks["trackId"].isin([1, 2]) & (tracks["trackLifetime"] < 20)
    recording = read(tracks.assign(laneletId=tracks["laneletId"].where(~out, "-1")))
    assert recording.dropped == {"off_road": 40}
    assert len(recording.table) == len(tracks) - 40


def test_a_ramp_is_counted_where_it_leaves(tracks, read):
    ahead = np.maximum(tracks["traveledDistance"] - 300.0, 0.0)
    out = (tracks["trackId"] == 3) & (ahead > 0.0)
    # 9 degrees off the road, to the right.
    ramp = tracks.assign(
        xCenter=tracks["xCenter"] - np.where(out, 0.15 * ahead * np.sin(0.65), 0.0),
        yCenter=tracks["yCenter"] - np.where(out, 0.15 * ahead * np.cos(0.65), 0.0),
        laneletId=tracks["laneletId"].where(~out, "55"),
    )
    recording = read(ramp)
    assert recording.dropped == {"off_road": out.sum()}
    assert recording.info.lane_count == {1: 3, 2: 3}


def test_a_track_that_leaves_the_map_and_comes_back_is_two(tracks, read):
    out = (tracks["trackId"] == 4) & tracks["trackLifetime"].between(40, 79)
    recording = read(tracks.assign(laneletId=tracks["laneletId"].where(~out, "-1")))
    assert recording.dropped == {"off_road": 40}
    assert recording.table["track_id"].nunique() == FEW + 1


def test_small_negative_speeds_are_noted(tracks, read):
    recording = read(with_values(tracks, 5, lonVelocity=-0.2), BadRows.drop_row)
    assert any(note.startswith("1 speeds between") for note in recording.info.notes)


@pytest.mark.parametrize(
    ("change", "code", "fields"),
    [
        (lambda t: t.drop(columns="lonVelocity"), "column-missing", {"column": "lonVelocity"}),
        (lambda t: t.drop(columns=["laneletId", "laneChange"]), "format-unsupported", {"column": "laneletId"}),
        (lambda t: t.assign(lonVelocity=3.6 * t["lonVelocity"]), "wrong-units", {"column": "lonVelocity"}),
        (lambda t: t.assign(xCenter=t["xCenter"] / 0.3048, yCenter=t["yCenter"] / 0.3048), "wrong-units", {}),
        (lambda t: t.assign(length=t["length"] / 0.3048), "wrong-units", {"column": "length"}),
        (lambda t: t.assign(yCenter=-t["yCenter"]), "wrong-orientation", {"column": "yCenter"}),
        (lambda t: t.iloc[:0], "no-rows", {}),
        (lambda t: t.iloc[:-5], "truncated", {}),
        (lambda t: t[t["trackId"] != 5], "tracks-without-rows", {"column": "trackId"}),
        (lambda t: t.assign(trackId=t["trackId"].replace(5, 99)), "tracks-without-rows", {}),
        (lambda t: with_values(t, 40, xCenter=np.nan), "not-finite", {"row": 41}),
        (lambda t: with_values(t, 40, xCenter=1e6), "out-of-range", {"row": 41}),
        (lambda t: with_values(t, 40, laneletId="x"), "value-unreadable", {"column": "laneletId"}),
        (lambda t: with_values(t, 40, trackId=np.nan), "not-finite", {"row": 41, "column": "trackId"}),
        (lambda t: with_values(t, 40, frame=5), "duplicate", {}),
        (lambda t: t.assign(xCenter=1.0, yCenter=1.0), "no-motion", {}),
    ],
)
def test_a_fault_is_named(tracks, read, change, code, fields):
    with refused(code, **fields):
        read(change(tracks))


def test_a_vehicle_that_falls_back_in_its_carriageway_is_named(tracks, read):
    own = (tracks["trackId"] == 6).to_numpy()
    turned = tracks.copy()
    turned.loc[own, ["xCenter", "yCenter"]] = tracks.loc[own, ["xCenter", "yCenter"]].to_numpy()[::-1]
    with refused("wrong-direction", row=int(np.argmax(own)) + 1):
        read(turned)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"frameRate": 0.0}, "frame-rate"),
        ({"speedLimit": 120.0}, "speed-limit"),
        ({"frameRate": None}, "no-rows"),
    ],
)
def test_a_fault_of_the_description_is_named(tracks, read, changes, code):
    with refused(code):
        read(tracks, info=INFO.assign(**changes))


def test_a_class_that_is_none_and_a_vehicle_listed_twice_are_named(tracks, read, meta):
    with refused("unknown-class"):
        read(tracks, meta=meta.assign(**{"class": "boat"}))
    with refused("duplicate", column="trackId"):
        read(tracks, meta=pd.concat([meta, meta.iloc[:1]]))


def test_a_cut_line_is_named(tracks, read, tmp_path):
    read(tracks)
    path = tmp_path / "00_tracks.csv"
    path.write_bytes(path.read_bytes()[:-60])
    with refused("line-broken", row=len(tracks)):
        list(iterate_recordings(DataConfig(DataFormat.exid, str(tmp_path))))


def test_a_missing_file_is_named(tracks, read, tmp_path):
    read(tracks)
    (tmp_path / "00_tracksMeta.csv").unlink()
    with refused("file-missing", MissingInputError):
        list(iterate_recordings(DataConfig(DataFormat.exid, str(tmp_path))))


def test_the_order_of_rows_does_not_matter(tracks, read):
    expected = read(tracks)
    recording = read(tracks.sample(frac=1.0, random_state=0))
    pd.testing.assert_frame_equal(recording.table, expected.table)
