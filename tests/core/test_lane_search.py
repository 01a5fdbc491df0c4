"""Search of neighbours: the sorted road gives the same as comparing all pairs, vehicles abreast included."""

import functools
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import neighbours
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.lane_search import find_ahead, find_behind
from rearl_jax.core.neighbours import derive_state, sort_if_large
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.core.state import make_state
from rearl_jax.core.stimuli import vehicle_states
from tests.core.simulation import MODEL, default_drivers

N_VEHICLES, N_SCENARIOS = 30, 40


@functools.cache
def program(largest):
    """Three leaders and a follower on a lane, with traffic of up to so many vehicles taken for small; compiled once."""

    def search(state, drivers, lane):
        state = sort_if_large(state)
        derived = derive_state(state, MODEL)
        vehicles = vehicle_states(state, derived, drivers)
        return (*find_ahead(state, derived, vehicles, lane, 3), find_behind(state, derived, vehicles, lane))

    return jax.jit(search, compiler_options=QUICKLY_COMPILED)


def neighbour_indices(state, drivers, lane, largest):
    with mock.patch.object(neighbours, "LARGEST_SMALL_TRAFFIC", largest):
        return [np.asarray(neighbour.index) for neighbour in program(largest)(state, drivers, lane)]


@pytest.mark.parametrize("places", [4, 12, 1000], ids=["piled up", "abreast", "spread"])
def test_sorted_road_and_list_agree_on_leaders_and_follower(places):
    rng = np.random.default_rng(places)
    shape = (N_VEHICLES, N_SCENARIOS)
    x, y = 10.0 * rng.integers(0, places, shape), rng.uniform(-1.0, 13.0, shape)
    state = make_state(x, y, rng.uniform(0.0, 30.0, shape), MODEL)
    drivers = default_drivers(shape, np.float32)
    lane = jnp.asarray(rng.integers(-1, MODEL.n_lanes + 1, shape), jnp.int32)
    by_order = neighbour_indices(state, drivers, lane, largest=N_VEHICLES - 1)
    by_list = neighbour_indices(state, drivers, lane, largest=N_VEHICLES)
    leader = by_list[0]
    assert (leader != NO_VEHICLE).sum() > 400
    assert (leader == NO_VEHICLE).sum() > 200
    assert places > 12 or ((np.take_along_axis(x, leader, axis=0) == x) & (leader != NO_VEHICLE)).sum() > 100
    for actual, expected in zip(by_order, by_list, strict=True):
        np.testing.assert_array_equal(actual, expected)
