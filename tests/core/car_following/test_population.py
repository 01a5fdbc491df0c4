"""Drivers from the keys `driver` and `mobil`: their distribution, their classes, what is left as highway-env has it."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.driver import record_of
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.models.population import population_of_keys
from rearl_jax.models.traffic import populate

ROAD = TrafficModel()
N_VEHICLES, N_SCENARIOS = 10, 600
N_DRIVERS = N_VEHICLES * N_SCENARIOS
F64 = np.dtype("float64")

MEAN, SD, FURTHEST = 1.2, 0.3, 2.5

MOBIL = MobilConfig(politeness=0.3, gain_threshold=0.15, safe_decel=3.5, delay=2.0)
CLASSES = {
    "truck": {"share": 0.1, "time_gap": 1.8, "time_gap_sd": 0.0, "desired_speed": 24.0, "length": 12.0},
    "hasty": {"share": 0.2, "time_gap": 0.8, "max_accel": 2.5, "length": 4.0},
}


def numbers_of(model="highway_env_idm", mobil=None, dtype=F64, **keys):
    """The population of some keys."""
    driver = record_of(model)(**keys)
    driver.check()
    return population_of_keys(driver, mobil or MobilConfig(), dtype, ROAD.ticks_per_second)


def idm_of(**keys):
    """The same of IDM's drivers; with rules of lane changing, so that most tests share one program."""
    return numbers_of("idm", MOBIL, **keys)


@functools.partial(jax.jit, static_argnames="dtype", compiler_options=QUICKLY_COMPILED)
def _spawned(keys, dtype):
    return spawn(keys, ROAD, n_vehicles=N_VEHICLES, dtype=dtype)


@functools.cache
def spawned(dtype=F64, n_scenarios=N_SCENARIOS):
    keys = jax.vmap(jax.random.key)(jnp.arange(n_scenarios))
    return keys, *_spawned(keys, dtype)


@functools.partial(jax.jit, compiler_options=QUICKLY_COMPILED)
def _populated(state, drivers, keys, numbers):
    return populate(state, drivers, keys, numbers, ROAD)


def drawn(numbers, dtype=F64):
    """State and drivers of a population."""
    keys, state, drivers = spawned(dtype)
    return _populated(state, drivers, keys, numbers)


def quantiles(values, mean, sd):
    """Standard normal quantiles of log-normal values of a mean and a standard deviation."""
    variance = math.log1p((sd / mean) ** 2)
    return (np.log(np.asarray(values)) - math.log(mean) + variance / 2) / math.sqrt(variance)


def cut_moments(mean, sd):
    """Mean and standard deviation of a log-normal whose quantiles beyond the furthest are moved there."""
    variance = math.log1p((sd / mean) ** 2)
    steps = np.linspace(-8, 8, 200_001)
    weight = np.exp(-(steps**2) / 2)
    values = mean * np.exp(-variance / 2 + math.sqrt(variance) * np.clip(steps, -FURTHEST, FURTHEST))
    middle = np.average(values, weights=weight)
    return middle, math.sqrt(np.average((values - middle) ** 2, weights=weight))


def test_a_key_is_the_mean_and_its_sd_the_standard_deviation():
    _, people = drawn(idm_of(time_gap=MEAN, time_gap_sd=SD))
    time_gap = np.asarray(people.car_following.time_gap)
    middle, spread = cut_moments(MEAN, SD)
    assert middle == pytest.approx(MEAN, rel=0.005)
    assert 0.9 * SD < spread < SD  # a few per cent less
    # Four standard errors of 6000 independent drivers; that of a spread is larger for a skew distribution.
    assert time_gap.mean() == pytest.approx(middle, abs=4 * SD / math.sqrt(N_DRIVERS))
    assert time_gap.std() == pytest.approx(spread, rel=4 / math.sqrt(N_DRIVERS))
    z = quantiles(time_gap, MEAN, SD)
    assert abs(z).max() == pytest.approx(FURTHEST, abs=1e-9)
    assert (abs(z) > FURTHEST - 1e-9).mean() == pytest.approx(0.0124, abs=0.006)
    # Drivers are independent of each other, within a scenario and from one to the next.
    assert abs(np.corrcoef(time_gap[:-1].ravel(), time_gap[1:].ravel())[0, 1]) < 0.06
    assert abs(np.corrcoef(time_gap[:, :-1].ravel(), time_gap[:, 1:].ravel())[0, 1]) < 0.06
    # All other parameters have their usual values, the same for all.
    for name, value in (("desired_speed", 32.0), ("jam_gap", 2.5), ("max_accel", 1.4), ("comfort_decel", 2.0)):
        np.testing.assert_allclose(getattr(people.car_following, name), value, rtol=1e-12)


def test_parameters_differ_independently_of_each_other():
    _, people = drawn(idm_of(time_gap=MEAN, time_gap_sd=SD, max_accel=1.0, max_accel_sd=0.4))
    rows = [quantiles(people.car_following.time_gap, MEAN, SD), quantiles(people.car_following.max_accel, 1.0, 0.4)]
    assert abs(np.corrcoef([row.ravel() for row in rows])[0, 1]) < 0.06
    assert people.car_following.max_accel.mean() == pytest.approx(cut_moments(1.0, 0.4)[0], rel=0.02)


def test_the_same_scenario_has_the_same_quantiles_whatever_the_values():
    """Common random numbers: what two settings differ by is the settings, not the draw."""
    before, people = drawn(idm_of(time_gap=MEAN, time_gap_sd=SD))
    after, others = drawn(idm_of(time_gap=2.0, time_gap_sd=0.1, jam_gap=3.0))
    ours, theirs = people.car_following, others.car_following
    np.testing.assert_allclose(
        quantiles(theirs.time_gap, 2.0, 0.1), quantiles(ours.time_gap, MEAN, SD), rtol=1e-9, atol=1e-9
    )
    for name in ("x", "y", "speed"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    # Who is in no class of his own is who he was without classes.
    _, mixed = drawn(idm_of(time_gap=MEAN, time_gap_sd=SD, classes=CLASSES))
    rest = np.asarray(mixed.body.length) == 5.0
    np.testing.assert_allclose(np.asarray(mixed.car_following.time_gap)[rest], np.asarray(ours.time_gap)[rest])


def test_classes_have_their_shares_parameters_and_lengths():
    state, people = drawn(idm_of(time_gap=MEAN, time_gap_sd=SD, classes=CLASSES))
    length, is_truck = np.asarray(people.body.length), np.asarray(people.body.is_truck)
    kinds = {"truck": length == 12.0, "hasty": length == 4.0, "rest": length == 5.0}
    assert sum(kind.sum() for kind in kinds.values()) == N_DRIVERS
    for name, share in (("truck", 0.1), ("hasty", 0.2), ("rest", 0.7)):
        error = math.sqrt(share * (1 - share) / N_DRIVERS)
        assert kinds[name].mean() == pytest.approx(share, abs=4 * error)
    np.testing.assert_array_equal(is_truck, kinds["truck"])
    wanted = {
        # The spread of the time gap is that of all others where a class says nothing of it.
        "truck": {"time_gap": (1.8, 0.0), "desired_speed": (24.0, 0.0), "max_accel": (1.4, 0.0)},
        "hasty": {"time_gap": (0.8, SD), "desired_speed": (32.0, 0.0), "max_accel": (2.5, 0.0)},
        "rest": {"time_gap": (MEAN, SD), "desired_speed": (32.0, 0.0), "max_accel": (1.4, 0.0)},
    }
    for kind, parameters in wanted.items():
        for name, (mean, sd) in parameters.items():
            values = np.asarray(getattr(people.car_following, name))[kinds[kind]]
            if sd == 0:
                np.testing.assert_allclose(values, mean, rtol=1e-12)
            else:
                middle, spread = cut_moments(mean, sd)
                assert values.mean() == pytest.approx(middle, abs=4 * sd / math.sqrt(len(values)))
                assert values.std() == pytest.approx(spread, rel=5 / math.sqrt(len(values)))
    np.testing.assert_array_equal(state.desired_speed, people.car_following.desired_speed)
    assert (np.asarray(people.body.accel_limit) == 9.0).all()  # what a vehicle can do, not highway-env's bound
    # Vehicles of other lengths have been given room: nobody starts inside another.
    x, y = np.asarray(state.x), np.asarray(state.y)
    for here in range(N_SCENARIOS):
        order = np.lexsort((x[:, here], y[:, here]))
        ahead, behind = order[1:], order[:-1]
        gap = x[ahead, here] - x[behind, here] - (length[ahead, here] + length[behind, here]) / 2
        assert gap[y[ahead, here] == y[behind, here]].min(initial=9.0) > 3.999


def test_lane_changing_is_that_of_the_keys():
    state, people = drawn(idm_of())
    for name in ("politeness", "gain_threshold", "safe_decel"):
        np.testing.assert_array_equal(getattr(people.mobil, name), getattr(MOBIL, name))
    # As highway-env's timer has it: additions of 1/15 s until they exceed the delay.
    elapsed, period = 0.0, 0
    while not elapsed > MOBIL.delay:
        elapsed, period = elapsed + 1 / 15, period + 1
    np.testing.assert_array_equal(people.mobil.decision_period, period)
    assert period in (30, 31)
    assert np.asarray(people.mobil.changes_lanes).all()
    ticks = np.asarray(state.ticks_to_decision)
    assert ticks.min() >= 1
    assert ticks.max() <= period
    assert ticks.mean() == pytest.approx(period / 2, abs=1.0)  # not all of them at once
    _, _, before = spawned()
    assert (np.asarray(before.mobil.decision_period) == 16).all()


@pytest.mark.thorough
def test_lane_changing_alone_leaves_car_following_as_it_is():
    _, start, before = spawned()
    state, people = drawn(numbers_of(mobil=MobilConfig(politeness=0.3)))
    assert people.car_following.desired_speed is None
    np.testing.assert_array_equal(people.car_following.accel_exponent, before.car_following.accel_exponent)
    for name in ("time_gap", "jam_gap", "max_accel", "comfort_decel"):
        value = np.asarray(getattr(before.car_following, name))
        np.testing.assert_array_equal(getattr(people.car_following, name), np.broadcast_to(value, start.x.shape))
    np.testing.assert_array_equal(people.mobil.politeness, 0.3)
    np.testing.assert_array_equal(people.mobil.gain_threshold, before.mobil.gain_threshold)
    assert state.memory is None


@pytest.mark.parametrize("dtype", [F64, pytest.param(np.dtype("float32"), marks=pytest.mark.thorough)], ids=str)
def test_one_key_of_highway_env_changes_nothing_else(dtype):
    """Bit for bit: the state, and every parameter but the one that is said."""
    _, start, before = spawned(dtype)
    state, people = drawn(numbers_of(time_gap=1.2, dtype=dtype), dtype)
    assert people.car_following.time_gap.dtype == dtype
    np.testing.assert_array_equal(people.car_following.time_gap, dtype.type(1.2))
    assert jax.tree.structure(state) == jax.tree.structure(start)
    for after, now in zip(jax.tree.leaves(state), jax.tree.leaves(start), strict=True):
        np.testing.assert_array_equal(after, now)
        assert after.dtype == now.dtype
    ours, theirs = people.car_following, before.car_following
    assert ours.desired_speed is theirs.desired_speed is None
    for name in ("jam_gap", "max_accel", "comfort_decel", "accel_exponent"):
        given = np.broadcast_to(np.asarray(getattr(theirs, name)), start.x.shape)
        np.testing.assert_array_equal(getattr(ours, name), given)
    for name in ("length", "width", "accel_limit", "collides"):
        given = np.broadcast_to(np.asarray(getattr(before.body, name)), start.x.shape)
        np.testing.assert_array_equal(np.broadcast_to(getattr(people.body, name), start.x.shape), given)
    for after, now in zip(jax.tree.leaves(people.mobil), jax.tree.leaves(before.mobil), strict=True):
        np.testing.assert_array_equal(after, now)
    assert people.effects == ()
    assert not people.see_gaps


@pytest.mark.thorough
def test_what_highway_env_draws_can_be_said_instead():
    state, people = drawn(numbers_of(desired_speed=27.0, accel_exponent=3.0, accel_exponent_sd=0.2))
    np.testing.assert_allclose(state.desired_speed, 27.0, rtol=1e-12)
    exponent = np.asarray(people.car_following.accel_exponent)
    assert exponent.mean() == pytest.approx(3.0, abs=0.02)
    assert exponent.std() == pytest.approx(0.2, abs=0.02)


@pytest.mark.thorough
def test_noise_of_the_keys_acts_as_an_effect():
    _, people = drawn(numbers_of("idm", noise_sd=0.4, noise_time=2.0))
    (noise,) = people.effects
    assert noise.name == "acceleration_noise"
    np.testing.assert_allclose(noise.sd, 0.4)
    np.testing.assert_allclose(noise.time, 2.0)
    assert len(np.unique(noise.seed)) > 0.99 * N_SCENARIOS


def test_defaults_are_highway_envs_drivers_untouched():
    assert numbers_of() is None
    assert numbers_of("highway_env_idm", MobilConfig()) is None
    assert numbers_of(time_gap=1.5, jam_gap=5.0) is None  # said, but as it is anyway
    for changed in ({"time_gap": 1.4}, {"length": 4.9}, {"noise_sd": 0.1}, {"time_gap_sd": 0.1}):
        assert numbers_of(**changed) is not None
    assert numbers_of(mobil=MobilConfig(delay=1.1)) is not None
    for model in ("idm", "krauss"):
        assert numbers_of(model) is not None


def test_a_class_may_set_what_all_others_have_as_drawn():
    trucks = {"truck": {"share": 0.3, "desired_speed": 20.0, "accel_exponent": 2.0}}
    _, before, spawned_drivers = spawned()
    state, people = drawn(numbers_of(classes=trucks))
    truck = np.asarray(people.body.is_truck)
    assert 0.2 < truck.mean() < 0.4
    found = (state.desired_speed, people.car_following.accel_exponent)
    others = (before.desired_speed, spawned_drivers.car_following.accel_exponent)
    for value, of_truck, of_others in zip(found, (20.0, 2.0), others, strict=True):
        np.testing.assert_array_equal(np.asarray(value)[truck], of_truck)
        np.testing.assert_array_equal(np.asarray(value)[~truck], np.asarray(of_others)[~truck])
