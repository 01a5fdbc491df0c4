"""Groups of curves that are plain to see, and one clustering of generated traffic for all tests of the task."""

import numpy as np
import pytest

POINTS = 20


def random_curves(n_curves, n_points, seed=0):
    """Random walks, `[features, points, curves]`."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(3, n_points, n_curves)).cumsum(axis=1).astype(np.float32)


def random_bridges(n_curves, n_points, seed=0):
    """Random walks that start and end at 0, so that their ends do not decide their distance."""
    walks = random_curves(n_curves, n_points, seed)
    time = np.linspace(0.0, 1.0, n_points, dtype=np.float32)[:, None]
    return walks - walks[:, :1] - time * (walks[:, -1:] - walks[:, :1])


def grouped_curves(n_curves=240, seed=0):
    """Curves of three overlapping groups (slow, fast, slowing down), and their groups."""
    rng = np.random.default_rng(seed)
    group = rng.integers(3, size=n_curves)
    time = np.linspace(0.0, 1.0, POINTS)
    speed = np.stack([0.25 + 0 * time, 0.75 + 0 * time, 0.75 - 0.5 * time])[group]
    level = rng.normal(0.0, 0.08, (n_curves, 1))
    noise = rng.normal(0.0, 0.03, (n_curves, POINTS))
    position = np.broadcast_to(time, speed.shape) + rng.normal(0.0, 0.05, (n_curves, 1))
    distance = rng.uniform(0.2, 0.4, (n_curves, 1)) + 0.0 * speed
    curves = np.stack([speed + level + noise, position, distance]).transpose(0, 2, 1)
    return np.ascontiguousarray(curves.astype(np.float32)), group


@pytest.fixture
def walks():
    return random_curves


@pytest.fixture
def bridges():
    return random_bridges


@pytest.fixture
def groups():
    return grouped_curves


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    """No test finds a clustering of another one, or of the person who runs it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture(scope="session")
def task_config(tmp_path_factory):
    """Short scenes of two short generated recordings, so that there are many."""
    from rearl_jax.config import ClusterTask, ResultsConfig
    from rearl_jax.config.data import DataConfig, DataFormat
    from rearl_jax.config.generator import GeneratorConfig
    from rearl_jax.config.scenes import ScenesConfig, TracksConfig
    from rearl_jax.data.generator import generate

    root = tmp_path_factory.mktemp("recordings")
    generate(GeneratorConfig(n_recordings=2, duration_scale=0.25, workers=1), root)
    return ClusterTask(
        results=ResultsConfig(root=str(tmp_path_factory.mktemp("results"))),
        data=DataConfig(format=DataFormat.generated, root=str(root)),
        scenes=ScenesConfig(seconds=8, min_vehicles=5, slots=5),
        tracks=TracksConfig(points=24),
    )


@pytest.fixture(scope="session")
def traffic(task_config):
    """Scenes, tracks and splits of these recordings."""
    from rearl_jax.clustering.tracks import TrackCollector
    from rearl_jax.data.recordings import iterate_recordings
    from rearl_jax.data.scenes import build_scenes
    from rearl_jax.data.splits import split_scenes

    config = task_config
    collector = TrackCollector(config.scenes, config.tracks, config.features, config.spacing)
    scenes = build_scenes(
        collector.passing(iterate_recordings(config.data)),
        config.scenes,
        config.speed,
        config.tracks,
        config.features,
        config.spacing,
    )
    return scenes, collector.collected(), split_scenes(scenes, config.split)
