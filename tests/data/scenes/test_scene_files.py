"""Scenes written and read again."""

import json
from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.scenes.scene_files import load_scenes, save_scenes, scene_table
from rearl_jax.data.scenes.scene_set import ARRAYS, SceneCounts, SceneSet
from rearl_jax.problems import MissingInputError
from rearl_jax.results import Study, read_metadata
from tests.refusal import refused


@pytest.fixture
def scenes() -> SceneSet:
    rng = np.random.default_rng(0)
    shape = (3, 5, 4)
    reals = {
        name: rng.normal(20.0, 5.0, shape)
        for name in ("x", "y", "position", "length", "speed", "spacing", "feature_distance")
    }
    speed = reals["speed"]
    info = RecordingInfo("a", 25.0, {1: 2, 2: 3}, 420.0, "test", "CC BY-SA 4.0", "somebody", notes=("note",))
    return SceneSet(
        scene_id=np.array([4, 0, 7]),
        recording=np.array(["a", "a", "longer"]),
        window=np.array([1, 3, 0]),
        start_frame=np.array([1500, 4500, 17]),
        start_time=np.array([60.0, 180.0, 0.0]),
        frame_rate=np.array([25.0, 25.0, 10.0]),
        track_id=rng.integers(1, 2**40, shape),
        lane=rng.integers(-1, 3, shape).astype(np.int8),
        direction=rng.integers(1, 3, shape).astype(np.int8),
        action=rng.integers(0, 5, shape).astype(np.int8),
        has_next=rng.random(shape) < 0.5,
        next_lane=rng.integers(-1, 3, shape).astype(np.int8),
        is_long_track=rng.random(shape) < 0.5,
        speed_min=float(speed.min()),
        speed_max=float(speed.max()),
        speed_norm=SpeedNorm.minmax,
        infos=(info,),
        counts=SceneCounts(2, 0, 9, 6, 3),
        settings={"scenes.seconds": 5, "scenes.stride": None, "speed.norm": "minmax"},
        **reals,
    )


@pytest.fixture
def study(tmp_path) -> Study:
    return Study(tmp_path, "test", {}, "prepare", "an id")


def test_reading_gives_back_every_value(scenes, study):
    loaded = load_scenes(save_scenes(scenes, study))
    for item in fields(SceneSet):
        stored, read = getattr(scenes, item.name), getattr(loaded, item.name)
        if item.name in ARRAYS:
            np.testing.assert_array_equal(read, stored, strict=item.name != "recording")
        else:
            assert read == stored
    assert loaded.data_id == scenes.data_id
    assert replace(loaded, speed=loaded.speed + 1e-9).data_id != scenes.data_id


def test_the_table_is_readable_without_this_package(scenes, study):
    path = save_scenes(scenes, study)
    table = pd.read_parquet(path)
    row = table[(table["scene_id"] == 7) & (table["k"] == 3) & (table["slot"] == 2)].iloc[0]
    assert row["recording"] == "longer"
    assert row["speed"] == scenes.speed[2, 3, 2]
    assert row["scaled_speed"] == scenes.scaled_speed[2, 3, 2]
    assert (table["lane"].isna().to_numpy() == (scenes.lane == -1).reshape(-1)).all()
    assert table["lane"].min() == 0
    assert table["scaled_speed"].agg(["min", "max"]).tolist() == [5.0, 32.0]
    assert read_metadata(path)["data_id"] == "an id"


def test_files_that_hold_no_scenes_are_refused(scenes, study, tmp_path):
    with refused("file-missing", MissingInputError):
        load_scenes(tmp_path / "none.parquet")
    other = study.write_table("other", pd.DataFrame({"a": [1]}))
    with refused("no-scenes"):
        load_scenes(other)


@pytest.mark.parametrize(
    ("change", "code", "column"),
    [
        (lambda table: table.iloc[:-1], "rows-changed", None),
        (lambda table: table.iloc[::-1].reset_index(drop=True), "rows-changed", None),
        (lambda table: table.drop(columns="spacing"), "column-missing", "spacing"),
    ],
)
def test_files_changed_afterwards_are_refused(scenes, study, change, code, column):
    stored = read_metadata(save_scenes(scenes, study))["scenes"]
    path = study.write_table("changed", change(scene_table(scenes)), scenes=stored)
    with refused(code, file=str(path), column=column):
        load_scenes(path)


@pytest.mark.parametrize(
    "change", [{"shape": None}, {"shape": [6, 60]}, {"speed_norm": "nothing"}, {"counts": {"x": 1}}]
)
def test_a_wrong_description_is_refused(scenes, study, change):
    stored = json.loads(read_metadata(save_scenes(scenes, study))["scenes"])
    changed = {key: value for key, value in (stored | change).items() if value is not None}
    path = study.write_table("changed", scene_table(scenes), scenes=json.dumps(changed))
    with refused("metadata-unusable", file=str(path)):
        load_scenes(path)
