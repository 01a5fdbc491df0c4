"""Vehicle types of SUMO: which number goes where, correlations, and what is not said."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config.driver import MODELS as DECLARED
from rearl_jax.core.effects import EFFECTS
from rearl_jax.export import sumo, to_sumo
from rearl_jax.export.drawn import DriverColumns
from rearl_jax.export.translations import untranslated_effects
from rearl_jax.models.population import population_of_model
from rearl_jax.models.record import EffectValues
from tests.models.drivers import CURVE, GAIN, MOBIL, NOISE, SD, drivers, model
from tests.refusal import refused

F64 = np.dtype("float64")
DELAY = EffectValues("reaction_delay", {"delay": 0.6, "own_delay": 0.4})


def two(car_following, **values):
    """A car and a truck with the same parameters but for twice the time gap."""
    columns = {name: np.array([value, value]) for name, value in values.items()}
    columns["time_gap"] = columns["time_gap"] * [1, 2]
    return DriverColumns(car_following, columns, np.array([4.5, 12.0]), np.array([False, True]))


def population(*effects, **changes):
    return population_of_model(replace(model(*effects), **changes), F64, with_effects=True)


def test_idm_has_its_numbers_in_the_attributes_of_the_same_equation():
    values = {"desired_speed": 30.0, "time_gap": 1.2, "jam_gap": 2.5, "max_accel": 1.4, "comfort_decel": 2.0}
    car, truck = sumo.type_attributes(two("idm", **values), ())
    expected = {
        "carFollowModel": "IDM",
        "delta": "4",
        "emergencyDecel": "9",
        "speedFactor": "1",
        "speedDev": "0",
        "vClass": "passenger",
        "length": "4.5",
        "maxSpeed": "30",
        "tau": "1.2",
        "minGap": "2.5",
        "accel": "1.4",
        "decel": "2",
    }
    assert car == expected
    assert truck == expected | {"vClass": "truck", "length": "12", "tau": "2.4"}


def test_cruise_control_has_one_gain_in_all_modes_and_the_sign_of_sumo():
    values = {"desired_speed": 30.0, "time_gap": 1.5, "jam_gap": 2.5}
    own = {"gap_gain": 0.1, "approach_gain": 0.5, "speed_gain": 0.4}
    car, _ = sumo.type_attributes(two("constant_time_headway", **values, **own), ())
    assert car["carFollowModel"] == "ACC"
    assert {car[f"{mode}GainSpace"] for mode in ("gapControl", "gapClosingControl", "collisionAvoidance")} == {"0.1"}
    assert {car[f"{mode}GainSpeed"] for mode in ("gapControl", "gapClosingControl", "collisionAvoidance")} == {"0.5"}
    assert (car["speedControlGain"], car["accel"], car["decel"]) == ("-0.4", "6", "9")


def test_eidm_has_idms_numbers_and_its_own_terms_only_where_the_model_has_them():
    values = {"desired_speed": 30.0, "time_gap": 1.2, "jam_gap": 2.5, "max_accel": 1.4, "comfort_decel": 2.0}
    car, _ = sumo.type_attributes(two("idm", **values), (), extended=True)
    plain, _ = sumo.type_attributes(two("idm", **values), ())
    assert (car["carFollowModel"], car["minGap"]) == ("EIDM", "2.2")
    terms = {"ccoolness", "sigmagap", "sigmaleader", "sigmaerror", "treaction"}
    assert {car[name] for name in terms} == {"0"}
    assert set(car) - set(plain) == terms
    assert {name for name, value in plain.items() if car[name] != value} == {"carFollowModel", "minGap"}
    close, _ = sumo.type_attributes(two("idm", **(values | {"jam_gap": 0.4})), (), extended=True)
    assert close["minGap"] == "0.25"
    with refused("equation-unknown-there", key="car_following", value="krauss"):
        sumo.sumo_model("krauss", extended=True)


def test_eidm_says_noise_of_perception_and_no_delay():
    people = population(NOISE, DELAY)
    exported = to_sumo(people, 2, 0, extended=True)
    one = ET.fromstring(exported.text.encode())[0][0]
    # SUMO's processes have a standard deviation of .5.
    assert [float(one.attrib[name]) for name in ("sigmagap", "sigmaleader", "tPersEstimate")] == [0.1, 0.02, 20.0]
    assert "actionStepLength" not in one.attrib
    said = {one.what: one.where for one in exported.translations}
    assert (said["perception_noise"], said["reaction_delay"]) == ("sigmagap, sigmaleader, tPersEstimate", None)
    plain = {one.what: one.where for one in to_sumo(people, 2, 0).translations}
    assert (plain["perception_noise"], plain["reaction_delay"]) == (None, "actionStepLength")


@pytest.mark.parametrize("name", sumo.MODELS)
def test_every_parameter_of_a_model_has_a_place(name):
    assert set(sumo.MODELS[name].attributes) == set(DECLARED[name].names)


@pytest.mark.parametrize("name", sorted(set(DECLARED) - set(sumo.MODELS)))
def test_models_without_the_same_equation_are_refused(name):
    with refused("equation-unknown-there", key="car_following", value=name):
        sumo.sumo_model(name)


def test_correlations_and_shares_of_the_population_are_those_of_the_types():
    covariance = np.diag([value**2 for value in SD.values()])
    covariance[1, 3] = covariance[3, 1] = -0.6 * SD["time_gap"] * SD["max_accel"]
    classes = {
        "car": drivers(0.8, (30.0, 1.2, 2.5, 1.4, 2.0), 4.5, 0.0, covariance.tolist()),
        "truck": drivers(0.2, (24.0, 1.6, 2.5, 0.9, 2.0), 12.0, 0.0),
    }
    text = to_sumo(population(population=classes, baseline=classes), 2000, 0).text
    (distribution,) = ET.fromstring(text.encode())
    types = list(distribution)
    assert (distribution.tag, distribution.get("id"), len(types)) == ("vTypeDistribution", sumo.DISTRIBUTION, 2000)
    assert {one.get("probability") for one in types} == {"1"}
    cars = [one for one in types if one.get("vClass") == "passenger"]
    assert len(cars) / 2000 == pytest.approx(0.8, abs=0.03)
    logs = np.log([[float(one.attrib[name]) for name in ("tau", "accel", "decel")] for one in cars])
    correlation = np.corrcoef(logs.T)
    assert correlation[0, 1] == pytest.approx(-0.6, abs=0.05)
    assert correlation[0, 2] == pytest.approx(0.0, abs=0.08)
    assert logs[:, 0].mean() == pytest.approx(np.log(1.2), abs=0.03)


def test_a_delay_becomes_action_steps_of_twice_its_length():
    people = population(DELAY)
    one = ET.fromstring(to_sumo(people, 2, 0).text.encode())[0][0]
    assert float(one.attrib["actionStepLength"]) == pytest.approx(2 * 0.5)
    (early,) = population(EffectValues("reaction_delay", {"delay": -0.05, "own_delay": -0.05})).effects
    assert "actionStepLength" not in sumo.type_attributes(two("idm", time_gap=1.0), (early,))[0]


def test_every_part_of_the_model_is_said_or_listed():
    people = population(GAIN, CURVE, DELAY, lane_changing=MOBIL)
    said = {one.what: one for one in to_sumo(people, 1, 0).translations}
    assert {name: said[name].where for name in ("time_gap", "length")} == {"time_gap": "tau", "length": "length"}
    assert said["reaction_delay"].where == "actionStepLength"
    unsaid = {name for name, one in said.items() if one.where is None}
    assert unsaid == {"leader_acceleration", "dependence", "keep_right", "noise_sd, noise_time", "lane changing"}
    assert all(said[name].remark for name in unsaid)


def test_every_effect_of_the_library_has_a_reason():
    assert [one.what for one in untranslated_effects(EFFECTS, "SUMO")] == list(EFFECTS)
