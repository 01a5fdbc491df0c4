"""(k,l)-clustering finds three groups, whatever the start and the update, and says when it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from rearl_jax.clustering.kl import Centres, Curves, cluster_curves, enclosing_ball, move_centres
from rearl_jax.config.clustering import CurveDistance, KlConfig, KlInit, KlUpdate
from tests.clustering.curves import grouped_curves
from tests.refusal import refused

SMALL = KlConfig(l=5, sample=60, centre_points=16)


@pytest.mark.parametrize("init", KlInit)
@pytest.mark.parametrize("update", KlUpdate)
def test_three_groups_are_found(init, update):
    curves, group = grouped_curves()
    kl = replace(SMALL, init=init, update=update)
    best, costs = cluster_curves(Curves(curves, kl), kl)
    assert best.vertices.shape == (3, 3, 5)
    assert best.cost == min(costs)
    # The groups overlap; speed at the ends alone must not do as well.
    assert adjusted_rand_score(group, best.labels) >= 0.6


@pytest.mark.parametrize("distance", [CurveDistance.discrete_raw, CurveDistance.continuous])
def test_other_distances_find_them_too(distance):
    curves, group = grouped_curves(60)
    curves = np.ascontiguousarray(curves[:, ::2])
    kl = replace(SMALL, distance=distance, sample=12, iterations=1)
    best, _ = cluster_curves(Curves(curves, kl), kl)
    assert adjusted_rand_score(group, best.labels) >= 0.6


@pytest.mark.parametrize("init", KlInit)
def test_updates_end_once_the_cost_stops_falling_and_the_best_is_kept(init):
    curves, _ = grouped_curves()
    kl = replace(SMALL, init=init, update=KlUpdate.mean, iterations=12)
    best, costs = cluster_curves(Curves(curves, kl), kl)
    assert 2 <= len(costs) < 13
    assert (np.diff(costs[:-1]) < 0).all()
    assert costs[-1] >= costs[-2]
    assert best.cost == costs[-2]


def test_equal_seeds_equal_centres():
    curves, _ = grouped_curves()
    runs = [cluster_curves(Curves(curves, kl), kl)[0].vertices for kl in (SMALL, SMALL, replace(SMALL, seed=1))]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_centre_without_members_stays():
    curves, _ = grouped_curves(30)
    vertices = np.stack([curves[:, ::4, 0].astype(np.float64), np.full((3, 5), 9.0)])
    searched = Curves(curves, SMALL)
    centres = Centres(vertices, searched.distances(vertices))
    assert set(centres.labels) == {0}
    after = move_centres(searched, centres, replace(SMALL, k=2), np.random.default_rng(0))
    np.testing.assert_array_equal(after[1], vertices[1])
    assert not np.array_equal(after[0], vertices[0])


def test_enclosing_ball_of_known_points():
    corners = np.array([[0.0, 4.0, 0.0, 4.0, 1.0], [0.0, 0.0, 2.0, 2.0, 1.0], [0.0] * 5])
    centre = enclosing_ball(corners, 60)
    radius = np.linalg.norm(corners - centre[:, None], axis=0).max()
    assert np.sqrt(5.0) <= radius < 1.05 * np.sqrt(5.0)
    assert radius < np.linalg.norm(corners - corners.mean(axis=1)[:, None], axis=0).max()


def test_too_few_curves_are_refused():
    with refused("out-of-range", key="kl.k"):
        Curves(grouped_curves(2)[0], SMALL)
