"""An effect that is off is nobody there, bit for bit; one that is on is not. Derivatives are finite."""

import functools
from dataclasses import fields

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.driver import MODELS
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.effects.side_lane import SideLane
from rearl_jax.core.following import begin_effects, follow
from tests.core.effects import traffic
from tests.core.effects.traffic import ON

N = 64
TICK = 0.1
FLAGS = ("is_leftmost", "is_rightmost", "is_truck", "has_leader", "leader_is_truck", "has_second", "has_third")
FLAGS += ("has_follower", "has_entrant", "has_changer", "has_new_leader", "has_left")
RANGES = {
    "time": (0.0, 10.0),
    "position": (0.0, 500.0),
    "lane": (0.0, 2.0),
    "lateral_offset": (-0.5, 0.5),
    "length": (4.0, 15.0),
    "leader_length": (4.0, 15.0),
    "n_beside": (0.0, 3.0),
    "time_since_change": (0.0, 20.0),
    "gap_lost": (0.0, 20.0),
    "time_gap_at_change": (0.3, 3.0),
    "leader_acceleration": (-2.0, 2.0),
}
ON_LANES = {
    "keep_right": {"bias": 0.3},
    "no_passing_on_the_right": {"weight": 0.6},
    "politeness": {"weight": 0.4},
    "cooperation": {"weight": 0.8, "limit": 2.0},
    "early_response": {"of_changer": 0.6, "of_follower": 0.7, "limit": 2.0},
    "moving_over": {"gain": 0.8, "pressing_time_gap": 1.5},
    "truck_aversion": {"gain": 0.7, "reach": 80.0},
}
# A delay within the three moments that are looked at.
ALL_ON = ON | ON_LANES | {"reaction_delay": {"delay": 0.15, "own_delay": 0.12}}


def drawn(kind, seed, **fixed):
    """A record of random, possible values."""
    rng = np.random.default_rng(seed)
    values = {}
    for item in fields(kind):
        low, high = RANGES.get(item.name, (5.0, 60.0) if "gap" in item.name else (8.0, 30.0))
        row = rng.integers(0, 2, N).astype(float) if item.name in FLAGS else rng.uniform(low, high, N)
        values[item.name] = jnp.asarray(row)
    return kind(**(values | fixed))


def driver():
    rng = np.random.default_rng(3)
    usual = (30.0, 1.3, 2.5, 1.4, 2.0)
    return IDM(*(jnp.asarray(value * rng.uniform(0.8, 1.2, N)) for value in usual))


def effect(name, numbers):
    values = {key: jnp.asarray(value) for key, value in (traffic.is_off(name) | numbers).items()}
    if name in traffic.CURVES:
        values["values"] = jnp.broadcast_to(values["values"], 3)
        return EFFECTS[name](values["values"][:, None], jnp.asarray(traffic.KNOTS), "speed")
    if name in traffic.N_VALUES:
        values["values"] = jnp.broadcast_to(values["values"], traffic.N_VALUES[name])[:, None]
    return EFFECTS[name](**values)


def behaviour(effects):
    """Accelerations of three moments, and what changes to both sides gain in the last."""
    own, found = driver(), []
    memory, acceleration = begin_effects(effects, drawn(SimulatedStimulus, 0), own, TICK), jnp.zeros(N)
    for moment in range(3):
        seen = drawn(SimulatedStimulus, moment + 1)
        acceleration, memory = follow(seen, own, effects, memory, acceleration, TICK)
        found.append(acceleration)
    for direction in (-1, +1):
        side = drawn(SideLane, 10 + direction, direction=direction, gain_of_others=jnp.linspace(-1.0, 1.0, N))
        gain = jnp.linspace(-0.5, 0.9, N)
        for one, held in zip(effects, memory, strict=True):
            gain = one.incentive(gain, side, seen, held)
        found.append(gain)
    return jnp.stack(found)


@functools.cache
def without():
    return np.asarray(behaviour(()))


def test_every_effect_is_tested():
    assert set(ALL_ON) == set(EFFECTS)
    for name, kind in EFFECTS.items():
        assert kind.name == name
        assert {item.name for item in kind.parameters} <= {item.name for item in fields(kind)}
        assert kind.kind in ("driver", "road", "generic", "random", "lane_change")
        for item in kind.parameters:
            assert item.low <= item.off <= item.high


@pytest.mark.parametrize("name", EFFECTS)
def test_off_is_nobody_there_bit_for_bit(name):
    on = np.asarray(behaviour((effect(name, ALL_ON[name]),)))
    assert (np.abs(on - without()) > 1e-3).sum() > 5
    strengths = {item.name for item in EFFECTS[name].parameters if item.is_strength}
    shapes = {key: value for key, value in ALL_ON[name].items() if key not in strengths}
    np.testing.assert_array_equal(np.asarray(behaviour((effect(name, shapes),))), without())


@pytest.mark.parametrize("name", EFFECTS)
def test_derivatives_are_finite_and_there(name):
    numbers = {key: jnp.asarray(value) for key, value in ALL_ON[name].items()}
    slopes = jax.grad(lambda numbers: jnp.sum(behaviour((effect(name, numbers),)) ** 2))(numbers)
    for key, slope in slopes.items():
        assert np.isfinite(slope).all(), key
    if name != "action_points":  # when somebody looks is no smooth matter
        strengths = [item.name for item in EFFECTS[name].parameters if item.is_strength]
        assert any(np.abs(slopes[key]).max() > 1e-6 for key in strengths)


SETPOINTS = [
    name
    for name, kind in EFFECTS.items()
    if any(getattr(kind, hook) is not getattr(Effect, hook) for hook in ("desired_speed", "time_gap", "standstill_gap"))
]


@pytest.mark.parametrize("model", sorted(CAR_FOLLOWING))
def test_no_setpoint_is_taken_below_what_a_model_can_drive_by(model):
    assert {"relaxation", "speed_limit"} <= set(SETPOINTS)
    # Nothing is a whole number here, for a power of those is never wrong.
    drivers = CAR_FOLLOWING[model](*(jnp.full(N, 1.1 * (item.usual or 30.0)) for item in MODELS[model].parameters))
    strayed = drawn(
        SimulatedStimulus,
        5,
        speed=jnp.linspace(0.0, 40.0, N),
        time_since_change=jnp.zeros(N),
        time_gap_at_change=jnp.zeros(N),
        gap=jnp.linspace(-5.0, 30.0, N),
    )
    for name in SETPOINTS:
        for bound in ("low", "high"):
            effects = (effect(name, {item.name: getattr(item, bound) for item in EFFECTS[name].parameters}),)
            memory = begin_effects(effects, strayed, drivers, TICK)
            assert np.isfinite(follow(strayed, drivers, effects, memory, jnp.zeros(N), TICK)[0]).all(), (name, bound)


def test_effects_pass_on_what_they_make_of_the_situation():
    # A delayed error is not the error of now, and a situation kept in mind is not delayed again.
    delay = effect("reaction_delay", {"delay": 0.15, "own_delay": 0.15})
    noise = effect("perception_noise", ON["perception_noise"])
    both, alone = np.asarray(behaviour((noise, delay))), np.asarray(behaviour((delay,)))
    assert np.abs(both - alone).max() > 1e-3
    points = effect("action_points", {"mean_time": 0.0})
    np.testing.assert_array_equal(np.asarray(behaviour((delay, points))), alone)
