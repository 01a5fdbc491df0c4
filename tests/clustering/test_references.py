"""References from recordings: nothing held out, the cache, and the order of labels."""

import logging
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rearl_jax.cache import kept_folder
from rearl_jax.clustering import references as module
from rearl_jax.clustering.kl import Curves
from rearl_jax.clustering.references import ReferenceBuilder, _arrays
from rearl_jax.clustering.scenes import references_of
from rearl_jax.clustering.tracks import FeatureScale, TrackCollector, picked_in
from rearl_jax.config.clustering import BoConfig, ClusterConfig, FitOn, KlConfig
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.splits import split_scenes
from rearl_jax.metrics.frechet import frechet_distances
from tests.refusal import refused


def test_no_reference_is_an_evaluation_or_tuning_scene(clustered, task_config, traffic):
    scenes, _, splits = traffic
    held_out = np.concatenate([splits.evaluation, splits.tuning])
    references = references_of(scenes, clustered.scenes, task_config.cluster)
    assert len(held_out) >= 6
    assert not np.isin(clustered.reference_scenes, scenes.scene_id[held_out]).any()
    speed = scenes.scaled_speed[held_out].astype(np.float32)
    for reference in np.asarray(references.speed):
        assert not (speed == reference).all(axis=(1, 2)).any()


def test_tracks_of_held_out_scenes_are_labelled_but_not_fitted_on(clustered, traffic):
    scenes, tracks, splits = traffic
    found = clustered.tracks
    held_out = np.concatenate([splits.evaluation, splits.tuning])
    through = picked_in(tracks, scenes, held_out)
    assert 10 < through.sum() < len(tracks)
    names = {(scenes.recording[s], i) for s in held_out for i in np.unique(scenes.track_id[s])}
    expected = [(r, i) in names for r, i in zip(tracks.recording, tracks.track_id, strict=True)]
    np.testing.assert_array_equal(through, expected)
    assert int(found.fitted) == (~through).sum()
    assert len(found.labels) == len(tracks)


def test_labels_are_ordered_by_speed_and_shares_sum_to_one(clustered, traffic):
    scenes, tracks, _ = traffic
    speed = clustered.tracks.centres[:, 0].mean(axis=1)
    assert (np.diff(speed) > 0).all()
    assert np.bincount(clustered.tracks.labels, minlength=3).min() > 0
    np.testing.assert_allclose(clustered.scenes.vectors.sum(axis=1), 1.0)
    # One scene by hand.
    label = dict(zip(zip(tracks.recording, tracks.track_id, strict=True), clustered.tracks.labels, strict=True))
    seen = {(scenes.recording[7], i) for i in np.unique(scenes.track_id[7])}
    labels = [label[name] for name in seen if name in label]
    np.testing.assert_allclose(clustered.scenes.vectors[7], np.bincount(labels, minlength=3) / len(labels))


def test_labels_are_those_of_the_nearest_centre(clustered, traffic, task_config):
    scenes, tracks, splits = traffic
    training = ~picked_in(tracks, scenes, np.concatenate([splits.evaluation, splits.tuning]))
    features = tracks.features(scenes)
    assert 0.0 <= features[0].min() < features[0].max() < 60.0  # speeds as recorded [m/s]
    scale = FeatureScale.of(features[:, :, training], task_config.kl.weights)
    curves = scale.scaled(features)
    np.testing.assert_allclose(curves[:, :, training].max(axis=(1, 2)), task_config.kl.weights, rtol=1e-6)
    unitless = (clustered.tracks.centres - scale.low[:, None]) / (scale.high - scale.low)[:, None]
    unitless = unitless * scale.weight[:, None]
    distances = Curves(curves, task_config.kl).distances(unitless)
    np.testing.assert_allclose(distances.min(axis=0), clustered.tracks.distances, atol=1e-5)


def through_builder(config):
    builder = ReferenceBuilder(config)
    was_finished = not builder.needs_recordings
    scenes = build_scenes(builder.passing(iterate_recordings(config.data)), config)
    return was_finished, *builder.build(scenes, split_scenes(scenes, config.split))


def equal(one, other):
    first, second = _arrays(one), _arrays(other)
    return first.keys() == second.keys() and all(np.array_equal(first[name], second[name]) for name in first)


def test_finished_clustering_is_found_again_and_a_damaged_one_made_anew(
    task_config, clustered, traffic, monkeypatch, caplog
):
    was_finished, first, clusters = through_builder(task_config)
    assert not was_finished
    assert equal(clusters, clustered)  # the same as from tracks collected apart
    with monkeypatch.context() as patch:
        patch.setattr(module, "cluster", lambda *_: pytest.fail("clustered again"))
        patch.setattr("rearl_jax.clustering.tracks.track_features", lambda *_: pytest.fail("collected again"))
        was_finished, second, again = through_builder(task_config)
    assert was_finished
    assert equal(clusters, again)
    with refused("scenes-differ"):  # scenes of another configuration
        module.ReferenceBuilder(task_config).build(traffic[0].select(np.arange(9)), traffic[2])
    np.testing.assert_array_equal(first.speed, second.speed)
    (path,) = kept_folder("clusters").iterdir()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with caplog.at_level(logging.WARNING):
        repaired = module.ReferenceBuilder(task_config, traffic[1])
    assert "damaged" in caplog.text
    assert equal(clusters, repaired.build(traffic[0], traffic[2])[1])
    assert [item.name for item in kept_folder("clusters").iterdir()] == [path.name]


@pytest.mark.parametrize(
    "change",
    [{"kl": KlConfig(k=2)}, {"cluster": ClusterConfig(fit_on=FitOn.all)}, {"bo": BoConfig(enabled=True, seed=1)}],
    ids=["kl", "cluster", "bo"],
)
def test_other_configuration_other_cache_file(task_config, change):
    assert ReferenceBuilder(task_config)._path != ReferenceBuilder(replace(task_config, **change))._path
    assert ReferenceBuilder(task_config)._path == ReferenceBuilder(replace(task_config, study="other"))._path


def test_the_code_of_the_curves_distance_determines_a_clustering():
    assert frechet_distances.__module__.split(".")[1] in module._SOURCES


def test_a_touched_recording_has_another_cache_file(task_config):
    before, identity = ReferenceBuilder(task_config)._path, data_id(task_config.data)
    file = next(Path(task_config.data.root).glob("*_tracks.csv"))
    stat = file.stat()
    os.utime(file, ns=(1, 1))
    try:
        assert data_id(task_config.data) == identity
        assert ReferenceBuilder(task_config)._path != before
    finally:
        os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def test_leaks_are_said(task_config, traffic, caplog):
    scenes, tracks, splits = traffic
    config = replace(task_config, cluster=ClusterConfig(fit_on=FitOn.all))
    builder = ReferenceBuilder(config)
    builder._collector.collected = lambda: tracks
    with caplog.at_level(logging.WARNING):
        _, clusters = builder.build(scenes, splits)
    held_out = np.concatenate([splits.evaluation, splits.tuning])
    assert np.isin(clusters.scenes.representatives, held_out).any()
    assert "not held out" in caplog.text


def test_nothing_collected_is_an_error_with_a_remedy(task_config):
    collector = TrackCollector(task_config)
    with refused("tracks-too-few"):
        collector.collected()
