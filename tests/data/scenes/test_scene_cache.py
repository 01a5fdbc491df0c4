"""Scenes kept on disk: found again, cut anew after any change, never in the way."""

import logging
import os
from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config import PrepareTask
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.config.scenes import ScenesConfig
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.scene_cache import SceneCache
from rearl_jax.data.scenes.scene_set import ARRAYS


@pytest.fixture
def task(tmp_path, highd_files, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    highd_files(tmp_path / "recordings", n_vehicles=24, n_frames=300)
    scenes = ScenesConfig(seconds=4, min_vehicles=4, slots=4)
    return PrepareTask(data=DataConfig(format=DataFormat.highd, root=str(tmp_path / "recordings")), scenes=scenes)


def cut(task):
    return build_scenes(iterate_recordings(task.data), task)


def test_scenes_are_found_again_value_for_value(task):
    cache = SceneCache(task.data, task)
    assert cache.read() is None
    scenes = cut(task)
    assert len(scenes) > 0
    cache.write(scenes)
    again = SceneCache(task.data, task).read()
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(scenes, name))
    assert (again.speed_min, again.data_id, again.counts) == (scenes.speed_min, scenes.data_id, scenes.counts)


def test_another_configuration_or_a_touched_file_has_another_place(task, tmp_path):
    first = SceneCache(task.data, task).path
    assert SceneCache(task.data, task).path == first
    other = replace(task, scenes=replace(task.scenes, stride=2))
    assert SceneCache(other.data, other).path != first
    file = tmp_path / "recordings" / "01_tracks.csv"
    content = file.read_bytes()
    file.write_bytes(content[:-3] + bytes([content[-3] ^ 1]) + content[-2:])  # as long as before
    os.utime(file, ns=(1, 1))
    assert SceneCache(task.data, task).path != first


def test_damage_and_missing_permission_are_warnings(task, caplog, tmp_path):
    scenes = cut(task)
    cache = SceneCache(task.data, task)
    cache.write(scenes)
    content = cache.path.read_bytes()
    cache.path.write_bytes(content[: len(content) // 2])
    with caplog.at_level(logging.WARNING):
        assert cache.read() is None
    assert "damaged" in caplog.text
    cache.path.unlink()
    cache.path.parent.rmdir()
    cache.path.parent.write_text("no folder")
    with caplog.at_level(logging.WARNING):
        cache.write(scenes)
    assert "not stored" in caplog.text
