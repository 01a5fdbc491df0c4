"""Large traffic asks about lanes only those whose decision is due."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import idm_driving
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import LARGEST_SMALL_TRAFFIC, derive_state, sort_if_large
from rearl_jax.core.spawn import spawn
from rearl_jax.core.step import step

N_VEHICLES = 60
MODEL = TrafficModel()


@pytest.mark.slow
def test_where_more_are_due_than_have_places_all_decide(monkeypatch):
    state, drivers = spawn(jax.random.split(jax.random.key(5), 6), MODEL, n_vehicles=N_VEHICLES, density=1.5)
    state = sort_if_large(replace(state, ticks_to_decision=jnp.zeros_like(state.ticks_to_decision)))

    def target_lanes():
        def decide(state):
            return idm_driving.drive_by_idm(state, derive_state(state, MODEL), drivers, MODEL).target_lane

        return np.asarray(jax.jit(decide, compiler_options=QUICKLY_COMPILED)(state))

    assert LARGEST_SMALL_TRAFFIC < N_VEHICLES
    assert idm_driving.VEHICLES_PER_SEARCHER > 3
    some_at_a_time = target_lanes()
    monkeypatch.setattr(idm_driving, "VEHICLES_PER_SEARCHER", 1)
    changes = some_at_a_time != np.asarray(state.target_lane)
    assert changes[: N_VEHICLES // 3].any()
    assert changes[-N_VEHICLES // 3 :].any()
    np.testing.assert_array_equal(some_at_a_time, target_lanes())


@pytest.mark.thorough  # compiling takes half a minute
def test_large_traffic_has_slopes_where_lanes_are_changed():
    state, drivers = spawn(jax.random.split(jax.random.key(5), 2), MODEL, n_vehicles=30, density=1.5)

    def mean_position(time_gap):
        following = replace(drivers.car_following, time_gap=jnp.broadcast_to(time_gap, (1, 1)))
        slower = replace(drivers, car_following=following)
        after = jax.lax.scan(lambda before, _: (step(before, slower, MODEL), None), state, length=3)[0]
        return after.x.mean(), after.target_lane

    derivative = jax.jit(jax.grad(mean_position, has_aux=True), compiler_options=QUICKLY_COMPILED)
    slope, target_lane = derivative(jnp.asarray(1.5, state.x.dtype))
    assert (np.asarray(target_lane) != np.asarray(state.target_lane)).any()
    assert np.isfinite(slope)
    assert slope < 0
