"""The order of the vehicles along the road."""

import jax
import numpy as np
import pytest

from rearl_jax.core.order import sort_along_road


@pytest.mark.parametrize("n_vehicles", [2, 3, 5, 30, 31])
@pytest.mark.parametrize("scenarios", [(), (7,)])
def test_order_is_by_rising_x_and_of_equal_x_by_falling_index(n_vehicles, scenarios):
    rng = np.random.default_rng(n_vehicles)
    shape = n_vehicles, *scenarios
    x = rng.integers(0, n_vehicles // 2 + 1, shape).astype(np.float32)  # many are abreast
    x[-1] = np.inf
    index = np.broadcast_to(np.arange(n_vehicles, dtype=np.int32).reshape(-1, *[1] * len(scenarios)), shape)
    start = rng.permuted(index, axis=0)
    expected = np.lexsort((-index, x), axis=0)
    assert (expected != start).any()
    np.testing.assert_array_equal(jax.jit(sort_along_road)(x, start), expected)
