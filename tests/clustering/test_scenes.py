"""Label shares, clusters of scenes and what represents them."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.clustering.scenes import SceneClusters, cluster_scenes, label_shares, may_be_fitted, references_of
from rearl_jax.config.clustering import ClusterConfig, FitOn, Representative, SceneVector
from rearl_jax.data.scenes.splits import Split
from tests.refusal import refused


def vectors(n=60, seed=0):
    return np.random.default_rng(seed).dirichlet(np.ones(3), n)


def test_shares_by_hand():
    # Scenes, times, slots. First scene: track 5 (label 0) three times, track 7 (label 2) once, track 9 (no label)
    # twice; second scene: empty.
    track = np.array([[[5, 5, 5], [7, 9, 9]], [[-1] * 3, [-1] * 3]])
    labels = np.array([[[0, 0, 0], [2, -1, -1]], [[-1] * 3, [-1] * 3]])
    unique = label_shares(labels, track, 3, SceneVector.unique_tracks)
    np.testing.assert_allclose(unique, [[0.5, 0.0, 0.5], [0, 0, 0]])
    slots = label_shares(labels, track, 3, SceneVector.slot_weighted)
    np.testing.assert_allclose(slots, [[0.75, 0.0, 0.25], [0, 0, 0]])


def test_clusters_are_ordered_and_representatives_are_their_nearest_members():
    points = vectors()
    allowed = np.arange(60) % 3 != 0
    found = cluster_scenes(points, allowed, ClusterConfig())
    assert found.centres.shape == (15, 3)
    assert (np.diff(found.centres[:, 0]) <= 0).all()
    np.testing.assert_allclose(found.centres.sum(axis=1), 1.0)
    assert allowed[found.representatives].all()
    assert len(set(found.representatives)) == 15
    for cluster, scene in enumerate(found.representatives):
        members = found.members(cluster)
        assert scene in members
        distance = np.linalg.norm(points[members] - found.centres[cluster], axis=1)
        assert np.linalg.norm(points[scene] - found.centres[cluster]) == pytest.approx(distance.min(), abs=1e-6)
    nearest = np.linalg.norm(points[:, None] - found.centres[None], axis=2).argmin(axis=1)
    np.testing.assert_array_equal(found.labels, nearest)  # also those that were not fitted on


def test_fewer_different_scenes_than_clusters(caplog):
    different = vectors(4)
    points = different[[2, 1, 1, 0, 2, 3, 3, 3]]
    with caplog.at_level(logging.WARNING):
        found = cluster_scenes(points, np.ones(8, bool), ClusterConfig())
    assert "4 instead of cluster.n_clusters = 15" in caplog.text
    assert found.n_distinct == len(found.centres) == 4
    assert sorted(found.representatives) == [0, 1, 3, 5]  # of equal scenes the first


def test_scene_without_labelled_tracks_has_no_cluster():
    points = vectors(20)
    points[4] = 0.0
    found = cluster_scenes(points, np.ones(20, bool), ClusterConfig(n_clusters=3))
    assert found.labels[4] == -1
    assert not found.fitted[4]
    assert (np.delete(found.labels, 4) >= 0).all()


def test_no_scene_left_to_fit_on():
    with refused("scenes-too-few"):
        cluster_scenes(vectors(5), np.zeros(5, bool), ClusterConfig())


def test_references_are_the_recorded_scenes_or_their_means(traffic):
    scenes, _, _ = traffic
    found = cluster_scenes(vectors(len(scenes)), np.ones(len(scenes), bool), ClusterConfig(n_clusters=4))
    medoids = references_of(scenes, found, ClusterConfig())
    for name, values in (("speed", scenes.scaled_speed), ("spacing", scenes.spacing), ("action", scenes.action)):
        np.testing.assert_allclose(getattr(medoids, name), values[found.representatives], rtol=1e-6)
    np.testing.assert_allclose(medoids.mean_spacing, scenes.mean_spacing[found.representatives], rtol=1e-6)
    means = references_of(scenes, found, ClusterConfig(representative=Representative.slot_mean))
    members = found.members(2)
    assert len(members) > 2
    np.testing.assert_allclose(means.speed[2], scenes.scaled_speed[members].mean(axis=0), rtol=1e-6)
    votes = np.array([np.bincount(scenes.action[members, 3, slot]).argmax() for slot in range(scenes.n_slots)])
    np.testing.assert_array_equal(means.action[2, 3], votes)


@pytest.mark.parametrize("representative", list(Representative))
def test_share_of_a_reference_is_that_of_its_cluster_among_the_fitted_scenes(traffic, representative):
    scenes = traffic[0]
    labels, fitted = np.full(len(scenes), -1), np.zeros(len(scenes), bool)
    labels[:10] = [0, 0, 0, 0, 1, 1, 2, 2, 2, 2]
    toy = SceneClusters(
        vectors=vectors(len(scenes)),
        fitted=fitted,
        labels=labels,
        centres=vectors(3),
        representatives=np.array([0, 4, 6]),
        n_distinct=len(scenes),
    )
    some = replace(toy, fitted=np.isin(np.arange(len(scenes)), [0, 1, 2, 4, 6]))  # 3, 1 and 1
    config = ClusterConfig(representative=representative)
    np.testing.assert_allclose(references_of(scenes, some, config).share, [0.6, 0.2, 0.2], rtol=1e-6)
    every = replace(toy, fitted=labels >= 0)  # 4, 2 and 4
    np.testing.assert_allclose(references_of(scenes, every, config).share, [0.4, 0.2, 0.4], rtol=1e-6)


def test_scenes_that_may_be_fitted(traffic):
    splits = traffic[2]
    allowed = may_be_fitted(splits, FitOn.not_eval)
    assert len(splits.evaluation) >= 5
    assert not allowed[splits.evaluation].any()
    assert not allowed[splits.tuning].any()
    assert allowed[splits.threshold].all()
    dropped = replace(splits, label=np.where(np.arange(len(allowed)) == 0, Split.DROPPED, splits.label))
    assert not may_be_fitted(dropped, FitOn.not_eval)[0]
    assert may_be_fitted(dropped, FitOn.all).all()
