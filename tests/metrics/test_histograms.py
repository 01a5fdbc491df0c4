"""Speed histograms and the Hellinger distance against NumPy, at the edges, and frame by frame."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.metrics import HistConfig, OutOfBounds
from rearl_jax.metrics.histograms import (
    bin_counts,
    cumulative_speed_counts,
    equal_edges,
    hellinger_distance,
    histogram_distances,
    legacy_scale,
    noise_floor,
    speed_counts,
    speed_edges,
    window_counts,
    window_distances,
)
from tests.metrics import reference

HELLINGER = jax.jit(hellinger_distance)
COUNTS = jax.jit(bin_counts, static_argnames=("edges", "drop"))
SPEED_COUNTS = jax.jit(speed_counts, static_argnums=1)
CUMULATIVE = jax.jit(cumulative_speed_counts, static_argnums=1)
BOTH = pytest.mark.parametrize("oob", list(OutOfBounds), ids=lambda oob: oob.name)


def speeds(seed, dtype, low=0.0, high=40.0, n_steps=60):
    return np.random.default_rng(seed).uniform(low, high, (n_steps, 10)).astype(dtype)


@partial(jax.jit, static_argnums=(2, 3))
def distances(simulated, real, hist, dtype):
    rows = [cumulative_speed_counts(v, hist) for v in (simulated, real)]
    return window_distances(*rows, hist, dtype)


def test_edges_are_the_published_ones():
    assert speed_edges(HistConfig()) == (5.0, 8.375, 11.75, 15.125, 18.5, 21.875, 25.25, 28.625, 32.0)


@BOTH
def test_windows_equal_the_reference(dtype, oob):
    hist = HistConfig(oob=oob)
    simulated, real = speeds(0, dtype), speeds(1, dtype, 8.0, 30.0)
    assert (simulated < 5).any()
    assert (simulated > 32).any()
    found = distances(simulated, real, hist, dtype)
    expected = reference.window_hellinger(simulated, real, hist)
    assert len(expected) == 56
    assert found.value.dtype == dtype
    assert bool(found.valid.all())
    np.testing.assert_allclose(found.value, expected, rtol=1e-5)
    assert np.ptp(np.asarray(expected)) > 0.1, "the case must not be trivial"


def test_clip_and_drop_differ_by_what_lies_outside(dtype):
    values = np.asarray([-3.0, 4.999, 5.0, 8.375, 31.9, 32.0, 32.5, math.nan], dtype)
    assert SPEED_COUNTS(values, HistConfig(oob=OutOfBounds.clip)).tolist() == [3, 1, 0, 0, 0, 0, 0, 3]
    assert SPEED_COUNTS(values, HistConfig(oob=OutOfBounds.drop)).tolist() == [1, 1, 0, 0, 0, 0, 0, 2]


@pytest.mark.parametrize(("low", "high", "n_bins"), [(0.0, 35.0, 10), (-12.0, 12.0, 11), (0.1, 0.7, 6)])
def test_counts_are_numpys_at_every_edge(low, high, n_bins):
    edges = equal_edges(low, high, n_bins)
    around = [edge + step for edge in edges for step in (-1e-12, 1e-12)]
    values = np.array([*edges, *around, low - 1, high + 1])
    expected, _ = np.histogram(values, edges)
    assert COUNTS(values, edges, drop=True).tolist() == expected.tolist()
    clipped, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges)
    assert COUNTS(values, edges, drop=False).tolist() == clipped.tolist()


@BOTH
def test_frame_by_frame_equals_the_whole(dtype, oob):
    hist = HistConfig(oob=oob)
    v = speeds(2, dtype)
    whole = np.asarray(CUMULATIVE(v, hist))
    row, rows = whole[0], [whole[0]]
    for frame in v:
        row = row + np.asarray(SPEED_COUNTS(frame, hist))
        rows.append(row)
    assert int(row.sum()) > 300
    np.testing.assert_array_equal(whole, np.stack(rows))


def test_zero_on_itself_one_on_disjoint_symmetric_and_bounded(dtype):
    rng = np.random.default_rng(3)
    p, q = (rng.dirichlet(np.full(8, 0.3), 200).T.astype(dtype) for _ in range(2))
    h = np.asarray(HELLINGER(p, q))
    assert (h > 0).all()
    assert (h <= 1).all()
    assert (np.asarray(HELLINGER(q, p)) == h).all()
    assert (np.asarray(HELLINGER(p, p)) == 0).all()
    left, right = np.asarray([1, 0, 0], dtype), np.asarray([0, 0.5, 0.5], dtype)
    assert float(HELLINGER(left, right)) == pytest.approx(1.0, rel=1e-6)
    half = HELLINGER(np.asarray([1, 0], dtype), np.asarray([0.5, 0.5], dtype))
    assert float(half) == pytest.approx(math.sqrt(1 - math.sqrt(0.5)), rel=1e-6)


def test_gradient_at_empty_bins_is_finite(dtype):
    p, q = np.asarray([1, 0, 0], dtype), np.asarray([0.5, 0.5, 0], dtype)
    slope = jax.jit(jax.grad(hellinger_distance))
    assert np.isfinite(slope(p, q)).all()
    assert np.isfinite(slope(p, p)).all()


def test_an_empty_histogram_is_not_a_distance(dtype):
    hist = HistConfig(oob=OutOfBounds.drop)
    simulated, real = np.full((7, 10), 50, dtype), speeds(4, dtype, 6.0, 30.0, 7)
    simulated[:2] = 20
    found = distances(simulated, real, hist, dtype)
    assert found.valid.tolist() == [True, True, False]
    assert float(found.value[2]) == 0
    assert reference.window_hellinger(simulated, real, hist)[2] is None
    nothing = np.zeros(8, np.int32)
    both = jax.jit(histogram_distances, static_argnums=2)(nothing, nothing, dtype)
    assert not bool(both.valid)


def test_legacy_scale():
    assert legacy_scale(HistConfig()) == pytest.approx(0.3849, abs=5e-5)
    assert legacy_scale(HistConfig()) == math.sqrt(0.5 / 3.375)


@pytest.mark.parametrize("window", [0, 8])
def test_a_window_longer_than_the_scene_is_refused(window):
    with pytest.raises(ValueError, match="window must have 1 to 7 frames"):
        window_counts(jnp.zeros((8, 3), jnp.int32), window)


@pytest.mark.thorough
def test_noise_floor_equals_a_numpy_simulation():
    p = np.array([0.02, 0.08, 0.15, 0.25, 0.25, 0.15, 0.08, 0.02])
    draws = noise_floor(jnp.asarray(p), n_draws=1500, key=jax.random.key(0))
    rng = np.random.default_rng(0)
    expected = [reference.hellinger(*(rng.multinomial(50, p, 2) / 50)) for _ in range(1500)]
    assert draws.shape == (1500,)
    assert 0.1 < np.mean(expected) < 0.25
    error = np.hypot(np.std(expected), draws.std()) / math.sqrt(1500)
    assert abs(float(draws.mean()) - np.mean(expected)) < 5 * error
    assert float(noise_floor(jnp.asarray(p), n_samples=5000, n_draws=100, key=jax.random.key(1)).mean()) < 0.03
    certain = noise_floor(jnp.asarray([0.0, 1.0, 0.0]), n_draws=10, key=jax.random.key(2))
    assert bool((certain == 0).all())
