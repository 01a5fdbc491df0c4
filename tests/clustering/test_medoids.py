"""k-medoids against all choices."""

from itertools import combinations

import numpy as np
import pytest

from rearl_jax.clustering import medoids
from rearl_jax.clustering.medoids import build, farthest_first, swap


def distances(n, seed=0):
    points = np.random.default_rng(seed).normal(size=(n, 2))
    return np.linalg.norm(points[:, None] - points[None], axis=2)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("start", ["build", "farthest_first"])
def test_swapped_medoids_are_near_the_best_and_no_swap_helps(seed, start):
    table = distances(18, seed)
    first = getattr(medoids, start)(table, 3)
    found = medoids.swap(table, first)
    cost = table[found].min(axis=0).sum()
    best = min(table[list(chosen)].min(axis=0).sum() for chosen in combinations(range(18), 3))
    assert best <= cost <= table[first].min(axis=0).sum()
    assert cost <= 1.1 * best
    for place in range(3):
        for candidate in range(18):
            trial = found.copy()
            trial[place] = candidate
            assert table[trial].min(axis=0).sum() >= cost - 1e-12


def test_farthest_first_takes_the_farthest():
    points = np.array([0.0, 1.0, 10.0, 6.0])
    assert farthest_first(abs(points[:, None] - points[None]), 3).tolist() == [0, 2, 3]


def test_one_medoid_has_the_least_sum():
    table = distances(12)
    assert swap(table, build(table, 1)).tolist() == [int(table.sum(axis=1).argmin())]
