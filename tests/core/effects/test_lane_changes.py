"""Effects on the choice of the lane: the decision turns where the equation says, and rooms are made as it says."""

import math
from dataclasses import fields, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import make_state
from rearl_jax.core.step import step
from tests.core.effects.traffic import IS_TRUCK, LENGTH, N_CARS, S0, A, B, T
from tests.core.simulation import default_drivers

MODEL = TrafficModel(n_lanes=3, speed_limit=None, ticks_per_second=10, collisions=False)
V0 = 30.0
NAMES = ("keep_right", "no_passing_on_the_right", "politeness", "moving_over", "truck_aversion", "cooperation")
NAMES += ("early_response",)
THRESHOLD = 0.2
NEAR = 1e-6
"""Distance from the predicted turn of a decision at which it is tested."""


def ratio(gap, v, dv):
    return ((S0 + max(0.0, v * T + v * dv / (2 * math.sqrt(A * B)))) / max(gap, 0.5)) ** 2


def acceleration(v, gap=None, leader=0.0):
    return A * (1 - (v / V0) ** 4 - (0.0 if gap is None else ratio(gap, v, v - leader)))


def shared(given):
    """Effects of one scenario per value: the given parameters of some effects, all others off."""
    effects = []
    for one in NAMES:
        numbers = {item.name: item.off for item in EFFECTS[one].parameters} | given.get(one, {})
        row = {key: np.broadcast_to(np.asarray(value, float), 2)[None] for key, value in numbers.items()}
        effects.append(EFFECTS[one](**{key: jnp.asarray(value) for key, value in row.items()}))
    return tuple(effects)


@partial(jax.jit, compiler_options=QUICKLY_COMPILED)
def begin(state, drivers):
    return begin_driving(state, drivers, MODEL)


@partial(jax.jit, compiler_options=QUICKLY_COMPILED)
def tick(state, drivers):
    return step(state, drivers, MODEL)


def simulate(cars, name, columns, **others):
    """States after one and two ticks in two scenarios; cars are (lane, x, speed, target), the first one decides."""
    padded = [*cars, *((0, 20_000.0 + 500 * k, 25.0, 0) for k in range(N_CARS - len(cars)))]
    lane, x, speed, target = (np.array(column, float)[:, None] * np.ones(2) for column in zip(*padded, strict=True))
    timer = np.zeros((N_CARS, 2))
    timer[0] = 5.0
    state = make_state(x, lane * 4.0, speed, MODEL, target_lane=target, timer=timer, dtype=np.float64)
    drivers = default_drivers((N_CARS, 2), length=LENGTH[:, None], gain_threshold=THRESHOLD, accel_limit=9.0)
    body = replace(drivers.body, is_truck=jnp.asarray(np.broadcast_to(IS_TRUCK[:, None], (N_CARS, 2))))
    following = IDM(*(jnp.full((1, 1), value) for value in (V0, T, S0, A, B)))
    drivers = replace(drivers, body=body, car_following=following, effects=shared({name: columns} | others))
    first = tick(begin(state, drivers), drivers)
    return jax.tree.map(np.asarray, (first, tick(first, drivers)))


def gap(cars, rear, front):
    return cars[front][1] - cars[rear][1] - (LENGTH[rear] + LENGTH[front]) / 2


def turns_at(cars, name, parameter, critical, side, **others):
    """The decision differs between just below and just above a value."""
    columns = {parameter: np.array([critical - NEAR, critical + NEAR])} | others
    low, high = EFFECTS[name].parameters[0].low, EFFECTS[name].parameters[0].high
    assert low < critical < high  # a value a model may have
    first, _ = simulate(cars, name, columns)
    lane = cars[0][0]
    chosen = first.target_lane[0]
    assert set(chosen) == {lane, lane + side}, chosen
    without, _ = simulate(cars, name, {})
    assert (without.target_lane[0] == without.target_lane[0, 0]).all()
    return chosen - lane


def test_keep_right_turns_the_decision_at_its_bias():
    cars = [(1, 100.0, 25.0, 1), (1, 180.0, 24.0, 1), (2, 185.0, 26.0, 2)]
    gain = acceleration(25.0, gap(cars, 0, 2), 26.0) - acceleration(25.0, gap(cars, 0, 1), 24.0)
    # The left lane is free, but at twice the bias less.
    cars.append((0, 103.0, 25.0, 0))
    chosen = turns_at(cars, "keep_right", "bias", THRESHOLD - gain, +1)
    assert chosen.tolist() == [0, 1]


def test_no_passing_on_the_right_takes_its_share_of_the_gain():
    cars = [(0, 100.0, 25.0, 0), (0, 140.0, 20.0, 0)]
    gain = acceleration(25.0) - acceleration(25.0, gap(cars, 0, 1), 20.0)
    assert gain > THRESHOLD
    chosen = turns_at(cars, "no_passing_on_the_right", "weight", 1 - THRESHOLD / gain, +1)
    assert chosen.tolist() == [1, 0]


def test_politeness_weighs_the_followers():
    # To the left, where a faster follower would have to brake a little; nobody passes through on the right.
    cars = [(1, 100.0, 25.0, 1), (1, 150.0, 22.0, 1), (0, 55.0, 26.0, 0), (2, 105.0, 25.0, 2)]
    own = acceleration(25.0) - acceleration(25.0, gap(cars, 0, 1), 22.0)
    follower = acceleration(26.0, gap(cars, 2, 0), 25.0)
    assert follower > -2.0  # safe
    critical = (THRESHOLD - own) / (follower - acceleration(26.0))
    chosen = turns_at(cars, "politeness", "weight", critical, -1)
    assert chosen.tolist() == [-1, 0]


def test_a_close_follower_makes_moving_over_worth_its_gain():
    cars = [(1, 100.0, 25.0, 1), (1, 160.0, 25.0, 1), (1, 78.0, 26.0, 1), (0, 105.0, 25.0, 0), (2, 152.0, 25.0, 2)]
    gain = acceleration(25.0, gap(cars, 0, 4), 25.0) - acceleration(25.0, gap(cars, 0, 1), 25.0)
    behind = gap(cars, 2, 0) / (26.0 + 2.0)
    pressure = 1 / (1 + math.exp(-(1.1 - behind) / 0.25))
    chosen = turns_at(cars, "moving_over", "gain", (THRESHOLD - gain) / pressure, +1, pressing_time_gap=1.1)
    assert chosen.tolist() == [0, 1]


def test_trucks_are_avoided_at_their_gain_and_reach():
    # The third vehicle is the truck: the leader on the own lane.
    cars = [(1, 100.0, 25.0, 1), (0, 104.0, 25.0, 0), (1, 175.0, 25.0, 1), (2, 172.0, 25.0, 2)]
    assert IS_TRUCK[2]
    assert not IS_TRUCK[3]
    gain = acceleration(25.0, gap(cars, 0, 3), 25.0) - acceleration(25.0, gap(cars, 0, 2), 25.0)
    critical = (THRESHOLD - gain) / math.exp(-gap(cars, 0, 2) / 90.0)
    chosen = turns_at(cars, "truck_aversion", "gain", critical, +1, reach=90.0)
    assert chosen.tolist() == [0, 1]


def test_cooperation_opens_a_gap_for_who_is_coming_over():
    cars = [(1, 100.0, 25.0, 1), (0, 130.0, 22.0, 1), (1, 300.0, 25.0, 1)]
    first, _ = simulate(cars, "cooperation", {"weight": np.array([0.0, 0.7]), "limit": 1.5})
    own = ratio(gap(cars, 0, 2), 25.0, 0.0)
    wanted = ratio(gap(cars, 0, 1), 25.0, 3.0)
    bearable = 1 - (25.0 / V0) ** 4 + 1.5 / A
    assert wanted > bearable  # the limit counts
    expected = A * (1 - (25.0 / V0) ** 4 - (own + 0.7 * (bearable - own)))
    np.testing.assert_allclose(first.acceleration[0], [acceleration(25.0, gap(cars, 0, 2), 25.0), expected], rtol=1e-10)


def test_the_new_follower_minds_who_is_coming_over_but_not_who_only_wishes_to():
    cars = [(1, 100.0, 25.0, 1), (0, 130.0, 22.0, 1), (1, 300.0, 25.0, 1)]
    first, _ = simulate(cars, "early_response", {"of_follower": np.array([0.0, 0.7]), "limit": 1.5})
    own, bearable = ratio(gap(cars, 0, 2), 25.0, 0.0), 1 - (25.0 / V0) ** 4 + 1.5 / A
    assert ratio(gap(cars, 0, 1), 25.0, 3.0) > bearable  # the limit counts
    expected = A * (1 - (25.0 / V0) ** 4 - (own + 0.7 * (bearable - own)))
    np.testing.assert_allclose(first.acceleration[0], [acceleration(25.0, gap(cars, 0, 2), 25.0), expected], rtol=1e-10)
    cars = [(1, 100.0, 25.0, 1), (1, 130.0, 18.0, 1), (0, 88.0, 28.0, 0), (2, 103.0, 20.0, 2)]
    first, second = simulate(cars, "early_response", {"of_follower": np.array([0.0, 1.0])})
    assert (first.memory.desired_side[0] == -1).all()
    np.testing.assert_array_equal(second.acceleration[2, 0], second.acceleration[2, 1])


def test_who_wishes_to_change_minds_the_leader_there_before_there_is_room():
    # The first wants to keep right, where the fifth is nearer than its leader; but the third is too close behind there.
    cars = [(1, 100.0, 25.0, 1), (1, 180.0, 25.0, 1), (2, 88.0, 28.0, 2), (0, 103.0, 20.0, 0), (2, 160.0, 24.0, 2)]
    changes = {"of_changer": np.array([0.0, 1.0]), "limit": 6.0}
    first, second = simulate(cars, "early_response", changes, keep_right={"bias": 0.9})
    assert (first.memory.desired_side[0] == 1).all()
    np.testing.assert_array_equal(first.acceleration[0, 0], first.acceleration[0, 1])  # nobody wished before
    assert (second.target_lane[0] == 1).all()
    x, v = first.x[:, 1], first.speed[:, 1]
    here, there = (ratio(x[k] - x[0] - (LENGTH[0] + LENGTH[k]) / 2, v[0], v[0] - v[k]) for k in (1, 4))
    assert here < there < 1 - (v[0] / V0) ** 4 + 6.0 / A  # it counts, within the limit
    expected = [A * (1 - (v[0] / V0) ** 4 - behind) for behind in (here, there)]
    np.testing.assert_allclose(second.acceleration[0], expected, rtol=1e-9)


def test_cooperation_opens_a_gap_for_who_finds_none():
    # The first wants to go left behind a slow leader, but the third is too close behind there.
    cars = [(1, 100.0, 25.0, 1), (1, 130.0, 18.0, 1), (0, 88.0, 28.0, 0), (2, 103.0, 20.0, 2)]
    first, second = simulate(cars, "cooperation", {"weight": np.array([0.0, 1.0]), "limit": 2.0})
    assert (first.target_lane[0] == 1).all()
    assert (first.memory.desired_side[0] == -1).all()
    assert (first.memory.desired_side[1:] == 0).all()
    np.testing.assert_array_equal(first.acceleration[2, 0], first.acceleration[2, 1])  # nobody knew yet
    v = first.speed[2, 1]
    assert second.acceleration[2, 1] == pytest.approx(-2.0, abs=1e-9)
    assert second.acceleration[2, 0] == pytest.approx(acceleration(v), abs=1e-9)


def test_recordings_do_not_tell_who_wants_to_change():
    still = Stimulus(*(jnp.zeros(1) for _ in fields(Stimulus)))
    driver = IDM(*(jnp.ones(1),) * 5)
    cooperation = EFFECTS["cooperation"](jnp.asarray(0.5), jnp.asarray(2.0))
    with pytest.raises(ValueError, match="known in a simulation, not in a recording"):
        cooperation.leaders(jnp.zeros(1), still, None, driver)
