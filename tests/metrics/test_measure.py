"""Reductions: exact medians without sorting, a count with every value, no NaN from nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.metrics.measure import frame_mean, ratio, scene_count, scene_mean, scene_median, share_of

MEDIAN = jax.jit(scene_median)
MEAN = jax.jit(scene_mean)


@pytest.mark.parametrize("n_valid", [1, 2, 3, 50, 59, 60])
def test_median_is_numpys(dtype, n_valid):
    rng = np.random.default_rng(n_valid)
    values = rng.lognormal(sigma=4.0, size=(6, 10)).astype(dtype)
    valid = (rng.permutation(60) < n_valid).reshape(6, 10)
    median = MEDIAN(jnp.asarray(values), jnp.asarray(valid))
    assert int(median.count) == n_valid
    assert median.value.dtype == dtype
    np.testing.assert_allclose(median.value, np.median(values[valid].astype(float)), rtol=1e-6)
    if n_valid % 2:
        assert float(median.value) in values[valid], "of an odd number the median is one of them"


def test_median_of_ties_zeros_and_nothing(dtype):
    valid = np.ones((2, 4), bool)
    ties = jnp.asarray([[3, 3, 3, 3], [3, 3, 1, 9]], dtype)
    zeros = jnp.asarray([[-0.0, 0, 0, -0.0], [0, 0, 5, 7]], dtype)
    assert float(MEDIAN(ties, jnp.asarray(valid)).value) == 3
    assert float(MEDIAN(zeros, jnp.asarray(valid)).value) == 0
    nothing = MEDIAN(ties, jnp.zeros((2, 4), bool))
    assert (float(nothing.value), int(nothing.count)) == (0, 0)


def test_batched_median_equals_a_loop(dtype):
    rng = np.random.default_rng(1)
    values, valid = rng.uniform(0, 9, (6, 10, 7)).astype(dtype), rng.uniform(size=(6, 10, 7)) < 0.5
    valid[..., 3] = False
    together = jax.tree.map(np.asarray, MEDIAN(values, valid))
    for s in range(7):
        alone = MEDIAN(values[..., s], valid[..., s])
        assert (together.value[s], together.count[s]) == (alone.value, alone.count)
    assert int(together.count[3]) == 0


def test_means_and_shares_of_the_valid_entries_only(dtype):
    values = jnp.asarray([[1, jnp.nan], [5, 7]], dtype)
    valid = jnp.asarray([[True, False], [True, False]])
    mean = MEAN(values, valid)
    assert (float(mean.value), int(mean.count)) == (3, 2)
    assert mean.value.dtype == dtype
    assert float(jax.jit(frame_mean)(values[1], valid[:, 0]).value) == 6
    share = jax.jit(share_of, static_argnums=2)(jnp.asarray([[True, True], [False, True]]), valid, dtype)
    assert (float(share.value), int(share.count)) == (0.5, 2)
    assert int(scene_count(valid)) == 2


def test_nothing_to_divide_by_is_zero_with_count_zero(dtype):
    empty = jax.jit(ratio, static_argnums=2)(jnp.asarray(0), jnp.asarray(0), dtype)
    assert (float(empty.value), int(empty.count)) == (0, 0)
    mean = MEAN(np.full((2, 3), np.nan, dtype), np.zeros((2, 3), bool))
    assert (float(mean.value), int(mean.count)) == (0, 0)
