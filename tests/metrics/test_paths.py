"""Displacement and Frechet distance of trajectories against plain loops, with vehicles that are absent."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.metrics.paths import Paths, displacement, frechet

BOTH = jax.jit(lambda one, other: (displacement(one, other), frechet(one, other)))


def make_paths(seed, absent=0.0, shape=(9, 4, 3)):
    """Vehicles that drive on and change lanes, some of them absent at times."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(0.0, 80.0, shape[1:]) + np.cumsum(rng.uniform(0.0, 30.0, shape), axis=0)
    return Paths(along, 4.0 * rng.integers(0, 3, shape), rng.uniform(size=shape) >= absent)


def coupled(p, q):
    """Discrete Frechet distance by recursion over the last pair of points."""
    known = {}
    for i, j in np.ndindex(len(p), len(q)):
        before = [known[cell] for cell in ((i - 1, j), (i, j - 1), (i - 1, j - 1)) if cell in known]
        known[i, j] = max(math.dist(p[i], q[j]), min(before, default=0.0))
    return known[len(p) - 1, len(q) - 1]


def expected(one, other):
    """Values and counts of both distances, scenario by scenario."""
    found = []
    for scenario in range(one.along.shape[2]):
        distances, farthest = [], []
        for vehicle in range(one.along.shape[1]):
            at = [
                t for t in range(len(one.along)) if one.known[t, vehicle, scenario] & other.known[t, vehicle, scenario]
            ]
            p, q = (
                [(paths.along[t, vehicle, scenario], paths.across[t, vehicle, scenario]) for t in at]
                for paths in (one, other)
            )
            distances += [math.dist(a, b) for a, b in zip(p, q, strict=True)]
            farthest += [coupled(p, q)] if at else []
        found.append(
            (np.mean(distances or [0.0]), len(distances), np.mean(farthest or [0.0]), len(farthest)),
        )
    return np.transpose(found)


def assert_as_expected(one, other):
    (mean, n_positions), (farthest, n_vehicles) = ((m.value, m.count) for m in BOTH(one, other))
    wanted = expected(one, other)
    np.testing.assert_allclose(mean, wanted[0])
    np.testing.assert_array_equal(n_positions, wanted[1])
    np.testing.assert_allclose(farthest, wanted[2])
    np.testing.assert_array_equal(n_vehicles, wanted[3])
    return wanted


@pytest.mark.parametrize("absent", [0.0, 0.4, 0.9])
def test_distances_equal_plain_loops(absent):
    wanted = assert_as_expected(make_paths(1, absent), make_paths(2, absent))
    assert wanted[0].max() > 1
    assert (wanted[3] < 4).any() or absent < 0.9


def test_nobody_known_has_no_distance():
    one, other = make_paths(3), make_paths(4, absent=1.1)
    for measure in BOTH(one, other):
        assert (measure.count == 0).all()
        assert (measure.value == 0).all()


def test_distances_are_zero_of_the_same_scene_symmetric_and_at_least_the_ends():
    one, other = make_paths(5, 0.3), make_paths(6)
    assert all((measure.value == 0).all() for measure in BOTH(one, one))
    for there, back in zip(BOTH(one, other), BOTH(other, one), strict=True):
        np.testing.assert_allclose(there.value, back.value, rtol=1e-12)
    moved = Paths(one.along + 3.0, one.across + 4.0, one.known)
    mean, farthest = BOTH(one, moved)
    np.testing.assert_allclose(mean.value, 5.0)
    assert (farthest.value <= 5.0 + 1e-9).all()


def test_the_time_matters_to_the_displacement_alone():
    """One vehicle stands for two seconds before it drives the way of the other, the other after it."""
    way = np.array([0.0, 0.0, 0.0, 20.0, 40.0])
    late, early = (np.asarray(x)[:, None, None] for x in (way, [0.0, 20.0, 40.0, 40.0, 40.0]))
    one, other = (Paths(x, 0 * x, np.ones(x.shape, bool)) for x in (late, early))
    mean, farthest = BOTH(one, other)
    assert float(farthest.value[0]) == 0.0
    assert float(mean.value[0]) == pytest.approx((20.0 + 40.0 + 20.0) / 5)


def test_float32_stays_float32():
    one, other = (jax.tree.map(jnp.asarray, make_paths(seed)) for seed in (7, 8))
    narrow = [jax.tree.map(lambda x: x.astype("float32") if x.dtype.kind == "f" else x, each) for each in (one, other)]
    for wide, short in zip(BOTH(one, other), BOTH(*narrow), strict=True):
        assert short.value.dtype == np.float32
        np.testing.assert_allclose(short.value, wide.value, rtol=1e-5)
