"""Drivers who follow on the gap between bumpers: symmetries of their traffic, and what decisions do to them."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import neighbours
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following.fvdm import FVDM
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.conflicts import abort_conflicts
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.noise import AccelerationNoise
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import derive_state
from rearl_jax.core.rollout import rollout
from rearl_jax.core.state import Controller, make_state
from rearl_jax.core.step import step
from tests.core.simulation import default_drivers

MODEL = TrafficModel(n_lanes=3, ticks_per_second=10, speed_limit=32.0)
N_VEHICLES, N_SCENARIOS, N_SECONDS = 7, 6, 10
PRESENT = slice(None, N_VEHICLES)


def traffic(n_slots, dtype=np.float64, controller=Controller.IDM, rng_seed=0):
    """Random traffic in the first slots, nobody in the others; drivers with an effect of each kind."""
    rng = np.random.default_rng(rng_seed)
    shape = (N_VEHICLES, N_SCENARIOS)

    def padded(values, filling):
        return np.concatenate([values, np.full((n_slots - N_VEHICLES, N_SCENARIOS), filling)])

    x = np.cumsum(rng.uniform(8.0, 18.0, shape), axis=0)
    y = rng.integers(0, 3, shape) * 4.0
    speed = rng.uniform(14.0, 26.0, shape)
    kinds = padded(np.full(shape, int(controller)), int(Controller.ABSENT)).astype(np.int32)
    state = make_state(padded(x, 0.0), padded(y, 0.0), padded(speed, 0.0), MODEL, controller=kinds, dtype=dtype)
    own = [padded(rng.uniform(low, high, shape), low) for low, high in RANGES]
    following = IDM(*(jnp.asarray(values, dtype) for values in own))
    drivers = default_drivers((n_slots, N_SCENARIOS), dtype, accel_limit=9.0, length=padded(np.full(shape, 4.5), 4.5))
    seed = jnp.arange(N_SCENARIOS, dtype=jnp.int32)[None]
    effects = (
        EFFECTS["reaction_delay"](jnp.asarray(0.3, dtype), jnp.asarray(0.3, dtype)),
        EFFECTS["several_leaders"](jnp.asarray(0.3, dtype), jnp.asarray(0.5, dtype)),
        EFFECTS["lane_friction"](jnp.asarray(0.5, dtype), jnp.asarray(5.0, dtype)),
        AccelerationNoise(jnp.asarray(0.2, dtype), jnp.asarray(1.5, dtype), seed),
        EFFECTS["politeness"](jnp.asarray(0.3, dtype)),
        EFFECTS["cooperation"](jnp.asarray(0.8, dtype), jnp.asarray(2.0, dtype)),
    )
    return state, replace(drivers, car_following=following, effects=effects)


RANGES = ((20.0, 31.0), (0.8, 1.8), (2.0, 3.0), (1.0, 2.0), (1.5, 2.5))


def simulate(state, drivers, model=MODEL):
    run = jax.jit(lambda state, drivers: rollout(begin_driving(state, drivers, model), drivers, model, n_seconds=10))
    return jax.tree.map(np.asarray, run(state, drivers)[1])


@pytest.fixture(scope="module")
def small():
    return simulate(*traffic(N_VEHICLES))


@pytest.mark.thorough  # a program of its own, for the tests that follow
def test_traffic_has_what_the_symmetries_are_about(small):
    assert (np.diff(small.lane, axis=0) != 0).sum() > 5
    assert np.isfinite(small.x).all()
    assert small.speed.min() >= -1e-9  # nobody drives backwards
    assert small.crashed.mean() < 0.2


@pytest.mark.thorough
def test_absent_vehicles_and_the_sorted_road_change_nothing(small):
    large = neighbours.LARGEST_SMALL_TRAFFIC + 1
    found = simulate(*traffic(large))
    for name in ("x", "y", "speed", "acceleration"):
        np.testing.assert_allclose(getattr(found, name)[:, PRESENT], getattr(small, name), rtol=1e-8, atol=1e-8)
    np.testing.assert_array_equal(found.lane[:, PRESENT], small.lane)


@pytest.mark.slow  # a program of its own
def test_single_precision_stays_near(small):
    found = simulate(*traffic(N_VEHICLES, np.float32))
    assert found.x.dtype == np.float32
    assert np.isfinite(found.x).all()
    # Noise differs with the type; positions do not part in the first second.
    assert np.abs(found.x[0] - small.x[0]).max() < 1.0


def test_vehicles_under_decisions_keep_their_distance_by_the_same_rules():
    model = replace(MODEL, meta_follows=True, lane_changes=False, collisions=False)  # compiles faster
    state, drivers = traffic(N_VEHICLES, controller=Controller.META)
    drivers = replace(drivers, effects=())
    run = jax.jit(
        lambda state: step(begin_driving(state, drivers, model), drivers, model), compiler_options=QUICKLY_COMPILED
    )
    after = run(state)
    unhindered = (state.desired_speed - state.speed) / 0.6
    assert (np.asarray(after.acceleration) <= np.asarray(unhindered) + 1e-12).all()
    assert (np.asarray(after.acceleration) < np.asarray(unhindered) - 0.1).any()
    np.testing.assert_array_equal(after.desired_speed, state.desired_speed)  # decided, not the driver's


def test_a_driver_without_memory_is_refused():
    state, drivers = traffic(N_VEHICLES)
    with pytest.raises(ValueError, match="begin_driving"):
        step(state, drivers, MODEL)


@pytest.mark.parametrize("size", ["small", "large"])
def test_a_conflict_is_judged_by_the_present_desired_speeds(size):
    """The desired spacing of FVDM grows with v / v0. Vehicles 0 and 1 change to the middle lane, 60 m apart."""
    n_slots = {"small": 2, "large": neighbours.LARGEST_SMALL_TRAFFIC + 1}[size]

    def column(first, second, others):
        return np.array([[first], [second], *[[others]] * (n_slots - 2)])

    kinds = column(Controller.IDM, Controller.IDM, Controller.ABSENT).astype(np.int32)
    x, y, speed = column(100.0, 160.0, 0.0), column(0.0, 8.0, 0.0), column(24.0, 24.0, 0.0)
    lanes = column(1, 1, 0)

    of_all = (jnp.asarray([[value]]) for value in (35.0, 1.2, 2.0, 0.5, 0.5))
    drivers = replace(default_drivers((1, 1), np.float64), car_following=FVDM(*of_all))

    @partial(jax.jit, static_argnums=1, compiler_options=QUICKLY_COMPILED)
    def target_lanes(state, model):
        return abort_conflicts(state.target_lane, state, derive_state(state, model), drivers, model)

    def gives_way(desired_speed, model):
        given = {"target_lane": lanes, "controller": kinds, "dtype": np.float64}
        state = make_state(x, y, speed, model, desired_speed=column(desired_speed, desired_speed, 0.0), **given)
        return int(target_lanes(state, model)[0, 0]) == 0

    free = TrafficModel(n_lanes=3, speed_limit=None)
    assert gives_way(25.0, free)
    assert not gives_way(35.0, free)
    assert gives_way(35.0, replace(free, speed_limit=25.0))


def test_who_changes_to_a_lane_where_hard_braking_is_due_does_not_drive_backwards():
    """With few time steps per second, and drivers who also change lanes for the worse."""
    model = TrafficModel(n_lanes=2, speed_limit=None, ticks_per_second=5, collisions=False)
    drivers = default_drivers((1, 1), np.float64, accel_limit=9.0, gain_threshold=-10.0)
    drivers = replace(drivers, car_following=IDM(*(jnp.asarray([[one]]) for one in (30.0, 1.2, 2.0, 1.5, 2.0))))
    x, y, speed = np.array([[100.0], [106.5]]), np.array([[4.0], [0.0]]), np.array([[1.2], [0.0]])
    state = make_state(x, y, speed, model, timer=np.array([[1.5], [0.0]]), dtype=np.float64)
    run = jax.jit(
        lambda state: step(begin_driving(state, drivers, model), drivers, model), compiler_options=QUICKLY_COMPILED
    )
    after = run(state)
    assert int(after.target_lane[0, 0]) == 0
    assert float(after.acceleration[0, 0]) < -5.0
    assert float(after.speed[0, 0]) >= -1e-9
