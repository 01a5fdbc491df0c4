"""Drivers drawn from a repaired model: their distribution, their places, and what two variants share."""

import math
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.models.population import LaneChanging, population_of_model
from rearl_jax.models.record import EffectValues
from rearl_jax.models.traffic import MIN_GAP, populate
from tests.models.drivers import CURVE, GAIN, MOBIL, NOISE, PARAMETERS, SD, drivers, model

ROAD = TrafficModel(speed_limit=None)
N_VEHICLES, N_SCENARIOS = 10, 400
F64 = np.dtype("float64")


def drawn(repaired, *, with_effects=True, keys=N_SCENARIOS, road=ROAD):
    numbers = population_of_model(repaired, F64, with_effects=with_effects)
    keys = jax.vmap(jax.random.key)(jnp.arange(keys))

    @partial(jax.jit, compiler_options=QUICKLY_COMPILED)
    def draw(keys):
        start = spawn(keys, road, n_vehicles=N_VEHICLES, dtype=jnp.dtype("float64"))
        return start[0], *populate(*start, keys, numbers, road)

    return draw(keys)


@pytest.fixture(scope="module")
def traffic():
    return drawn(model(GAIN, CURVE, NOISE))


@pytest.fixture(scope="module")
def without():
    return drawn(model(GAIN, CURVE, NOISE), with_effects=False)


def test_drivers_are_log_normal_by_class(traffic):
    _, _, people = traffic
    truck = np.asarray(people.body.is_truck)
    assert truck.mean() == pytest.approx(0.2, abs=0.03)
    for name in PARAMETERS:
        for kind, is_it in (("car", ~truck), ("truck", truck)):
            logs = np.log(np.asarray(getattr(people.car_following, name))[is_it])
            assert logs.mean() == pytest.approx(model().population[kind].log_mean[name], abs=5 * SD[name] / 28)
            assert logs.std() == pytest.approx(SD[name], rel=0.1)  # cut at 2.5 standard deviations
    length = np.asarray(people.body.length)
    assert length[~truck].mean() == pytest.approx(4.5, abs=0.05)
    assert length[truck].mean() == pytest.approx(12.0, abs=0.3)


def test_parameters_are_correlated_as_the_covariance_says():
    covariance = np.diag([value**2 for value in SD.values()])
    covariance[1, 3] = covariance[3, 1] = -0.6 * SD["time_gap"] * SD["max_accel"]
    cars = {"car": drivers(1.0, (30.0, 1.2, 2.5, 1.4, 2.0), 4.5, 0.0, covariance.tolist())}
    _, _, people = drawn(replace(model(), population=cars, baseline=cars))
    logs = [np.log(np.asarray(getattr(people.car_following, name))).ravel() for name in ("time_gap", "max_accel")]
    assert np.corrcoef(logs)[0, 1] == pytest.approx(-0.6, abs=0.05)
    assert people.effects == ()  # no noise, no effects


def test_both_variants_have_the_same_quantiles_of_drivers(traffic, without):
    (_, state, people), (_, state_without, people_without) = traffic, without
    np.testing.assert_array_equal(people.body.length, people_without.body.length)
    np.testing.assert_array_equal(people.body.is_truck, people_without.body.is_truck)
    for name in ("x", "y", "speed"):
        np.testing.assert_array_equal(getattr(state, name), getattr(state_without, name))
    truck = np.asarray(people.body.is_truck)
    ratio = np.asarray(people_without.car_following.time_gap / people.car_following.time_gap)
    np.testing.assert_allclose(ratio[~truck], 1.4 / 1.2, rtol=1e-12)
    np.testing.assert_allclose(ratio[truck], 1.8 / 1.6, rtol=1e-12)
    assert [effect.name for effect in people.effects] == [
        *("leader_acceleration", "dependence", "perception_noise", "acceleration_noise"),
    ]
    assert [effect.name for effect in people_without.effects] == ["acceleration_noise"]
    np.testing.assert_array_equal(people.effects[-1].seed, people_without.effects[-1].seed)
    np.testing.assert_allclose(people_without.effects[-1].sd, 0.3)


def test_a_scenario_does_not_depend_on_those_around_it(traffic):
    _, state, people = traffic
    _, few, few_people = drawn(model(GAIN, CURVE, NOISE), keys=3)
    np.testing.assert_array_equal(few.x, state.x[:, :3])
    np.testing.assert_allclose(few_people.car_following.time_gap, people.car_following.time_gap[:, :3], rtol=1e-12)
    np.testing.assert_array_equal(few_people.effects[2].seed, people.effects[2].seed[:, :3])


def test_nobody_starts_inside_another_and_most_stay_where_they_were(traffic):
    before, state, people = traffic
    x, y, length = (np.asarray(values) for values in (state.x, state.y, people.body.length))
    least = math.inf
    for scenario in range(N_SCENARIOS):
        for lane in np.unique(y[:, scenario]):
            on_lane = np.flatnonzero(y[:, scenario] == lane)
            order = on_lane[np.argsort(x[on_lane, scenario])]
            gaps = np.diff(x[order, scenario]) - (length[order[1:], scenario] + length[order[:-1], scenario]) / 2
            least = min(least, *gaps, math.inf)
    assert least >= MIN_GAP - 1e-9
    moved = x != np.asarray(before.x)
    assert 0.01 < moved.mean() < 0.3
    assert (x >= np.asarray(before.x)).all()


def test_desired_speeds_are_those_of_the_drivers(traffic):
    _, state, people = traffic
    np.testing.assert_array_equal(state.desired_speed, people.car_following.desired_speed)
    assert (np.asarray(state.memory.desired_side) == 0).all()


def numbers(*effects, with_effects=True, **keys):
    return population_of_model(replace(model(*effects), lane_changing=MOBIL), F64, with_effects=with_effects, **keys)


@pytest.mark.parametrize("with_effects", [True, False])
def test_lane_changing_is_that_of_the_model_with_and_without_effects(with_effects):
    found = numbers(GAIN, with_effects=with_effects)
    own = found.lane_changing
    assert own is not None
    values = (own.politeness, own.gain_threshold, own.safe_decel, own.delay)
    assert values == (MOBIL.politeness, MOBIL.gain_threshold, MOBIL.safe_decel, MOBIL.delay)
    assert own.period in (15 * 90, 15 * 90 + 1)
    bias = found.effects[-1]
    assert (bias.name, float(bias.bias)) == ("keep_right", MOBIL.bias)
    assert population_of_model(model(GAIN), F64, with_effects=with_effects).lane_changing is None


def test_effects_take_the_place_of_the_parameters_that_do_the_same():
    effects = (EffectValues("keep_right", {"bias": 0.35}), EffectValues("politeness", {"weight": 0.2}))
    found = numbers(*effects)
    assert found.lane_changing is not None
    assert found.lane_changing.politeness == 0.0
    assert [effect.name for effect in found.effects] == ["keep_right", "politeness"]
    assert float(found.effects[0].bias) == 0.35
    without = numbers(*effects, with_effects=False)
    assert without.lane_changing is not None
    assert without.lane_changing.politeness == MOBIL.politeness
    assert [float(effect.bias) for effect in without.effects] == [MOBIL.bias]


def test_lane_changing_of_keys_takes_the_place_of_the_models():
    keys = LaneChanging(*map(np.asarray, (0.1, 0.2, 2.0, 1.0)), np.asarray(16))
    found = numbers(GAIN, lane_changing=keys)
    assert found.lane_changing is keys
    assert [effect.name for effect in found.effects] == ["leader_acceleration"]
