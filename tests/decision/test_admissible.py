"""Admissible actions, vehicle by vehicle."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.decision import AdmissibleConfig, LaneGate
from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.state import make_state
from rearl_jax.decision.admissible import admissible_actions
from rearl_jax.decision.execution import accept

LEFT, KEEP, RIGHT, FASTER, SLOWER = range(5)
ACTIONS = jax.jit(admissible_actions, static_argnums=(2, 3), compiler_options=QUICKLY_COMPILED)


def admissible(x, lanes, speed, model, *, crashed=False, target_lane=None, **options):
    def column(values):
        return np.asarray(values, float)[:, None]

    state = make_state(
        column(x),
        4 * column(lanes),
        column(speed),
        model,
        crashed=np.broadcast_to(np.asarray(crashed), len(x))[:, None],
        target_lane=None if target_lane is None else column(target_lane).astype(np.int32),
    )
    drivers = highway_env_drivers(jnp.full((len(x), 1), 4.0, jnp.float32))
    return np.asarray(ACTIONS(state, drivers, model, AdmissibleConfig(**options)))[:, :, 0]


def test_lanes_that_exist_and_levels_that_are_left(model):
    found = admissible([0.0, 200.0, 400.0], [0, 3, 1], [5.0, 32.0, 20.0], model)
    assert found[:, 0].tolist() == [False, True, True, True, False]
    assert found[:, 1].tolist() == [True, True, False, False, True]
    assert found[:, 2].all()


def test_nothing_for_the_crashed_and_no_second_change_at_once(model):
    found = admissible([0.0, 200.0], [1, 1], [20.0, 20.0], model, crashed=[True, False], target_lane=[1, 2])
    assert not found[:, 0].any()
    assert found[:, 1].tolist() == [False, True, False, True, True]


@pytest.mark.parametrize(
    ("distance", "speed", "is_free"),
    [
        (15.1, (20.0, 20.0), True),  # gap 10.1 m above 0.5 s * 20 m/s
        (14.9, (20.0, 20.0), False),
        (10.1, (6.0, 6.0), True),  # the least gap of 5 m
        (9.9, (6.0, 6.0), False),
        (14.9, (16.0, 30.0), True),  # ahead: the own speed counts
        (-14.9, (16.0, 30.0), False),  # behind: that of the vehicle behind
        (-20.1, (16.0, 30.0), True),
        (0.0, (20.0, 20.0), False),
    ],
)
def test_gaps_on_the_target_lane(model, distance, speed, is_free):
    x = [500.0, 500.0 + distance]
    assert admissible(x, [1, 2], speed, model)[RIGHT, 0] == is_free
    assert admissible(x, [2, 1], speed, model)[LEFT, 0] == is_free
    assert admissible(x, [1, 3], speed, model)[RIGHT, 0]
    assert admissible(x, [1, 2], speed, model, lane=LaneGate.exists)[RIGHT, 0]


def test_only_the_next_vehicle_behind_counts(model):
    # The second one behind is too fast for its own distance, but somebody is between.
    found = admissible([500.0, 483.0, 470.0], [1, 2, 2], [20.0, 20.0, 60.0], model)
    assert found[RIGHT, 0]


def test_mobil_safe_is_the_deceleration_of_follower_and_own(model):
    gate = LaneGate.mobil_safe
    assert admissible([500.0, 440.0], [1, 2], [20.0, 20.0], model, lane=gate)[RIGHT, 0]
    assert not admissible([500.0, 480.0], [1, 2], [15.0, 30.0], model, lane=gate)[RIGHT, 0]
    assert not admissible([500.0, 520.0], [1, 2], [30.0, 15.0], model, lane=gate)[RIGHT, 0]
    assert not admissible([500.0, 480.0], [1, 0], [15.0, 30.0], model, lane=gate)[LEFT, 0]


def test_longitudinal_gate(model):
    # IDM: s* = 10 + 1.5 v at equal speeds, interaction 3 (s* / s)^2 = 0.5, 1.5, 4 at s = 2.45, 1.41, 0.87 s*.
    wanted = 10 + 1.5 * 20
    for share, allowed in ((2.5, {FASTER, KEEP, SLOWER}), (1.5, {KEEP, SLOWER}), (0.9, {SLOWER}), (0.8, set())):
        found = admissible([0.0, share * wanted], [1, 1], [20.0, 20.0], model, longitudinal=True)
        assert set(np.flatnonzero(found[:, 0])) - {LEFT, RIGHT} == allowed
    assert admissible([0.0, 0.8 * wanted], [1, 1], [20.0, 20.0], model)[[KEEP, FASTER, SLOWER], 0].all()


def test_accept_keeps_admissible_answers_of_those_asked():
    actions = jnp.asarray([[0, 3], [1, 7], [2, -1], [4, 0]], jnp.int32)
    admissible = jnp.ones((5, 4, 2), bool).at[0].set(False)
    asked = jnp.asarray([[True, True], [False, True], [True, True], [True, True]])
    orders = accept(actions, asked, admissible)
    assert orders.action.tolist() == [[-1, 3], [-1, -1], [2, -1], [4, -1]]
    assert orders.n_inadmissible.tolist() == [1, 1]
    assert orders.n_invalid.tolist() == [0, 2]


@pytest.mark.parametrize("name", [name for name in MODELS if name != DEFAULT])
def test_whatever_model_drives_empty_lanes_are_safe_and_close_followers_are_not(model, name):
    usual = [jnp.full((1, 1), one.usual, jnp.float32) for one in MODELS[name].parameters]
    drivers = replace(highway_env_drivers(ticks_per_second=15), car_following=CAR_FOLLOWING[name](*usual))
    # Alone on the road; with a fast vehicle right behind on the lane to the left; with one that stands far ahead.
    x = np.array([[100.0, 100.0, 100.0], [5000.0, 92.0, 900.0]])
    lane, speed = np.array([[1, 1, 1], [0, 0, 0]]), np.array([[25.0, 25.0, 0.0], [25.0, 40.0, 0.0]])
    state = make_state(x, lane * 4.0, speed, model, desired_speed=np.full(x.shape, 30.0))
    options = AdmissibleConfig(lane=LaneGate.mobil_safe, longitudinal=True)
    left = np.asarray(ACTIONS(state, drivers, model, options))[0, 0]
    assert left.tolist() == [True, False, True]
