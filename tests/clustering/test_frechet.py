"""Discrete and continuous Frechet distances against slow readings of their definitions, and against each other."""

import itertools

import numpy as np
import pytest

from rearl_jax.clustering import frechet
from rearl_jax.clustering.continuous import continuous_distances
from rearl_jax.clustering.frechet import aligned, discrete_distances, subdivided
from tests.clustering.curves import random_bridges, random_curves


def couplings(n, m):
    """All monotone couplings of n and m points."""

    def extend(path):
        i, j = path[-1]
        if (i, j) == (n - 1, m - 1):
            yield path
        for step in ((i + 1, j), (i, j + 1), (i + 1, j + 1)):
            if step[0] < n and step[1] < m:
                yield from extend([*path, step])

    return list(extend([(0, 0)]))


def longest_edge(curves):
    """Length of the longest edge of each of some polylines `[curves, features, points]`."""
    return np.linalg.norm(np.diff(curves, axis=2), axis=1).max(axis=1)


def by_definition(curve, centre):
    """Smallest largest distance over all couplings; `[features, points]` each."""
    distance = np.linalg.norm(curve[:, :, None] - centre[:, None, :], axis=0)
    return min(max(distance[cell] for cell in path) for path in couplings(curve.shape[1], centre.shape[1]))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 4), (5, 1), (5, 4), (4, 6)])
def test_discrete_distance_is_the_best_of_all_couplings(n, m):
    curves, centres = random_curves(7, n), random_curves(3, m, seed=1).transpose(2, 0, 1)
    found = discrete_distances(curves, centres)
    expected = [[by_definition(curves[:, :, i], centre) for i in range(7)] for centre in centres]
    assert found.shape == (3, 7)
    assert np.ptp(found) > 0.1
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_chunks_change_nothing(monkeypatch):
    curves, centres = random_curves(50, 12), random_curves(2, 6, seed=1).transpose(2, 0, 1)
    whole = frechet.discrete_distances(curves, centres)
    monkeypatch.setattr(frechet, "_CHUNK", 7)
    frechet._map.cache_clear()
    try:
        np.testing.assert_array_equal(frechet.discrete_distances(curves, centres), whole)
    finally:
        frechet._map.cache_clear()


def test_alignment_is_a_coupling_that_reaches_the_distance():
    curves, vertices = random_curves(30, 9), random_curves(1, 4, seed=2)[:, :, 0]
    coupled = aligned(curves, vertices)
    assert coupled.shape == (4, 9, 30)
    assert coupled[0, 0].all()
    assert coupled[-1, -1].all()
    assert coupled.any(axis=0).all()  # every point has a vertex
    assert coupled.any(axis=1).all()  # every vertex has a point
    assert 0.2 < coupled.mean() < 0.5
    first, last = coupled.argmax(axis=1), 8 - coupled[:, ::-1].argmax(axis=1)
    assert ((first[1:] == last[:-1]) | (first[1:] == last[:-1] + 1)).all()  # never back, nothing left out
    distance = np.linalg.norm(curves[:, None] - vertices[:, :, None, None], axis=0)
    reached = np.where(coupled, distance, 0.0).max(axis=(0, 1))
    np.testing.assert_allclose(reached, discrete_distances(curves, vertices[None])[0], rtol=1e-5)


def test_subdivision_keeps_the_polyline_and_halves_the_longest_edges():
    centres = random_curves(4, 5, seed=3).transpose(2, 0, 1).astype(np.float64)
    finer = subdivided(centres, 17)
    assert finer.shape == (4, 3, 17)
    for centre, points in zip(centres, finer, strict=True):
        at = [int(np.linalg.norm(points - vertex[:, None], axis=0).argmin()) for vertex in centre.T]
        np.testing.assert_allclose(points[:, at], centre)
        for edge, (a, b) in enumerate(itertools.pairwise(at)):
            pieces = np.diff(points[:, a : b + 1], axis=1)
            np.testing.assert_allclose(pieces, np.diff(centre, axis=1)[:, edge : edge + 1] / (b - a) * np.ones(b - a))
    assert (longest_edge(finer) < 0.5 * longest_edge(centres)).all()
    np.testing.assert_array_equal(subdivided(centres, 5), centres)


def test_continuous_distance_of_curves_with_known_distance():
    def distance(curve, other):
        return continuous_distances(np.array(curve).T[:, :, None], np.array(other).T[None])[0, 0]

    line = [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)]
    assert distance(line, [(0.0, 3.0, 0.0), (4.0, 3.0, 0.0)]) == pytest.approx(3.0)
    assert distance(line, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (4.0, 0.0, 0.0)]) == pytest.approx(0.0, abs=1e-9)
    assert distance(line, [(0.0, 0.0, 0.0), (2.0, 1.5, 0.0), (4.0, 0.0, 0.0)]) == pytest.approx(1.5)
    # Forth and back by 2 along the line: whoever walks straight can be no nearer than half of it.
    assert distance(line, [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (1.0, 0.0, 0.0), (4.0, 0.0, 0.0)]) == pytest.approx(1.0)


def test_continuous_distance_is_the_limit_of_discrete_ones():
    curves, centres = random_bridges(10, 6), random_bridges(2, 4, seed=4).transpose(2, 0, 1)
    found = continuous_distances(curves.astype(np.float64), centres)
    coarse = discrete_distances(curves, centres)
    fine = subdivided(curves.transpose(2, 0, 1).astype(np.float64), 800).transpose(1, 2, 0)
    limit = discrete_distances(fine.astype(np.float32), subdivided(centres.astype(np.float64), 800))
    assert (coarse > found + 0.01).sum() >= 3  # or there were nothing to see
    np.testing.assert_allclose(limit, found, atol=0.02)


@pytest.mark.parametrize("m", [4, 24])
def test_discrete_distance_exceeds_the_continuous_one_by_at_most_the_longest_edge(m):
    """Eiter & Mannila, Computing discrete Frechet distance, TU Wien report CD-TR 94/64 (1994), lemma 5."""
    curves, vertices = random_bridges(60, 10), random_bridges(3, 4, seed=5).transpose(2, 0, 1).astype(np.float64)
    centres = subdivided(vertices, m)
    discrete, continuous = discrete_distances(curves, centres), continuous_distances(curves.astype(float), vertices)
    edge = np.maximum(longest_edge(curves.transpose(2, 0, 1))[None], longest_edge(centres)[:, None])
    assert (discrete > continuous + 0.01).sum() >= 5
    assert (continuous <= discrete + 1e-5).all()
    assert (discrete <= continuous + edge + 1e-5).all()
