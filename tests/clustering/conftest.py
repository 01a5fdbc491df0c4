"""One clustering of generated traffic for all tests of the task."""

import pytest


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
    generate(GeneratorConfig(n_recordings=2, duration_scale=0.2, workers=1), root)
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
    from rearl_jax.data.scenes.cutting import build_scenes
    from rearl_jax.data.scenes.splits import split_scenes

    collector = TrackCollector(task_config)
    scenes = build_scenes(collector.passing(iterate_recordings(task_config.data)), task_config)
    return scenes, collector.collected(), split_scenes(scenes, task_config.split)


@pytest.fixture(scope="session")
def clustered(task_config, traffic):
    """Clusters of these tracks and scenes."""
    from rearl_jax.clustering.references import cluster

    scenes, tracks, splits = traffic
    return cluster(task_config, scenes, tracks, splits, None, scenes.data_id, lambda *stage: None)
