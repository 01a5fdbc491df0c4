"""Leaders and followers on every lane, read off the order along the road, against a search through all vehicles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.nearest import LaneFields, lane_bit, scan_along_road
from rearl_jax.core.order import NO_VEHICLE

N_SCENARIOS = 3


def traffic(n_vehicles, n_lanes, seed):
    """Positions, a tenth of them shared, the order along the road, and lanes, none, one or two of each vehicle."""
    rng = np.random.default_rng(seed)
    shape = (n_vehicles, N_SCENARIOS)
    x = rng.permuted(np.broadcast_to(np.arange(n_vehicles)[:, None], shape), axis=0)
    x = np.where(rng.uniform(size=shape) < 0.1, x // 2, x).astype(np.float32)
    order = np.stack([np.lexsort((-np.arange(n_vehicles), column)) for column in x.T], axis=1).astype(np.int32)
    on = np.zeros(shape, np.int32)
    for _ in range(2):
        lane = rng.integers(0, n_lanes, shape)
        on |= np.where(rng.uniform(size=shape) < 0.6, 1 << (lane + 1), 0).astype(np.int32)
    return x, order, on


def plain(x, on, lane):
    """Leaders and followers as highway-env finds them: the same x is ahead; of equals the last, behind the first."""
    ahead, behind = np.full(x.shape, NO_VEHICLE), np.full(x.shape, NO_VEHICLE)
    for scenario in range(x.shape[1]):
        along = x[:, scenario]
        for me in range(len(x)):
            is_on = (on[:, scenario] & lane_bit(int(lane[me, scenario]))) != 0
            front = np.flatnonzero(is_on & (along >= along[me]) & (np.arange(len(x)) != me))
            rear = np.flatnonzero(is_on & (along < along[me]))
            if len(front):
                ahead[me, scenario] = front[along[front] == along[front].min()].max()
            if len(rear):
                behind[me, scenario] = rear[along[rear] == along[rear].max()].min()
    return ahead, behind


@pytest.mark.parametrize(("n_vehicles", "n_lanes"), [(2, 4), (19, 1), (30, 4), (30, 8), (129, 4), (600, 3)])
def test_leaders_and_followers(n_vehicles, n_lanes):
    x, order, on = traffic(n_vehicles, n_lanes, n_vehicles)
    assert n_vehicles < 19 or (np.diff(np.take_along_axis(x, order, axis=0), axis=0) == 0).sum() > 1
    lane = np.random.default_rng(1).integers(-1, n_lanes + 1, x.shape).astype(np.int32)

    def search(order, x, on, lane):
        nearest = scan_along_road(order, x, on, n_lanes)
        return nearest.ahead_on(lane), nearest.behind_on(lane)

    neighbours = jax.jit(search)(*map(jnp.asarray, (order, x, on, lane)))
    for actual, expected in zip(neighbours, plain(x, on, lane), strict=True):
        np.testing.assert_array_equal(actual, expected)


@pytest.mark.parametrize("n_vehicles", [2, 19, 128, 129, 1000, 65_000])
def test_every_vehicle_fits_into_a_field(n_vehicles):
    fields = LaneFields(n_vehicles, n_lanes=8)
    assert all(len(lanes) * fields.width <= 32 for lanes in fields.lanes_by_word)
    assert [lane for lanes in fields.lanes_by_word for lane in lanes] == list(range(8))
    index = jnp.asarray([0, n_vehicles - 1], jnp.int32)
    words = fields.insert(index, jnp.asarray([lane_bit(7), lane_bit(0) | lane_bit(3)], jnp.int32))
    for lane, expected in ((7, [0, NO_VEHICLE]), (0, [NO_VEHICLE, n_vehicles - 1]), (3, [NO_VEHICLE, n_vehicles - 1])):
        np.testing.assert_array_equal(fields.vehicle_in(fields.extract(words, jnp.full(2, lane, jnp.int32))), expected)
