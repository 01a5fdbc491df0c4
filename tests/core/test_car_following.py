"""Platoons and lane changes over many time steps, and the order of the integrator."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.state import make_state
from tests.core import scenes
from tests.core.scenes import car_on
from tests.core.simulation import N_VEHICLES, advance, core_of, history


@pytest.mark.parametrize("speed", [0.0, 8.375, 15.125, 21.875])
def test_platoon_at_the_equilibrium_gap_stays(speed):
    """s_e = (s0 + v T) / sqrt(1 - (v / v0)^delta), centre to centre; at rest s0."""
    v0, delta = 28.0, 4.0
    gap = (10 + 1.5 * speed) / np.sqrt(1 - (speed / v0) ** delta)
    cars = [car_on(2, 50 + gap * i, speed, desired=v0, changes_lanes=False) for i in range(N_VEHICLES)]
    # The one in front keeps its speed: at a speed level, or stopped for good.
    cars[-1].kind, cars[-1].desired = scenes.META, speed
    if speed == 0:
        cars[-1].crashed = True
    state, drivers = core_of([cars])
    states = history(state, drivers, n_ticks=150)
    np.testing.assert_allclose(states.acceleration, 0, atol=1e-11)
    np.testing.assert_allclose(states.speed, speed, atol=1e-10)
    np.testing.assert_allclose(np.diff(states.x, axis=1), gap, rtol=1e-11)
    if speed == 0:
        for values in jax.tree.leaves(states):
            assert np.isfinite(values).all()
        np.testing.assert_array_equal(states.x[-1], state.x)


def test_platoon_stops_behind_an_obstacle_without_contact():
    cars = [car_on(2, 20 + 40 * i, 22.0, desired=24.0, changes_lanes=False) for i in range(N_VEHICLES - 1)]
    cars.append(car_on(2, 600.0, 0.0, crashed=True))
    state, drivers = core_of([cars])
    after = advance(state, drivers, n_ticks=1200)
    assert not after.crashed[:-1].any()
    assert abs(after.speed).max() < 0.2
    gaps = np.diff(after.x[:, 0])
    assert gaps.min() > 9.5
    assert gaps.max() < 12.0


@pytest.mark.parametrize("side", [-1, 1])
def test_lane_change_ends_in_the_middle_of_the_new_lane(side):
    traffic = [[car_on(1, 100.0, v, target=1 + side, changes_lanes=False)] for v in (5.0, 10.0, 25.0, 35.0)]
    states = history(*core_of(traffic), n_ticks=150)
    y = states.y[:, 0]
    assert (side * (y[30] - 4) > 2).all()
    np.testing.assert_allclose(y[-1], 4 + 4 * side, atol=1e-3)
    assert (side * (y - 4 - 4 * side)).max() < 0.15


def free_road_error(ticks_per_second):
    """Errors of place and speed after 6 s on a free road, against the exact solution for delta = 1."""
    model = TrafficModel(
        n_lanes=1, ticks_per_second=ticks_per_second, lane_changes=False, collisions=False, speed_limit=None
    )
    v0, v1, a, time = 12.0, 30.0, 3.0, 6.0
    zero = np.zeros(1)
    state = make_state(zero, zero, zero + v0, model, desired_speed=zero + v1, dtype=np.float64)
    drivers = highway_env_drivers(jnp.ones(1), ticks_per_second=ticks_per_second)
    run = jax.jit(lambda state: rollout(state, drivers, model, n_seconds=int(time))[0])
    after = run(state)
    decay = np.exp(-a / v1 * time)
    speed = v1 + (v0 - v1) * decay
    place = v1 * time + (v0 - v1) * (1 - decay) * v1 / a
    return abs(float(after.x[0]) - place), abs(float(after.speed[0]) - speed)


@pytest.mark.slow
def test_integrator_is_of_first_order():
    """The logarithm of the error falls with that of the tick, slope 1: explicit Euler."""
    rates = np.array([4, 8, 16, 32])
    errors = np.array([free_road_error(int(rate)) for rate in rates])
    assert (errors[0] > 1e-2).all()
    for error in errors.T:
        slope = -np.polyfit(np.log(rates), np.log(error), 1)[0]
        assert 0.97 < slope < 1.05
