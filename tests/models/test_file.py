"""`model.yaml`: what is written is read, and what cannot be used is refused by file, key and remedy."""

import copy
import dataclasses

import numpy as np
import pytest
import yaml

from rearl_jax.core.effects import EFFECTS
from rearl_jax.models.file import BadModelError, model_id, read_model, write_model
from rearl_jax.models.record import EffectValues
from tests.models.drivers import CURVE, GAIN, NOISE, PARAMETERS, SD, drivers, model


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.yaml"


@pytest.fixture
def content(path):
    write_model(path, model(GAIN, CURVE, NOISE))
    return yaml.safe_load(path.read_text())


def refused(path, content, match):
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(BadModelError, match=match) as caught:
        read_model(path)
    assert str(path) in str(caught.value)


def plain(value):
    return yaml.safe_load(yaml.safe_dump(_lists(dataclasses.asdict(value))))


def _lists(value):
    if isinstance(value, dict):
        return {key: _lists(part) for key, part in value.items()}
    return [_lists(part) for part in value] if isinstance(value, (list, tuple)) else value


def test_what_is_written_is_read(path):
    written = model(GAIN, CURVE, NOISE)
    write_model(path, written)
    assert plain(read_model(path)) == plain(written)
    assert read_model(path).effects[1].variable == "speed"


def test_numbers_of_numpy_are_written_as_numbers(path):
    effect = EffectValues("leader_acceleration", {"gain": np.float64(0.5), "reach": np.float32(60.0)})
    write_model(path, model(effect))
    assert read_model(path).effects[0].parameters == {"gain": 0.5, "reach": 60.0}


def test_identity_is_that_of_the_content(path, content):
    before = model_id(path)
    write_model(path, model(GAIN, CURVE, NOISE))
    assert model_id(path) == before
    write_model(path, model(GAIN, NOISE))
    assert model_id(path) != before


@pytest.mark.parametrize("name", EFFECTS)
def test_parameters_outside_their_bounds_are_refused(path, content, name):
    usual = {item.name: item.off for item in EFFECTS[name].parameters}
    variable = None
    if "dependence" in name:
        usual, variable = {"values": [0.1, 0.2], "knots": [0.0, 10.0]}, "speed"
    if name == "closed_course":
        usual = {"values": [0.1, 0.2, -0.1], "lap": 500.0}
    for item in EFFECTS[name].parameters:
        for beyond in (item.low - 1.0, item.high * 1.001 + 1.0):
            value = [0.0, beyond] if item.is_list else beyond
            bad = dict(content, effects=[{"name": name, "parameters": usual | {item.name: value}}])
            if variable:
                bad["effects"][0]["variable"] = variable
            refused(path, bad, rf"effects\[0\].parameters.{item.name}.*must be within")
    write_model(path, model(EffectValues(name, usual, variable)))  # within them they are taken


def test_a_bad_model_is_not_written(path):
    with pytest.raises(BadModelError, match="gain must be within"):
        write_model(path, model(EffectValues("leader_acceleration", {"gain": 9.0, "reach": 60.0})))
    assert not path.exists()


CHANGES = {
    "schema is 2": lambda c: c.update(schema=2),
    "source.study is missing": lambda c: c["source"].pop("study"),
    "the file.efects is no key; nearest: effects": lambda c: c.update(efects=[]),
    "population has shares with the sum 1.1": lambda c: c["population"]["car"].update(share=0.9),
    "baseline.car.share must equal": lambda c: (
        c["baseline"]["truck"].update(share=0.3),
        c["baseline"]["car"].update(share=0.7),
    ),
    "baseline must have the classes of population": lambda c: (
        c["baseline"].pop("truck"),
        c["baseline"]["car"].update(share=1.0),
    ),
    r"population.car.log_mean.time_gap must be a finite number, got '1e-3' \(YAML wants": lambda c: c["population"][
        "car"
    ]["log_mean"].update(time_gap="1e-3"),
    "population.car.log_mean.time_gap must be a finite number, got nan": lambda c: c["population"]["car"][
        "log_mean"
    ].update(time_gap=float("nan")),
    "population.car.log_covariance must be symmetric": lambda c: c["population"]["car"]["log_covariance"][
        0
    ].__setitem__(1, 3.0),
    "population.car.log_covariance must have 5 rows": lambda c: c["population"]["car"]["log_covariance"].pop(),
    r"effects\[0\].name is 'leader_accel'; nearest: leader_acceleration": lambda c: c["effects"][0].update(
        name="leader_accel"
    ),
    r"effects\[0\].parameters.reach is missing": lambda c: c["effects"][0]["parameters"].pop("reach"),
    r"effects\[0\].variable means nothing to leader_acceleration": lambda c: c["effects"][0].update(variable="speed"),
    r"effects\[1\].variable is 'spead', but must be one of": lambda c: c["effects"][1].update(variable="spead"),
    r"effects\[1\].parameters.knots must rise in equal steps": lambda c: c["effects"][1]["parameters"].update(
        knots=[0.0, 1.0, 5.0]
    ),
    r"effects\[3\].name leader_acceleration is there twice": lambda c: c["effects"].append(
        copy.deepcopy(c["effects"][0])
    ),
    "effects must be a list": lambda c: c.update(effects=None),
}


@pytest.mark.parametrize("match", CHANGES)
def test_what_is_wrong_is_named(path, content, match):
    CHANGES[match](content)
    refused(path, content, match)


def test_no_file_and_no_yaml(path):
    with pytest.raises(FileNotFoundError, match="there is no such file; `rearl discover` writes"):
        read_model(path)
    path.write_text("a: [")
    with pytest.raises(BadModelError, match="is no YAML"):
        read_model(path)


def test_cars_alone_are_a_population(path):
    cars = {"car": drivers(1.0, (30.0, 1.2, 2.5, 1.4, 2.0), 4.5, 0.0)}
    write_model(path, dataclasses.replace(model(), population=cars, baseline=cars))
    assert list(read_model(path).population) == ["car"]
    assert set(SD) == set(PARAMETERS)
