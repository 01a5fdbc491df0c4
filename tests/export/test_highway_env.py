"""Attributes of highway-env's IDMVehicle: a vehicle that has them drives as our driver does."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from rearl_jax.config.driver import record_of
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.core.car_following.highway_env_idm import HighwayEnvIDM
from rearl_jax.export import to_highway_env
from rearl_jax.models.population import population_of_keys, population_of_model
from rearl_jax.models.record import EffectValues
from tests.models.drivers import model
from tests.refusal import refused

F64 = np.dtype("float64")


def people(name, mobil=None, **keys):
    return population_of_keys(record_of(name)(**keys), mobil or MobilConfig(), F64, 15)


def test_a_vehicle_with_the_attributes_accelerates_as_the_driver():
    usual = {"desired_speed": 31.0, "time_gap": 1.1, "jam_gap": 3.0, "max_accel": 1.4, "comfort_decel": 2.2}
    exported = to_highway_env(people("highway_env_idm", accel_exponent=3.8, **usual), 1, 0)
    road = Road(RoadNetwork.straight_road_network(1, speed_limit=40))
    own, leader = IDMVehicle(road, [0.0, 0.0], speed=24.0), Vehicle(road, [33.0, 0.0], speed=21.0)
    for name, value in json.loads(exported.text)[0].items():
        assert hasattr(own, name)
        setattr(own, name, value)
    driver = HighwayEnvIDM(accel_exponent=jnp.array([3.8]), **{name: jnp.array([v]) for name, v in usual.items()})
    expected = driver.acceleration(jnp.array([28.0]), jnp.array([24.0]), jnp.array([3.0]))
    assert own.acceleration(own, leader) == pytest.approx(float(expected[0]), abs=1e-5)
    assert all(one.where for one in exported.translations)


def test_the_published_model_and_lane_changing_are_said_with_what_differs():
    exported = to_highway_env(people("idm", MobilConfig(politeness=0.3, delay=2.0), time_gap_sd=0.3), 50, 0)
    drawn = json.loads(exported.text)
    assert {one["DELTA"] for one in drawn} == {4.0}
    assert {(one["POLITENESS"], one["LANE_CHANGE_DELAY"]) for one in drawn} == {(0.3, 2.0)}
    assert np.std([one["TIME_WANTED"] for one in drawn]) == pytest.approx(0.3, rel=0.3)
    assert exported.translations[0].remark


def test_what_highway_env_draws_itself_stays_open():
    exported = to_highway_env(people("highway_env_idm", time_gap=1.0), 1, 0)
    assert {"target_speed", "DELTA"}.isdisjoint(json.loads(exported.text)[0])
    assert [one.what for one in exported.translations if one.where is None] == ["desired_speed", "accel_exponent"]


def test_effects_noise_and_lengths_are_not_said():
    effect = EffectValues("actuator_lag", {"time": 0.4})
    exported = to_highway_env(population_of_model(model(effect), F64, with_effects=True), 1, 0)
    unsaid = [one.what for one in exported.translations if one.where is None]
    assert unsaid == ["actuator_lag", "noise_sd, noise_time", "length, class of vehicles"]


def test_other_equations_are_refused():
    with refused("equation-unknown-there", key="car_following", value="krauss"):
        to_highway_env(people("krauss"), 1, 0)
