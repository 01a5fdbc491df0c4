"""Twenty vehicles behind a leader who brakes a little: waves grow along the platoon where the linearisation says so."""

import functools
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.car_following.model import CarFollowing, linearise
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, make_state
from rearl_jax.core.step import step
from tests.core.car_following.oracle import ORACLES, Slopes
from tests.core.simulation import default_drivers

MODEL = TrafficModel(n_lanes=1, speed_limit=None, ticks_per_second=25, lane_changes=False, collisions=False)
"""A clock quick enough that its steps change the growth of a wave by less than a tenth."""

N_FOLLOWERS = 20
SPEED = 15.0
DIP = 0.02
"""Depth of the leader's braking [m/s], so small that the answer is linear even where it grows twentyfold."""

N_WAVES = 2
N_SECONDS = 230
FREQUENCIES = np.linspace(0.15, 2.0, 500)
"""Frequencies among which the most amplified one is searched [rad/s]; below, everything passes unchanged."""

UNSTABLE, STABLE = "unstable", "stable"

CASES = {
    "idm": {UNSTABLE: {"max_accel": 0.6, "time_gap": 1.0}, STABLE: {"max_accel": 2.5, "time_gap": 1.6}},
    "improved_idm": {UNSTABLE: {"max_accel": 0.6, "time_gap": 1.0}, STABLE: {"max_accel": 2.5, "time_gap": 1.6}},
    "highway_env_idm": {
        UNSTABLE: {"max_accel": 1.2, "time_gap": 1.0},
        STABLE: {"comfort_decel": 2.0, "time_gap": 2.0},
    },
    "approach_gain_idm": {UNSTABLE: {"approach_gain": 0.25}, STABLE: {"approach_gain": 0.9, "time_gap": 1.6}},
    "constant_time_headway": {
        UNSTABLE: {"approach_gain": 0.25},
        STABLE: {"gap_gain": 0.2, "approach_gain": 0.9},
    },
    "fvdm": {UNSTABLE: {"approach_gain": 0.1}, STABLE: {"speed_gain": 0.6, "approach_gain": 0.6}},
    # No parameters make Gipps' drivers unstable, none make Krauss' stable.
    "gipps": {STABLE: {}},
    "krauss": {UNSTABLE: {"comfort_decel": 15.0, "time_gap": 1.5}},
}
"""Parameters that differ from the usual values; one program per model, with its cases side by side."""

QUICK = "idm"
"""The model of the default run; the simulator treats all of them alike but highway-env's."""

ALL = [pytest.param(name, marks=() if name == QUICK else pytest.mark.thorough) for name in sorted(CASES)]


class Platoon(NamedTuple):
    """A recorded platoon, the leader first: `[ticks, vehicles, cases]`, and its drivers `[vehicles, cases]`."""

    cases: tuple[str, ...]
    frequency: np.ndarray
    predicted: np.ndarray
    slopes: list[Slopes]
    margin: np.ndarray
    driver: CarFollowing
    gap: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    at_rest: np.ndarray

    @property
    def dip(self):
        """Loss of speed of each vehicle since the start [m/s]."""
        return SPEED - self.speed


def driver_of(name):
    """Drivers of a model, `[vehicles, cases]`."""
    left_open = {"desired_speed": 30.0, "accel_exponent": 4.0}  # highway-env draws them
    usual = {p.name: left_open[p.name] if p.usual is None else p.usual for p in MODELS[name].parameters}
    rows = [[(usual | changes)[key] for changes in CASES[name].values()] for key in usual]
    return CAR_FOLLOWING[name](*(jnp.tile(jnp.asarray(row), (1 + N_FOLLOWERS, 1)) for row in rows))


def lengths_of(name):
    """Lengths of the vehicles [m]; cars and trucks, but for highway-env's drivers, who count on 5 m."""
    if name == DEFAULT:
        return np.full((1 + N_FOLLOWERS, 1), 5.0)
    return np.where(np.arange(1 + N_FOLLOWERS) % 3 == 1, 12.0, 4.5)[:, None]


def braking(frequency):
    """Speed of the leader, `[ticks, cases]` [m/s]: some waves of a raised cosine, in every case from the start."""
    phase = frequency * np.arange(N_SECONDS * MODEL.ticks_per_second)[:, None] / MODEL.ticks_per_second
    return SPEED - np.where(phase < 2 * np.pi * N_WAVES, DIP * (1 - np.cos(phase)) / 2, 0.0)


@functools.partial(jax.jit, static_argnames="model", compiler_options=QUICKLY_COMPILED)
def simulate(state, drivers, leader_speed, model=MODEL):
    """Speeds before each tick and accelerations in it, behind a leader whose speed is prescribed."""

    def advance(before, speed):
        before = replace(before, speed=before.speed.at[0].set(speed))
        after = step(before, drivers, model)
        return after, (before.x, before.speed, after.acceleration)

    return lax.scan(advance, begin_driving(state, drivers, model), leader_speed)


@functools.cache
def platoon(name):
    driver, length = driver_of(name), lengths_of(name)
    n_cases = len(CASES[name])
    speed = jnp.full((1 + N_FOLLOWERS, n_cases), SPEED)
    slopes = jax.jit(linearise)(jax.tree.map(lambda values: values[:1], driver), speed[:1])
    gains = np.asarray(slopes.amplification(jnp.asarray(FREQUENCIES)[:, None]))
    frequency = FREQUENCIES[gains.argmax(axis=0)]
    spacing = np.asarray(driver.equilibrium_gap(speed))[1:] + (length[1:] + length[:-1]) / 2
    x = 2000.0 - np.concatenate([np.zeros((1, n_cases)), np.cumsum(spacing, axis=0)])
    controller = np.full(x.shape, Controller.IDM)
    controller[0] = Controller.META  # its speed is overwritten before every tick
    state = make_state(x, 0 * x, 0 * x + SPEED, MODEL, controller=controller, dtype=np.float64)
    drivers = default_drivers(x.shape, length=length, accel_limit=9.0, changes_lanes=False, collides=False)
    drivers = replace(drivers, car_following=driver)
    _, history = simulate(state, drivers, jnp.asarray(braking(frequency)))
    place, seen, acceleration = (np.asarray(values) for values in history)
    return Platoon(
        cases=tuple(CASES[name]),
        frequency=frequency,
        predicted=gains.max(axis=0),
        slopes=[Slopes(*(float(part[0, case]) for part in slopes)) for case in range(n_cases)],
        margin=np.asarray(slopes.stability_margin())[0],
        driver=driver,
        gap=place[:, :-1] - place[:, 1:] - (length[1:] + length[:-1]) / 2,
        speed=seen,
        acceleration=acceleration,
        at_rest=abs(acceleration[0, 1:]).max(axis=0),
    )


def wave(run):
    """Amplitude of each vehicle's dip at the frequency of its case [m], `[vehicles, cases]`: a Fourier integral.

    The whole answer is recorded, so this is exactly what a linear platoon multiplies by the gain from one to the next.
    """
    time = np.arange(len(run.dip)) / MODEL.ticks_per_second
    turns = np.exp(-1j * time[:, None] * run.frequency)
    return abs(np.einsum("tc,tvc->vc", turns, run.dip)) / MODEL.ticks_per_second


def growth(run):
    """Logarithm of the amplification per vehicle, from the first to the last follower, `[cases]`."""
    amplitude = wave(run)
    return np.log(amplitude[-1] / amplitude[1]) / (N_FOLLOWERS - 1)


def test_every_model_is_looked_at():
    assert set(CASES) == set(ORACLES) <= set(CAR_FOLLOWING)


@pytest.mark.parametrize("name", ALL)
def test_the_leader_brakes_and_the_platoon_answers_within_its_bounds(name):
    run = platoon(name)
    assert run.at_rest.max() < 1e-11  # all of them start in equilibrium
    np.testing.assert_allclose(run.dip[:, 0].max(axis=0), DIP, rtol=1e-3)
    np.testing.assert_allclose(run.dip[0], 0, atol=1e-12)
    assert (run.dip[:, 1].max(axis=0) > DIP / 3).all()
    assert (run.dip.max(axis=0) > DIP / 10).all()  # the dip is visible down to the last
    assert abs(run.dip).max() < 1.0
    assert abs(run.acceleration[:, 1:]).max() < 0.5  # far from what a vehicle can do
    assert run.gap.min() > 5.0
    # It has been and gone when the record ends.
    assert (abs(run.dip[-1]) < 2e-3 * run.dip.max(axis=0)).all()
    # Nobody drives as on a free road: where a model takes the lesser of two, it is the leader's.
    free = jax.vmap(run.driver.free_acceleration)(jnp.asarray(run.speed[::50]))
    assert (np.asarray(free)[:, 1:] - run.acceleration[::50, 1:]).min() > 0.02


@pytest.mark.parametrize("name", ALL)
def test_waves_grow_where_the_platoon_is_unstable(name):
    run = platoon(name)
    deepest = run.dip.max(axis=0)
    for case, margin, first, last, grown in zip(
        run.cases, run.margin, deepest[1], deepest[-1], growth(run), strict=True
    ):
        if case == UNSTABLE:
            assert margin < 0
            assert last > 1.1 * first
            assert grown > 0.02
        else:
            assert margin > 0
            assert last <= first * (1 + 1e-6)
            assert grown < 0


@pytest.mark.parametrize("name", ALL)
def test_waves_grow_as_fast_as_the_linearisation_predicts(name):
    """Within 15 % of the logarithm in continuous time; within 0.5 % once the clock's steps are counted in."""
    run = platoon(name)
    measured = growth(run)
    np.testing.assert_allclose(measured, np.log(run.predicted), rtol=0.15)
    dt = 1 / MODEL.ticks_per_second
    in_steps = [one.gain_in_steps(omega, dt) for one, omega in zip(run.slopes, run.frequency, strict=True)]
    np.testing.assert_allclose(measured, np.log(in_steps), rtol=0.005)


@pytest.mark.parametrize("name", ALL)
def test_every_single_vehicle_amplifies_alike(name):
    """Cars and trucks: what counts is the gap between bumpers, not the length."""
    amplitude = wave(platoon(name))
    each = np.log(amplitude[2:] / amplitude[1:-1])
    np.testing.assert_allclose(each, np.broadcast_to(growth(platoon(name)), each.shape), rtol=0.05, atol=2e-4)
