"""Random effects of drivers: their size, correlation in time, use in the simulated acceleration, and independence of
other vehicles and scenarios.
"""

import math
from dataclasses import fields, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects.action_points import SITUATION
from rearl_jax.core.effects.noise import TimeGapVariation, begin_fluctuation, fluctuate, time_gap_departure
from rearl_jax.core.effects.randomness import standard_normal
from rearl_jax.core.effects.stimulus import Stimulus
from tests.core.effects import traffic
from tests.core.effects.traffic import DT, N_CARS, N_TICKS, NAMES, idm
from tests.core.effects.traffic import ON as PARAMETERS
from tests.core.effects.traffic import Seen as DriverInput
from tests.core.effects.traffic import T as TIME_GAP

N_PROCESSES = 4000
CORRELATION_TIME = 2.0
"""Correlation time of the processes [s]."""

ACCELERATION_LIMITS = (-9.0, 6.0)
"""Limits of the simulated acceleration [m/s^2]."""


@pytest.fixture(scope="module")
def states():
    """States of traffic in which each effect acts in one scenario."""
    return traffic.all_on()


def memory_after_ticks(states, name):
    """Memory of an effect after every tick, in the scenario in which the effect acts."""
    scenario = NAMES.index(name)
    memory = states.memory.effects[scenario]
    return jax.tree.map(lambda leaf: leaf[1:, ..., scenario] if leaf.ndim > 1 else leaf[1:], memory)


def driver_inputs(states, scenario):
    """Input of every driver before every tick: one list per tick, one element per vehicle."""
    return [[DriverInput(states, tick, car, scenario) for car in range(N_CARS)] for tick in range(N_TICKS)]


def assert_executed(states, name, expected):
    """Raise AssertionError if the simulated accelerations of an effect's scenario differ from the expected ones.

    Vehicles that change lanes are left out, because they also react to the other lane.
    """
    accelerations, is_in_lane, _ = traffic.executed(states, name)
    expected = np.clip(expected, *ACCELERATION_LIMITS)
    np.testing.assert_allclose(accelerations[is_in_lane], expected[is_in_lane], rtol=1e-9, atol=1e-9)


@pytest.fixture(scope="module")
def processes():
    """Values of N_PROCESSES processes in 60 ticks, `[60, N_PROCESSES]`."""
    seed, like = jnp.int32(7), jnp.zeros((N_PROCESSES, 1))

    def step(before, _):
        after = fluctuate(before, seed, 0, jnp.asarray(CORRELATION_TIME), DT)
        return after, after.value

    start = begin_fluctuation(seed, 0, like)
    return np.asarray(jax.lax.scan(step, start, length=60)[1])[..., 0]


def test_fluctuations_have_variance_one_from_the_start_and_their_correlation_time(processes):
    assert abs(processes.mean()) < 0.03
    five_standard_errors = 5 * math.sqrt(2 / N_PROCESSES)
    np.testing.assert_allclose(processes.var(axis=1), 1.0, atol=five_standard_errors)
    for lag in (1, 10, 30):
        correlation = (processes[:-lag] * processes[lag:]).mean()
        assert correlation == pytest.approx(math.exp(-lag * DT / CORRELATION_TIME), abs=0.03)


def test_random_numbers_differ_by_vehicle_scenario_stream_and_tick_and_by_nothing_else():
    seeds, tick = jnp.arange(3, dtype=jnp.int32), jnp.int32(4)
    like = jnp.zeros((5, 3))
    numbers = np.asarray(standard_normal(seeds, 0, tick, like))
    assert len(np.unique(numbers)) == numbers.size
    for stream, count in ((1, tick), (0, tick + 1)):
        assert not np.isin(np.asarray(standard_normal(seeds, stream, count, like)), numbers).any()
    more_vehicles = np.asarray(standard_normal(seeds[1:], 0, tick, jnp.zeros((9, 2))))
    np.testing.assert_array_equal(more_vehicles[:5], numbers[:, 1:])
    without_scenario_axis = standard_normal(seeds[2], 0, tick, jnp.zeros(5))
    np.testing.assert_array_equal(without_scenario_axis, numbers[:, 2])


def test_acceleration_noise_is_added_to_the_acceleration_of_the_model(states):
    name = "acceleration_noise"
    noise = PARAMETERS[name]["sd"] * memory_after_ticks(states, name).value
    assert np.abs(noise).max() > 0.3
    inputs = driver_inputs(states, NAMES.index(name))
    assert_executed(states, name, np.array([[idm(seen) for seen in row] for row in inputs]) + noise)


def test_perception_noise_is_proportional_to_the_gap(states):
    name = "perception_noise"
    parameters = PARAMETERS[name]
    gap_error, rate_error = (process.value for process in memory_after_ticks(states, name))
    assert np.abs(np.corrcoef(gap_error.ravel(), rate_error.ravel())[0, 1]) < 0.8  # two processes
    expected = np.zeros((N_TICKS, N_CARS))
    for tick, row in enumerate(driver_inputs(states, NAMES.index(name))):
        for car, seen in enumerate(row):
            dv = seen.dv + parameters["rate_error"] * seen.gap * rate_error[tick, car]
            gap = seen.gap * math.exp(parameters["gap_error"] * gap_error[tick, car])
            expected[tick, car] = idm(seen, gap=gap, dv=dv)
    assert_executed(states, name, expected)


def test_time_gap_variation_multiplies_the_time_gap_by_a_factor(states):
    name = "time_gap_variation"
    factor = np.exp(PARAMETERS[name]["sd"] * memory_after_ticks(states, name).value)
    assert factor.min() < 0.8 < 1.25 < factor.max()
    expected = np.zeros((N_TICKS, N_CARS))
    for tick, row in enumerate(driver_inputs(states, NAMES.index(name))):
        for car, seen in enumerate(row):
            expected[tick, car] = idm(seen, time_gap=TIME_GAP * factor[tick, car])
    assert_executed(states, name, expected)


def test_the_variation_of_followers_begins_near_their_present_time_gap():
    n_drivers, speed, jam_gap = 4000, 10.0, 2.0  # [m/s], [m]
    preferred, present = 1.2, 2.0  # time gaps [s]
    sd, correlation_time, start_share = 0.4, 15.0, 0.75
    ones = jnp.ones((n_drivers, 1))
    is_follower = jnp.arange(float(n_drivers))[:, None] % 2
    values = {"speed": speed * ones, "gap": (jam_gap + present * speed) * ones, "has_leader": is_follower}
    seen = Stimulus(**{field.name: values.get(field.name, 0.0 * ones) for field in fields(Stimulus)})
    parameters = {"time_gap": preferred * ones, "jam_gap": jam_gap * ones}
    driver = IDM(**{field.name: parameters.get(field.name, ones) for field in fields(IDM)})
    effect = TimeGapVariation(*(jnp.float64(value) for value in (sd, correlation_time, start_share)), seed=jnp.int32(5))
    log_factor = sd * np.asarray(effect.begin(seen, driver, DT).value)[:, 0]
    free, following = log_factor[::2], log_factor[1::2]
    assert following.mean() == pytest.approx(start_share * math.log(present / preferred), abs=0.03)
    assert abs(free.mean()) < 0.03
    for group in (free, following):
        assert group.std() == pytest.approx(sd * math.sqrt(1 - start_share), rel=0.06)


@pytest.mark.parametrize("start_share", [0.0, 0.5, 1.0])
def test_the_variation_at_the_start_has_a_derivative_at_every_share(start_share):
    ones = jnp.ones((3, 1))
    values = {"speed": 10.0 * ones, "gap": 20.0 * ones, "has_leader": ones}
    seen = Stimulus(**{field.name: values.get(field.name, 0.0 * ones) for field in fields(Stimulus)})
    driver = IDM(**{field.name: ones for field in fields(IDM)})

    def begun(share):
        effect = TimeGapVariation(jnp.float64(0.4), jnp.float64(15.0), share, seed=jnp.int32(5))
        return effect.begin(seen, driver, DT).value

    value, slope = jax.jvp(begun, (jnp.float64(start_share),), (jnp.float64(1.0),))
    assert np.isfinite(slope).all()
    if start_share == 1.0:
        assert np.unique(value).size == 1  # nothing is drawn


def test_a_departure_from_the_time_gap_is_limited_and_zero_for_a_distant_leader():
    gap = np.array([12.0, 62.0, 2.0, 0.0])  # [m]
    speed, preferred, jam_gap = np.full(4, 10.0), np.ones(4), np.full(4, 2.0)  # [m/s], [s], [m]
    found = np.asarray(time_gap_departure(gap, speed, preferred, jam_gap))
    np.testing.assert_allclose(found, [0.0, 0.0, -1.2, -1.2], atol=1e-12)


def test_between_action_points_drivers_keep_their_acceleration(states):
    name = "action_points"
    parameters = PARAMETERS[name]
    last_observed = memory_after_ticks(states, name).situation
    observed_speed = last_observed[:, SITUATION.index("speed")]
    inputs = driver_inputs(states, NAMES.index(name))
    is_action_point = np.zeros((N_TICKS, N_CARS), bool)
    expected = np.zeros((N_TICKS, N_CARS))
    for car in range(N_CARS):
        for tick in range(N_TICKS):
            seen = inputs[tick][car]
            is_action_point[tick, car] = np.isclose(observed_speed[tick, car], seen.v, rtol=0, atol=1e-12)
            is_new = is_action_point[tick, car] or tick == 0
            expected[tick, car] = idm(seen) if is_new else expected[tick - 1, car]
            if not is_action_point[tick, car]:
                assert abs(idm(seen) - expected[tick, car]) <= parameters["threshold"] + 1e-9
    assert_executed(states, name, expected)
    assert 0.2 < is_action_point.mean() < 0.8
    # After 2 s the accelerations change little, so that nearly all action points are random ones.
    random_points = is_action_point[20:]
    assert random_points.mean() == pytest.approx(1 - math.exp(-DT / parameters["mean_time"]), abs=0.15)


@pytest.mark.thorough
def test_noise_depends_on_the_seed_and_is_proportional_to_its_standard_deviation():
    """Scenario 0 has no noise; 1 and 2 have the same seed and different standard deviations; 3 has another seed."""
    n_scenarios = len(NAMES) + 1
    shape = (N_CARS, n_scenarios)
    sd = np.zeros(n_scenarios)
    sd[1:4] = 0.2, 0.4, 0.2
    drivers = traffic.drivers_with({"acceleration_noise": {"sd": sd}}, shape)
    seed = np.zeros((1, n_scenarios), np.int32)
    seed[0, 3] = 1
    effects = list(drivers.effects)
    number = NAMES.index("acceleration_noise")
    effects[number] = replace(effects[number], seed=jnp.asarray(seed))
    states = traffic.history(traffic.start(n_scenarios), replace(drivers, effects=tuple(effects)))
    acceleration = np.asarray(states.acceleration[1])
    usual, doubled, other_seed = (acceleration[:, 1:4] - acceleration[:, :1]).T
    np.testing.assert_allclose(doubled, 2 * usual, atol=1e-12)
    assert np.abs(other_seed - usual).min() > 1e-3
