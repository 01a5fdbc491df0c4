"""Keys of drivers: what is declared is what can be set, within its bounds, for every class."""

import pickle

import pytest

from rearl_jax.config import DiscoverTask, EvaluateTask
from rearl_jax.config._schema import as_plain, finished, from_plain, keys_of
from rearl_jax.config.driver import DEFAULT, MODELS, DriverConfig, record_of
from tests.refusal import refused

TRUCKS = {"truck": {"share": 0.1, "time_gap": 1.8, "length": 12.0}}


@pytest.mark.parametrize("name", MODELS)
def test_every_parameter_has_keys_with_unit_default_and_source(name):
    keys = keys_of(record_of(name)())
    for parameter in MODELS[name].parameters:
        value, spread = keys[parameter.name], keys[f"{parameter.name}_sd"]
        assert value.default == ("null" if parameter.usual is None else str(parameter.usual))
        assert parameter.unit == "-" or f"[{parameter.unit}]" in value.help
        assert parameter.source in value.help
        assert spread.default == "0.0"
    assert MODELS[name].names[:3] == ("desired_speed", "time_gap", "jam_gap")


def test_the_default_is_highway_envs_and_can_be_told_from_others():
    config = EvaluateTask()
    assert config.driver.model == DEFAULT
    assert config.driver.is_default
    assert not record_of("idm")().is_default
    assert not record_of(DEFAULT)(time_gap=1.2).is_default
    assert not record_of(DEFAULT)(classes=TRUCKS).is_default


def test_a_class_has_what_it_says_and_else_what_all_have():
    driver = record_of("idm")(time_gap=1.1, jam_gap=3.0, classes=TRUCKS)
    assert driver.values("truck")["time_gap"] == 1.8
    assert driver.values("truck")["jam_gap"] == 3.0
    assert driver.values()["time_gap"] == 1.1
    assert "share" not in driver.values("truck")


@pytest.mark.parametrize("name", MODELS)
def test_a_record_survives_being_written_and_sent(name):
    config = EvaluateTask(driver=record_of(name)(classes=TRUCKS))
    again = from_plain(EvaluateTask, as_plain(config))
    assert again == config
    assert type(again.driver) is record_of(name)
    assert pickle.loads(pickle.dumps(config.driver)) == config.driver
    assert hash(again) == hash(config)


def test_a_name_alone_chooses_a_model():
    assert from_plain(EvaluateTask, {"driver": "gipps"}).driver == record_of("gipps")()
    with refused("choice-unknown", key="driver.model"):
        from_plain(EvaluateTask, {"driver": "gips"})


@pytest.mark.parametrize(
    ("values", "code", "key"),
    [
        ({"time_gap": 20.0}, "out-of-range", "time_gap"),
        ({"time_gap_sd": -0.1}, "out-of-range", "time_gap_sd"),
        ({"length": 0.0}, "out-of-range", "length"),
        ({"noise_sd": 9.0}, "out-of-range", "noise_sd"),
        ({"classes": {"truck": {"time_gap": 1.8}}}, "out-of-range", "classes.truck"),
        ({"classes": {"truck": {"share": 0.1, "timegap": 1.8}}}, "key-unknown", "classes.truck.timegap"),
        ({"classes": {"truck": {"share": 0.1, "time_gap": 99.0}}}, "out-of-range", "classes.truck.time_gap"),
        ({"classes": {"truck": {"share": 0.1, "time_gap": "x"}}}, "out-of-range", "classes.truck.time_gap"),
        ({"classes": {"a": {"share": 0.6}, "b": {"share": 0.6}}}, "out-of-range", "classes"),
        ({"model": "gipps"}, "driver-keys-of-another", "model"),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(values, code, key):
    with refused(code, key=f"driver.{key}"):
        finished(EvaluateTask(driver=record_of("idm")(**values)))


def test_a_spread_needs_a_value():
    with refused("key-missing", key="driver.desired_speed_sd=2"):
        finished(EvaluateTask(driver=record_of(DEFAULT)(desired_speed_sd=2.0)))


def test_a_calibration_finds_itself_how_drivers_differ():
    finished(DiscoverTask(driver=record_of("gipps")(time_gap=1.5)))
    with refused("found-by-calibration", key="driver.time_gap_sd"):
        finished(DiscoverTask(driver=record_of("idm")(time_gap_sd=0.2)))
    finished(DiscoverTask(driver=record_of(DEFAULT)()))


def test_the_base_of_all_models_is_no_choice_of_its_own():
    with refused("driver-keys-of-another", key="driver.model"):
        finished(EvaluateTask(driver=DriverConfig()))
