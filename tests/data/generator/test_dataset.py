"""The generator's files, the traffic in them, and how a folder of recordings is resumed and protected."""

import dataclasses
import hashlib
import json
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator import dataset, generate
from rearl_jax.data.generator.dataset import TRUTH_FILE
from rearl_jax.data.generator.files import recording_files, write_recording
from tests.refusal import refused

# Columns and their order as in the published files (Krajewski et al. 2018).
TRACKS = (
    "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,"
    "backSightDistance,dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,leftAlongsideId,"
    "leftFollowingId,rightPrecedingId,rightAlongsideId,rightFollowingId,laneId"
)
TRACKS_META = (
    "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,traveledDistance,minXVelocity,"
    "maxXVelocity,meanXVelocity,minDHW,minTHW,minTTC,numLaneChanges"
)
RECORDING_META = (
    "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,totalDrivenTime,"
    "numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings"
)
SHORT = GeneratorConfig(n_recordings=1, first_id=8, duration_scale=0.12, workers=1)
TINY = GeneratorConfig(n_recordings=2, duration_scale=0.05, workers=1, approach_length=300.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> tuple[Path, pd.DataFrame, pd.DataFrame, pd.Series]:
    """Folder, tracks, tracksMeta by id and recordingMeta of a recording of about 90 s."""
    root = tmp_path_factory.mktemp("generated")
    (path,) = generate(SHORT, root)
    meta, info = (pd.read_csv(file) for file in recording_files(root, 8)[1:])
    return root, pd.read_csv(path), meta.set_index("id", drop=False), info.iloc[0]


def _contents(root: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(root.glob("*.csv"))}


def _with_meta(tracks: pd.DataFrame, meta: pd.DataFrame) -> pd.DataFrame:
    return tracks.assign(direction=meta["drivingDirection"].reindex(tracks["id"]).to_numpy())


# --- the files ---


def test_columns_are_those_of_highd(recording):
    headers = [path.read_text().split("\n", 1)[0] for path in recording_files(recording[0], 8)]
    assert headers == [TRACKS, TRACKS_META, RECORDING_META]


def test_measured_values_have_two_decimals(recording):
    first_row = recording_files(recording[0], 8)[0].read_text().split("\n", 2)[1].split(",")
    values = dict(zip(TRACKS.split(","), first_row, strict=True))
    for name, text in values.items():
        is_integer = name in ("frame", "id", "laneId") or name.endswith("Id")
        assert ("." in text) != is_integer, name
        assert is_integer or len(text.split(".")[1]) == 2, name


def test_upper_carriageway_drives_left_and_lower_right(recording):
    _, tracks, meta, _ = recording
    data = _with_meta(tracks, meta)
    assert set(data["direction"]) == {1, 2}
    sign = np.where(data["direction"] == 1, -1.0, 1.0)
    assert np.all(sign * data["xVelocity"] > 0.0)
    moved = data.groupby("id")["x"].agg(["first", "last"])
    upper = meta["drivingDirection"].reindex(moved.index) == 1
    assert np.all((moved["last"] < moved["first"]) == upper)


def test_lane_ids_count_the_stripes_between_markings(recording):
    _, tracks, meta, info = recording
    upper, lower = ([float(y) for y in info[f"{side}LaneMarkings"].split(";")] for side in ("upper", "lower"))
    assert upper == sorted(upper)
    assert lower == sorted(lower)
    assert upper[-1] < lower[0]
    data = _with_meta(tracks, meta)
    centre = data["y"] + 0.5 * data["height"]
    markings = np.array(upper + lower)
    # Both y and height are rounded: within a centimetre of a marking the lane is open.
    clear = np.abs(centre.to_numpy()[:, None] - markings[None, :]).min(axis=1) > 0.02
    stripe = (markings[None, :] < centre.to_numpy()[:, None]).sum(axis=1) + 1
    assert np.array_equal(stripe[clear], data["laneId"].to_numpy()[clear])
    n = len(upper) - 1
    lanes = {1: set(range(2, 2 + n)), 2: set(range(3 + n, 3 + 2 * n))}
    assert {d: set(group) for d, group in data.groupby("direction")["laneId"]} == lanes


def test_boxes_are_fully_in_view_without_holes(recording):
    _, tracks, _, _ = recording
    assert tracks["x"].min() >= -0.01
    assert (tracks["x"] + tracks["width"]).max() <= 420.01
    steps = tracks.groupby("id")["frame"].diff().dropna()
    assert np.all(steps == 1)
    assert np.allclose(tracks["frontSightDistance"] + tracks["backSightDistance"], 420.0, atol=0.011)


def test_speeds_and_accelerations_are_derivatives_of_the_positions(recording):
    _, tracks, _, _ = recording
    inside = (tracks["id"].diff() == 0) & (tracks["id"].diff(-1) == 0)
    for axis in "xy":
        position = tracks[axis]
        velocity = (position.shift(-1) - position.shift(1)) / 0.08
        # Two positions rounded to 0.01 m, 0.08 s apart.
        assert np.all(np.abs(velocity - tracks[f"{axis}Velocity"])[inside] < 0.13 + 0.006)
        change = (tracks[f"{axis}Velocity"].shift(-1) - tracks[f"{axis}Velocity"].shift(1)) / 0.08
        assert np.abs(change - tracks[f"{axis}Acceleration"])[inside].quantile(0.99) < 0.25


def test_meta_files_agree_with_the_tracks(recording):
    _, tracks, meta, info = recording
    grouped = tracks.groupby("id")
    assert meta.index.tolist() == list(range(1, len(meta) + 1))
    assert meta["initialFrame"].is_monotonic_increasing
    frames = grouped["frame"].agg(["min", "max", "size"])
    assert np.array_equal(frames, meta[["initialFrame", "finalFrame", "numFrames"]])
    speed = tracks["xVelocity"].abs().groupby(tracks["id"])
    assert np.allclose(speed.min(), meta["minXVelocity"])
    assert np.allclose(speed.mean(), meta["meanXVelocity"], atol=0.0051)
    changes = grouped["laneId"].agg(lambda lane: int((lane.diff().fillna(0) != 0).sum()))
    assert np.array_equal(changes, meta["numLaneChanges"])
    led = tracks[tracks["precedingId"] > 0].groupby("id")["thw"].min().reindex(meta.index).fillna(-1.0)
    assert np.allclose(led, meta["minTHW"])
    assert set(meta["class"]) == {"Car", "Truck"}
    counted = {"numVehicles": len(meta), "numTrucks": int((meta["class"] == "Truck").sum())}
    assert {name: int(info[name]) for name in counted} == counted
    assert info["numCars"] == len(meta) - counted["numTrucks"]
    assert info["totalDrivenTime"] == pytest.approx(len(tracks) / 25.0)
    assert info["totalDrivenDistance"] == pytest.approx(meta["traveledDistance"].sum(), abs=0.01)
    assert 1 == tracks["frame"].min()
    assert tracks["frame"].max() == round(info["duration"] * 25)


def _slow_neighbours(frame: pd.DataFrame, row: pd.Series) -> dict[str, int]:
    """The eight neighbour ids of a vehicle by comparing it with everybody."""
    found = {}
    to_left = 1 if row["direction"] == 1 else -1
    same = (row["laneId"], ("precedingId", "", "followingId"))
    left = (row["laneId"] + to_left, ("leftPrecedingId", "leftAlongsideId", "leftFollowingId"))
    right = (row["laneId"] - to_left, ("rightPrecedingId", "rightAlongsideId", "rightFollowingId"))
    for lane, names in (same, left, right):
        others = frame[(frame["laneId"] == lane) & (frame["id"] != row["id"])]
        ahead = others["backSightDistance"] - row["backSightDistance"]
        beside = np.abs(ahead) < 0.5 * (others["width"] + row["width"])
        beside &= bool(names[1])
        front, back = others[~beside & (ahead > 0)], others[~beside & (ahead < 0)]
        found[names[0]] = 0 if front.empty else int(front["id"][ahead[front.index].idxmin()])
        found[names[2]] = 0 if back.empty else int(back["id"][ahead[back.index].idxmax()])
        if names[1]:
            found[names[1]] = 0 if not beside.any() else int(others["id"][ahead[beside].abs().idxmin()])
    return found


def test_neighbours_are_those_found_by_comparing_everybody(recording):
    _, tracks, meta, _ = recording
    data = _with_meta(tracks, meta)
    seen = dict.fromkeys([name for name in TRACKS.split(",") if name.endswith("Id") and name != "laneId"], 0)
    for number in (1, 400, 900, 1400, 1900):
        frame = data[data["frame"] == number]
        for _, row in frame.iterrows():
            expected = _slow_neighbours(frame, row)
            assert {name: int(row[name]) for name in expected} == expected, (number, row["id"])
            for name, neighbour in expected.items():
                seen[name] += neighbour > 0
    assert min(seen.values()) >= 2, seen  # every kind of neighbour was there


def test_headways_follow_from_the_preceding_vehicle(recording):
    _, tracks, _, _ = recording
    led = tracks[tracks["precedingId"] > 0]
    assert len(led) > 1000
    leader = tracks.set_index(["frame", "id"]).loc[list(zip(led["frame"], led["precedingId"], strict=True))]
    assert np.array_equal(leader["followingId"], led["id"])
    assert np.allclose(leader["xVelocity"], led["precedingXVelocity"])
    dhw = np.abs(leader["x"].to_numpy() - led["x"].to_numpy())
    assert np.allclose(led["dhw"], dhw, atol=0.0051)
    assert np.allclose(led["thw"], dhw / led["xVelocity"].abs(), atol=0.0051)
    closing = led["xVelocity"].abs().to_numpy() - leader["xVelocity"].abs().to_numpy()
    clear = np.abs(closing) > 0.015
    assert np.allclose(led["ttc"][clear], dhw[clear] / closing[clear], atol=0.0051, rtol=1e-6)
    assert (led["ttc"] < 0.0).any()
    alone = tracks[tracks["precedingId"] == 0]
    assert len(alone) > 0
    assert np.all(alone[["dhw", "thw", "ttc", "precedingXVelocity"]] == 0.0)


# --- the traffic ---


def test_no_two_vehicles_overlap(recording):
    _, tracks, _, _ = recording
    for _, frame in tracks[tracks["frame"] % 10 == 0].groupby("frame"):
        box = frame[["x", "y", "width", "height"]].to_numpy()
        centre, size = box[:, :2] + 0.5 * box[:, 2:], box[:, 2:]
        apart = np.abs(centre[:, None] - centre[None, :]) - 0.5 * (size[:, None] + size[None, :])
        overlaps = np.all(apart < -0.01, axis=2) & ~np.eye(len(box), dtype=bool)
        assert not overlaps.any()


def test_lane_changes_are_smooth_and_take_seconds(recording):
    _, tracks, meta, _ = recording
    changers = meta.index[meta["numLaneChanges"] > 0]
    assert len(changers) >= 3
    lateral = tracks[tracks["id"].isin(changers)].groupby("id")["yVelocity"].agg(lambda v: v.abs().max())
    # 3.75 m in 4 to 8 s with a minimum-jerk path peaks at 1.875 x 3.75 / T.
    assert lateral.max() < 1.9
    assert lateral.max() > 0.6
    assert tracks["yAcceleration"].abs().max() < 2.5


def test_sizes_and_speeds_are_those_of_cars_and_trucks(recording):
    _, _, meta, _ = recording
    car, truck = meta[meta["class"] == "Car"], meta[meta["class"] == "Truck"]
    assert car["width"].between(3.6, 5.4).all()
    assert truck["width"].between(8.0, 18.75).all()
    assert car["height"].between(1.6, 2.2).all()
    assert 30.0 < car["meanXVelocity"].mean() < 37.0
    assert 22.0 < truck["meanXVelocity"].mean() < 26.5


# --- the folder ---


@pytest.mark.thorough
def test_same_seed_gives_the_same_bytes_with_any_number_of_workers(tmp_path):
    generate(TINY, tmp_path / "one")
    calls = []
    both = dataclasses.replace(TINY, workers=2)
    generate(both, tmp_path / "two", progress=lambda done, total: calls.append((done, total)))
    assert calls == [(0, 2), (1, 2), (2, 2)]
    one = _contents(tmp_path / "one")
    assert len(one) == 6
    assert one == _contents(tmp_path / "two")
    only = dataclasses.replace(TINY, n_recordings=1, first_id=2)
    generate(only, tmp_path / "second")
    assert _contents(tmp_path / "second").items() <= one.items()
    generate(dataclasses.replace(only, seed=1), tmp_path / "other")
    assert not set(_contents(tmp_path / "other").values()) & set(one.values())


@pytest.fixture
def without_traffic(monkeypatch):
    """Recordings of one number each: what happens to the folder does not depend on the traffic in them."""

    def write(config, root, number):
        write_recording(root, number, ({"id": np.array([number])},) * 3)
        return {path.name: path.stat().st_size for path in recording_files(root, number)}

    monkeypatch.setattr(dataset, "generate_recording", write)


@pytest.mark.usefixtures("without_traffic")
def test_a_stopped_run_is_resumed_where_it_stopped(tmp_path):
    root = tmp_path / "set"
    generate(dataclasses.replace(TINY, n_recordings=1), root)
    first = recording_files(root, 1)
    stamps = [path.stat().st_mtime_ns for path in first]
    # What a killed run leaves behind: a file of the next recording that is not in the list, and half a file.
    recording_files(root, 2)[0].write_text("half a fi")
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (root / f".02_tracksMeta.csv.{platform.node()}.{dead.pid}.unfinished").write_text("half")
    paths = generate(TINY, root)
    assert paths == [recording_files(root, number)[0] for number in (1, 2)]
    assert [path.stat().st_mtime_ns for path in first] == stamps
    generate(TINY, tmp_path / "whole")
    assert _contents(root) == _contents(tmp_path / "whole")
    assert not list(root.glob("*unfinished"))
    # A damaged file is noticed by its size and written again.
    first[1].write_text("id\n")
    generate(TINY, root)
    assert _contents(root) == _contents(tmp_path / "whole")


@pytest.mark.usefixtures("without_traffic")
def test_a_failed_recording_leaves_nothing(tmp_path):
    folders = [recording_files(tmp_path, number)[1] for number in (1, 2)]
    for folder in folders:
        folder.mkdir()  # no file can be written there
    with pytest.raises(OSError, match="_tracksMeta.csv"):
        generate(TINY, tmp_path)
    truth = json.loads((tmp_path / TRUTH_FILE).read_text())
    assert truth["recordings"] == {}
    assert not list(tmp_path.glob("*unfinished"))
    for folder in folders:
        folder.rmdir()
    generate(TINY, tmp_path)
    assert len(_contents(tmp_path)) == 6


def test_truth_file_says_that_the_recordings_are_generated(recording):
    truth = json.loads((recording[0] / TRUTH_FILE).read_text())
    assert truth["generated"] is True
    assert truth["planted_effects"] == []
    assert truth["config"]["seed"] == 0
    sizes = {path.name: path.stat().st_size for path in recording_files(recording[0], 8)}
    assert truth["recordings"] == {"08": sizes}


def test_another_configuration_in_the_same_folder_is_refused(recording):
    root = recording[0]
    before = _contents(root)
    with refused("generated-otherwise", file=str(root / TRUTH_FILE)) as caught:
        generate(dataclasses.replace(SHORT, car_speed=30.0), root)
    assert "car_speed=38.3 there, 30.0 here" in caught.value.problem.fault
    assert _contents(root) == before


def test_recordings_of_another_origin_are_never_overwritten(tmp_path):
    (tmp_path / "01_tracks.csv").write_text("measured")
    with refused("not-generated", file=str(tmp_path)):
        generate(TINY, tmp_path)
    assert (tmp_path / "01_tracks.csv").read_text() == "measured"


def test_a_broken_truth_file_is_named(tmp_path):
    (tmp_path / TRUTH_FILE).write_text("{")
    with refused("not-json", file=str(tmp_path / TRUTH_FILE)):
        generate(TINY, tmp_path)
