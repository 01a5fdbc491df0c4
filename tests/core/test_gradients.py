"""Derivatives of a rollout: against finite differences and forward mode, and finite in every state of the traffic."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from tests.core import scenes, simulation
from tests.core.scenes import car_on

pytestmark = pytest.mark.slow  # a minute of compiling

MODEL = TrafficModel(n_lanes=2)
ROAD = scenes.Road(n_lanes=2)
N_SECONDS, N_VEHICLES = 3, 4

PLATOON, CHANGE, CRASH, STANDSTILL = range(4)
NAMES = ("time_gap", "max_accel", "desired_speed")


def start():
    """Four scenes: a platoon, one with a lane change, one with a crash, one that stands."""
    platoon = [car_on(0, 20 + 24 * i, 20 - i, desired=26.0, timer=0.2, changes_lanes=False) for i in range(4)]
    change = [
        *(car_on(0, 20.0, 22.0, desired=27.0, timer=0.9), car_on(0, 50.0, 14.0, desired=15.0, timer=0.1)),
        *(car_on(1, x, 24.0, desired=27.0, changes_lanes=False) for x in (90.0, 180.0)),
    ]
    crash = [car_on(0, x, v, timer=0.1) for x, v in ((20.0, 30.0), (27.0, 2.0), (60.0, 20.0), (90.0, 20.0))]
    standstill = [car_on(0, 20 + 11 * i, 0.0, desired=25.0, changes_lanes=False) for i in range(4)]
    standstill[-1].crashed = True
    traffic = [platoon, change, crash, standstill]
    picture = scenes.stack([scenes.photograph(cars, ROAD) for cars in traffic])
    return picture


@functools.cache
def programs(dtype):
    """The derivative of each scene's loss with respect to its own parameters, reverse and forward."""
    picture = start()
    state = simulation.state_of(picture, MODEL, dtype)
    drivers = simulation.drivers_of(picture, dtype)

    def losses(parameters):
        changed = eqx.tree_at(
            lambda d: (d.car_following.time_gap, d.car_following.max_accel),
            drivers,
            tuple(jnp.broadcast_to(parameters[name][None], state.x.shape) for name in NAMES[:2]),
        )
        faster = eqx.tree_at(lambda s: s.desired_speed, state, state.desired_speed + parameters["desired_speed"][None])
        after, frames = rollout(faster, changed, MODEL, n_seconds=N_SECONDS)
        # No term is zero by symmetry: places, speeds, lateral places, accelerations, all at several times.
        weights = jnp.arange(1, N_VEHICLES + 1, dtype=dtype)[None, :, None]
        loss = jnp.sum(weights * (frames.x / 100 + frames.speed / 10 + frames.y + frames.acceleration), (0, 1))
        return loss, after

    def total(parameters):
        loss, after = losses(parameters)
        return jnp.sum(loss), (loss, after)

    reverse = jax.jit(jax.value_and_grad(total, has_aux=True), compiler_options=QUICKLY_COMPILED)
    forward = jax.jit(
        lambda p, tangent: jax.jvp(lambda p: losses(p)[0], (p,), (tangent,))[1], compiler_options=QUICKLY_COMPILED
    )
    return reverse, forward


def parameters(dtype, **shifts):
    base = {"time_gap": 1.4, "max_accel": 2.5, "desired_speed": 0.0}
    return {name: jnp.full(4, base[name] + shifts.get(name, 0.0), dtype) for name in NAMES}


@pytest.fixture(scope="module")
def gradient():
    reverse, _ = programs(np.float64)
    (_, (_, after)), gradient = reverse(parameters(np.float64))
    return jax.tree.map(np.asarray, (after, gradient))


def test_scenes_hold_what_they_are_to_show(gradient):
    after, _ = gradient
    assert (after.target_lane[:, CHANGE] != start()["target"][:, CHANGE]).sum() == 1
    assert abs(after.y[0, CHANGE] - 4) < 1
    assert after.crashed[:2, CRASH].all()
    assert not after.crashed[:, [PLATOON, CHANGE]].any()
    assert abs(after.speed[:, STANDSTILL]).max() < 1.5


@pytest.mark.parametrize("name", NAMES)
def test_reverse_mode_is_the_finite_difference(gradient, name):
    reverse, _ = programs(np.float64)
    step = 1e-5
    ends = [reverse(parameters(np.float64, **{name: sign * step}))[0][1] for sign in (-1, 1)]
    for smooth in (PLATOON, CHANGE, STANDSTILL):
        for _, after in ends:  # no decision on the way depends on so small a step
            np.testing.assert_array_equal(after.target_lane[:, smooth], gradient[0].target_lane[:, smooth])
        difference = float(ends[1][0][smooth] - ends[0][0][smooth]) / (2 * step)
        # Far below the desired speed its own effect is real but small.
        assert abs(difference) > (1e-7 if (name, smooth) == ("desired_speed", STANDSTILL) else 1e-3)
        np.testing.assert_allclose(gradient[1][name][smooth], difference, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_reverse_mode_is_forward_mode(gradient, name):
    _, forward = programs(np.float64)
    tangent = {key: jnp.full(4, float(key == name)) for key in NAMES}
    np.testing.assert_allclose(gradient[1][name], forward(parameters(np.float64), tangent), rtol=1e-9, atol=1e-12)


def test_gradients_are_finite_with_crashes_and_at_standstill(gradient):
    for name in NAMES:
        assert np.isfinite(gradient[1][name]).all()
        assert abs(gradient[1][name][CRASH]) > 0


def test_gradients_in_single_precision(gradient):
    reverse, _ = programs(np.float32)
    _, single = reverse(parameters(np.float32))
    for name in NAMES:
        assert single[name].dtype == np.float32
        assert np.isfinite(single[name]).all()
        smooth = [PLATOON, CHANGE]
        np.testing.assert_allclose(np.asarray(single[name])[smooth], gradient[1][name][smooth], rtol=5e-3)
