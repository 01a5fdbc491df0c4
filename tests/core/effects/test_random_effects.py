"""Random effects of drivers: size, memory, place in simulation, and independence of other vehicles and scenarios."""

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
from tests.core.effects.traffic import DT, N_CARS, N_TICKS, NAMES, ON, Seen, T, idm


@pytest.fixture(scope="module")
def states():
    return traffic.all_on()


def remembered(states, name):
    """Memory of an effect in the scenario in which it is on, after every tick."""
    held = states.memory.effects[NAMES.index(name)]
    scenario = NAMES.index(name)
    return jax.tree.map(lambda leaf: leaf[1:, ..., scenario] if leaf.ndim > 1 else leaf[1:], held)


def moments(states, scenario):
    return [[Seen(states, now, me, scenario) for me in range(N_CARS)] for now in range(N_TICKS)]


@pytest.fixture(scope="module")
def process():
    """4,000 processes of correlation time 2 s over 60 ticks of 0.1 s, `[60, 4000]`."""
    seed, like = jnp.int32(7), jnp.zeros((4000, 1))

    def step(before, _):
        after = fluctuate(before, seed, 0, jnp.asarray(2.0), DT)
        return after, after.value

    start = begin_fluctuation(seed, 0, like)
    return np.asarray(jax.lax.scan(step, start, length=60)[1])[..., 0]


def test_fluctuations_have_variance_one_from_the_start_and_their_correlation_time(process):
    assert abs(process.mean()) < 0.03
    np.testing.assert_allclose(process.var(axis=1), 1.0, atol=0.12)  # 5 standard errors of 4,000 draws
    for lag in (1, 10, 30):
        correlation = (process[:-lag] * process[lag:]).mean()
        assert correlation == pytest.approx(math.exp(-lag * DT / 2.0), abs=0.03)


def test_vehicles_scenarios_and_uses_have_their_own_numbers():
    like = jnp.zeros((5, 3))
    count = jnp.int32(4)
    first = np.asarray(standard_normal(jnp.arange(3, dtype=jnp.int32), 0, count, like))
    assert len(np.unique(first)) == first.size
    assert not np.isin(np.asarray(standard_normal(jnp.arange(3, dtype=jnp.int32), 1, count, like)), first).any()
    assert not np.isin(np.asarray(standard_normal(jnp.arange(3, dtype=jnp.int32), 0, count + 1, like)), first).any()
    # More vehicles, other scenarios around, no scenario axis: the same numbers.
    more = np.asarray(standard_normal(jnp.arange(1, 3, dtype=jnp.int32), 0, count, jnp.zeros((9, 2))))
    np.testing.assert_array_equal(more[:5], first[:, 1:])
    np.testing.assert_array_equal(standard_normal(jnp.int32(2), 0, count, jnp.zeros(5)), first[:, 2])


def test_acceleration_noise_adds_its_process(states):
    found, counts, scenario = traffic.executed(states, "acceleration_noise")
    noise = ON["acceleration_noise"]["sd"] * remembered(states, "acceleration_noise").value
    plain = np.array([[idm(seen) for seen in row] for row in moments(states, scenario)])
    assert np.abs(noise).max() > 0.3
    np.testing.assert_allclose(found[counts], np.clip(plain + noise, -9.0, 6.0)[counts], rtol=1e-9, atol=1e-9)


def test_perception_noise_is_relative_to_the_gap(states):
    found, counts, scenario = traffic.executed(states, "perception_noise")
    gap_error, rate_error = (process.value for process in remembered(states, "perception_noise"))
    assert np.abs(np.corrcoef(gap_error.ravel(), rate_error.ravel())[0, 1]) < 0.8  # two processes
    wanted = np.zeros_like(found)
    for now, row in enumerate(moments(states, scenario)):
        for me, seen in enumerate(row):
            dv = seen.dv + ON["perception_noise"]["rate_error"] * seen.gap * rate_error[now, me]
            gap = seen.gap * math.exp(ON["perception_noise"]["gap_error"] * gap_error[now, me])
            wanted[now, me] = np.clip(idm(seen, gap=gap, dv=dv), -9.0, 6.0)
    np.testing.assert_allclose(found[counts], wanted[counts], rtol=1e-9, atol=1e-9)


def test_the_time_gap_varies_by_a_factor(states):
    found, counts, scenario = traffic.executed(states, "time_gap_variation")
    factor = np.exp(ON["time_gap_variation"]["sd"] * remembered(states, "time_gap_variation").value)
    assert factor.min() < 0.8 < 1.25 < factor.max()
    rows = moments(states, scenario)
    wanted = [[idm(seen, time_gap=T * factor[now, me]) for me, seen in enumerate(row)] for now, row in enumerate(rows)]
    np.testing.assert_allclose(found[counts], np.clip(wanted, -9.0, 6.0)[counts], rtol=1e-9, atol=1e-9)


def test_the_variation_begins_at_the_time_gap_that_is_kept():
    """4,000 drivers of T = 1.2 s, every second one of whom follows, at 2 s."""
    many = jnp.ones((4000, 1))
    values = {"speed": 10.0 * many, "gap": 22.0 * many, "has_leader": jnp.arange(4000.0)[:, None] % 2}
    seen = Stimulus(**{one.name: values.get(one.name, 0.0 * many) for one in fields(Stimulus)})
    usual = {"time_gap": 1.2 * many, "jam_gap": 2.0 * many}
    driver = IDM(**{one.name: usual.get(one.name, many) for one in fields(IDM)})
    effect = TimeGapVariation(*(jnp.float64(value) for value in (0.4, 15.0, 0.75)), seed=jnp.int32(5))
    begun = 0.4 * np.asarray(effect.begin(seen, driver, DT).value)[:, 0]
    alone, following = begun[::2], begun[1::2]
    assert following.mean() == pytest.approx(0.75 * math.log(2.0 / 1.2), abs=0.03)
    assert abs(alone.mean()) < 0.03
    for drawn in (alone, following):
        assert drawn.std() == pytest.approx(0.4 * math.sqrt(0.25), rel=0.06)


def test_who_does_not_follow_has_chosen_no_time_gap():
    gap = np.array([12.0, 62.0, 2.0, 0.0])
    found = np.asarray(time_gap_departure(gap, np.full(4, 10.0), np.ones(4), np.full(4, 2.0)))
    np.testing.assert_allclose(found, [0.0, 0.0, -1.2, -1.2], atol=1e-12)


def test_between_action_points_the_acceleration_is_held(states):
    found, counts, scenario = traffic.executed(states, "action_points")
    situation = dict(zip(SITUATION, np.moveaxis(remembered(states, "action_points").situation, 1, 0), strict=True))
    rows = moments(states, scenario)
    looked = np.zeros((N_TICKS, N_CARS), bool)
    held = np.zeros((N_TICKS, N_CARS))
    p = ON["action_points"]
    for me in range(N_CARS):
        for now in range(N_TICKS):
            seen = rows[now][me]
            looked[now, me] = np.isclose(situation["speed"][now, me], seen.v, rtol=0, atol=1e-12)
            held[now, me] = idm(seen) if looked[now, me] or now == 0 else held[now - 1, me]
            if not looked[now, me]:  # nothing has changed much
                assert abs(idm(seen) - held[now, me]) <= p["threshold"] + 1e-9
    np.testing.assert_allclose(found[counts], np.clip(held, -9.0, 6.0)[counts], rtol=1e-9, atol=1e-9)
    assert 0.2 < looked.mean() < 0.8
    calm = looked[20:]
    assert calm.mean() == pytest.approx(1 - math.exp(-DT / p["mean_time"]), abs=0.15)


@pytest.mark.thorough
def test_another_seed_is_other_noise_and_twice_the_deviation_twice_the_noise():
    shape = (N_CARS, len(NAMES) + 1)
    sd = np.zeros(shape[1])
    sd[1], sd[2], sd[3] = 0.2, 0.4, 0.2
    drivers = traffic.drivers_with({"acceleration_noise": {"sd": sd}}, shape)
    seed = np.zeros((1, shape[1]), np.int32)
    seed[0, 3] = 1
    effects = list(drivers.effects)
    place = NAMES.index("acceleration_noise")
    effects[place] = replace(effects[place], seed=jnp.asarray(seed))
    states = traffic.history(traffic.start(shape[1]), replace(drivers, effects=tuple(effects)))
    first = np.asarray(states.acceleration[1])
    noise = first[:, 1:4] - first[:, :1]
    np.testing.assert_allclose(noise[:, 1], 2 * noise[:, 0], atol=1e-12)
    assert np.abs(noise[:, 2] - noise[:, 0]).min() > 1e-3
