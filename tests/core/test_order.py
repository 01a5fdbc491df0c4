"""The order of the vehicles along the road, compared with NumPy's sort by two keys."""

import jax
import numpy as np
import pytest

from rearl_jax.core.order import sort_along_road


@pytest.mark.parametrize("n_vehicles", [2, 3, 5, 30, 31])
@pytest.mark.parametrize("scenario_shape", [(), (7,)])
def test_vehicles_are_ordered_by_rising_x_and_at_equal_x_by_falling_index(n_vehicles, scenario_shape):
    rng = np.random.default_rng(n_vehicles)
    shape = n_vehicles, *scenario_shape
    x = rng.integers(0, n_vehicles // 2 + 1, shape).astype(np.float32)  # [m]; fewer positions than vehicles
    x[-1] = np.inf  # behind every vehicle with a position
    index = np.broadcast_to(np.arange(n_vehicles, dtype=np.int32).reshape(-1, *[1] * len(scenario_shape)), shape)
    order_before = rng.permuted(index, axis=0)
    expected = np.lexsort((-index, x), axis=0)
    assert (expected != order_before).any()
    np.testing.assert_array_equal(jax.jit(sort_along_road)(x, order_before), expected)
