"""Closed forms and monotony of the car-following model, and the order of the integrator."""

import dataclasses

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
from tests.core.simulation import N_VEHICLES, advance, core_of, default_drivers, history

UNLIMITED = 1e9


def pairs(gap, speed, dv, dtype=np.float64, **driver):
    """Acceleration of a follower `gap` behind a leader, one scenario per entry of the arrays."""
    gap, speed, dv = (np.asarray(a, float) for a in np.broadcast_arrays(gap, speed, dv))
    traffic = [
        [car_on(1, 5000.0, v, desired=30.0), car_on(1, 5000.0 + g, v - d, desired=30.0)]
        for g, v, d in zip(gap, speed, dv, strict=True)
    ]
    for cars in traffic:
        cars[1].kind = scenes.META  # its own acceleration does not matter
    state, _ = core_of(traffic, dtype=dtype)
    drivers = default_drivers(state.x.shape, dtype, accel_limit=UNLIMITED, collides=False, **driver)
    return advance(state, drivers).acceleration[0]


def closed_form(gap, v, dv, *, v0=30.0, a=3.0, b=5.0, s0=10.0, T=1.5, delta=4.0):
    wanted = s0 + v * T + v * dv / (2 * np.sqrt(a * b))
    return a * (1 - (v / v0) ** delta - (wanted / gap) ** 2)


@pytest.mark.parametrize(("dtype", "rtol"), [(np.float64, 1e-12), (np.float32, 2e-6)])
def test_acceleration_is_that_of_the_published_formula(dtype, rtol):
    rng = np.random.default_rng(0)
    gap, v, dv = rng.uniform(8, 120, 250), rng.uniform(0, 35, 250), rng.uniform(-5, 10, 250)
    gap, v, dv = (np.round(values * 256) / 256 for values in (gap, v, dv))  # exact in both types
    value = pairs(gap, v, dv, dtype)
    np.testing.assert_allclose(value, closed_form(gap, v, dv), rtol=rtol, atol=10 * rtol)


def test_acceleration_falls_with_speed_and_approach_rate_and_rises_with_gap():
    rng = np.random.default_rng(1)
    n = 120
    gap, v, dv = rng.uniform(8, 120, n), rng.uniform(1, 33, n), rng.uniform(-4, 10, n)
    wanted = 10 + 1.5 * v + v * dv / (2 * np.sqrt(15))
    assert (wanted > 0).all()  # below zero the squared term turns round, as in highway-env
    base = pairs(gap, v, dv)
    for change in (0.1, 1.0):
        assert (pairs(gap, v + change, dv) < base).all()
        assert (pairs(gap, v, dv + change) < base).all()
        assert (pairs(gap + change, v, dv) > base).all()


def test_wanted_gap_below_zero_brakes():
    """A leader that drives away fast enough makes its follower brake: the square is not cut off."""
    value = pairs([30.0, 30.0], [30.0, 30.0], [-14.2, -30.0])  # wanted gaps near 0 m and of -61 m
    np.testing.assert_allclose(value, [0.0, -12.48], atol=0.1)


@pytest.mark.parametrize("limit", [30.0, None])
def test_free_road(limit):
    """a [1 - (v / v0)^delta], v0 under the speed limit; above v0 it brakes without bound."""
    model = TrafficModel(speed_limit=limit, lane_changes=False, collisions=False)
    v = np.array([[0.0, 5.0, 20.0, 29.0, 33.0, 40.0, -3.0]])
    desired = np.array([[30.0, 20.0, 20.0, 35.0, 35.0, 15.0, 20.0]])
    state = make_state(100 + 0 * v, 0 * v, v, model, desired_speed=desired, dtype=np.float64)
    drivers = default_drivers(v.shape, accel_limit=UNLIMITED, exponent=3.7)
    v0 = np.minimum(desired, np.inf if limit is None else limit)
    after, _ = rollout(state, drivers, dataclasses.replace(model, ticks_per_second=1), n_seconds=1)
    np.testing.assert_allclose(after.acceleration, 3 * (1 - (np.maximum(v, 0) / v0) ** 3.7), rtol=1e-12)


def test_executed_acceleration_is_bounded():
    value = pairs([8.0, 2000.0], [30.0, 0.0], [10.0, 0.0])
    assert value[0] < -100
    cars = [car_on(1, 5000.0, 30.0, desired=30.0), car_on(1, 5008.0, 20.0)]
    after = advance(*core_of([cars]))
    assert after.acceleration[0, 0] == -6


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


def test_steering_settles_in_the_middle_of_the_target_lane():
    """For small angles the cascade is linear: y' = v h + (L / 2) r, h' = r = 5 (-y / (0.6 v) - h)."""
    speeds, offsets = (a.ravel() for a in np.meshgrid([5.0, 15.125, 28.625], [-0.05, 0.02, 0.05]))
    traffic = [
        [scenes.Car(100.0, 8 + d, v, lane=2, target=2, desired=v, kind=scenes.META)]
        for v, d in zip(speeds, offsets, strict=True)
    ]
    states = history(*core_of(traffic), n_ticks=150)
    for number, (v, d) in enumerate(zip(speeds, offsets, strict=True)):
        y, h = d, 0.0
        for now in range(150):
            rate = 5 * (-y / (0.6 * v) - h)
            y, h = y + (v * h + 2.5 * rate) / 15, h + rate / 15
            np.testing.assert_allclose(states.y[now, 0, number] - 8, y, atol=2e-3 * abs(d))
    assert abs(states.y[-1, 0] - 8).max() < 1e-4
    assert abs(states.heading[-1, 0]).max() < 1e-5


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
