"""Derivative of the mean speed with respect to the time gap, through collisions, against central differences.

Reverse mode has to pass a program with loops of unknown length, in which contacts are settled: whatever carries a
derivative into one of them makes `jax.grad` fail.
"""

import functools
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rearl_jax
from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.gap_driving import begin_driving
from tests.core.simulation import default_drivers

MODEL = rearl_jax.TrafficModel(n_lanes=2, speed_limit=None, ticks_per_second=10, lane_changes=False)
"""Two lanes and collisions. Lane changes, whose decisions have no slope, lengthen the program."""

CHANGING = replace(MODEL, lane_changes=True)

N_SECONDS = 2

# Lane, position [m], speed [m/s]. Someone runs into a slow vehicle, and nobody follows the two: what a push does to
# others by its size is left out of the derivative.
CRASH = ((0, 20.0, 28.0), (0, 32.0, 3.0), (0, 75.0, 18.0), (1, 60.0, 19.0), (1, 90.0, 17.0))
SMOOTH = ((0, 20.0, 20.0), (0, 50.0, 18.0), (0, 85.0, 18.0), (1, 60.0, 19.0), (1, 90.0, 17.0))
STANDSTILL = ((0, 20.0, 0.0), (0, 31.0, 0.0), (0, 42.0, 0.0), (1, 60.0, 0.0), (1, 71.0, 0.0))
SCENES = (CRASH, SMOOTH, STANDSTILL)
WITH_CRASH = np.array([True, False, False])

TIME_GAP = 1.4
SHIFTS = {np.float32: 2e-2, np.float64: 1e-5}
"""Half the distance [s] of the central difference."""

BOTH_WAYS = (DEFAULT, "idm")
"""One model for each of the two ways to drive."""

ALL = [pytest.param(name, marks=() if name == DEFAULT else pytest.mark.thorough) for name in sorted(CAR_FOLLOWING)]
"""The default run has one of them: a program takes ten seconds to compile."""


class Answer(NamedTuple):
    """Mean speed of each scenario [m/s], its derivative with respect to the time gap [m/s^2], and who at the end has
    crashed and is on which lane.
    """

    mean_speed: np.ndarray
    slope: np.ndarray
    crashed: np.ndarray
    target_lane: np.ndarray


@functools.cache
def program(name, dtype, model):
    """From one time gap per scenario to the answer, compiled."""
    lane, x, speed = (np.array(column).T for column in np.moveaxis(np.array(SCENES), -1, 0))
    wanted, y = np.full_like(x, 26.0), lane * model.lane_width
    state = rearl_jax.make_state(x, y, speed, model, desired_speed=wanted, dtype=dtype)
    left_open = {"desired_speed": 26.0, "accel_exponent": 4.0}  # highway-env draws them
    usual = [left_open[p.name] if p.usual is None else p.usual for p in MODELS[name].parameters]
    driver = CAR_FOLLOWING[name](*(jnp.full((1, 1), value, dtype) for value in usual))
    drivers = default_drivers(state.x.shape, dtype, accel_limit=9.0)

    def mean_speeds(time_gap):
        own = replace(driver, time_gap=time_gap[None]).full(state.x.shape)
        people = replace(drivers, car_following=own)
        last, frames = rearl_jax.rollout(begin_driving(state, people, model), people, model, n_seconds=N_SECONDS)
        mean = jnp.mean(frames.speed, axis=(0, 1))
        return jnp.sum(mean), (mean, last.crashed, last.target_lane)

    return jax.jit(jax.value_and_grad(mean_speeds, has_aux=True), compiler_options=QUICKLY_COMPILED)


def answer(name, dtype, model, time_gap):
    (_, (mean, *rest)), slope = program(name, dtype, model)(jnp.full(len(SCENES), time_gap, dtype))
    return Answer(*(np.asarray(values) for values in (mean, slope, *rest)))


def compare(name, dtype, *, rtol, model=MODEL):
    """The answer; AssertionError unless its derivative is the central difference, with and without a crash."""
    here = answer(name, dtype, model, TIME_GAP)
    np.testing.assert_array_equal(here.crashed[:2].all(axis=0), WITH_CRASH)
    np.testing.assert_array_equal(here.crashed.sum(axis=0), 2 * WITH_CRASH)
    shift = SHIFTS[dtype]
    below, above = (answer(name, dtype, model, TIME_GAP + sign * shift) for sign in (-1, 1))
    for end in (below, above):  # nothing that jumps lies between
        np.testing.assert_array_equal(end.crashed, here.crashed)
        np.testing.assert_array_equal(end.target_lane, here.target_lane)
    difference = (above.mean_speed - below.mean_speed) / (2 * shift)
    assert (difference < -0.01).all()  # who keeps a longer time gap drives more slowly
    np.testing.assert_allclose(here.slope, difference, rtol=rtol)
    return here


@pytest.mark.parametrize("name", ALL)
def test_reverse_mode_is_the_finite_difference(name):
    """In single precision, whose programs are compiled in a fifth of the time."""
    compare(name, np.float32, rtol=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("name", BOTH_WAYS)
def test_reverse_mode_passes_lane_changes(name):
    here = compare(name, np.float32, rtol=2e-3, model=CHANGING)
    assert (here.target_lane != np.array(SCENES)[:, :, 0].T).any()


@pytest.mark.slow  # compiling takes a minute
@pytest.mark.parametrize("name", ["idm"])
def test_reverse_mode_is_the_finite_difference_in_double_precision(name):
    compare(name, np.float64, rtol=1e-6)
