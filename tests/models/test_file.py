"""`model.yaml`: what is written is read, and what cannot be used is refused by file, key and remedy."""

import copy
import dataclasses

import numpy as np
import pytest
import yaml

from rearl_jax.core.effects import EFFECTS
from rearl_jax.models.file import BadModelError, model_id, read_model, write_model
from rearl_jax.models.record import LANE_CHANGE_BOUNDS, EffectValues
from rearl_jax.problems import MissingInputError
from tests.models.drivers import CURVE, GAIN, MOBIL, NOISE, PARAMETERS, SD, drivers, model


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.yaml"


@pytest.fixture
def content(path):
    write_model(path, model(GAIN, CURVE, NOISE))
    return yaml.safe_load(path.read_text())


def refused(path, content, code, key):
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(BadModelError) as caught:
        read_model(path)
    problem = caught.value.problem
    assert (problem.code, problem.file, problem.key) == (code, str(path), key)
    return str(caught.value)


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


def test_lane_changing_is_read_back_and_left_out_where_there_is_none(path, content):
    assert "lane_changing" not in content
    assert read_model(path).lane_changing is None
    write_model(path, dataclasses.replace(model(GAIN), lane_changing=MOBIL))
    assert read_model(path).lane_changing == MOBIL


@pytest.mark.parametrize("name", LANE_CHANGE_BOUNDS)
def test_lane_changing_outside_its_bounds_is_refused(path, content, name):
    key = f"lane_changing.{name}"
    for beyond in (LANE_CHANGE_BOUNDS[name][0] - 0.1, LANE_CHANGE_BOUNDS[name][1] + 0.1):
        bad = content | {"lane_changing": dataclasses.asdict(MOBIL) | {name: beyond}}
        refused(path, bad, "out-of-range", key)
    given = dataclasses.asdict(MOBIL)
    del given[name]
    refused(path, content | {"lane_changing": given}, "key-missing", key)
    refused(path, content | {"lane_changing": None}, "wrong-type", "lane_changing")


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
            key = f"effects[0].parameters.{item.name}"
            refused(path, bad, "out-of-range", f"{key}[1]" if item.is_list else key)
    write_model(path, model(EffectValues(name, usual, variable)))  # within them they are taken


def test_a_bad_model_is_not_written(path):
    with pytest.raises(BadModelError) as caught:
        write_model(path, model(EffectValues("leader_acceleration", {"gain": 9.0, "reach": 60.0})))
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", "effects[0].parameters.gain")
    assert not path.exists()


def _in(content, *path):
    """The value at a place of the file."""
    for part in path:
        content = content[part]
    return content


def _other_share(content):
    _in(content, "baseline", "truck").update(share=0.3)
    _in(content, "baseline", "car").update(share=0.7)


def _other_classes(content):
    _in(content, "baseline").pop("truck")
    _in(content, "baseline", "car").update(share=1.0)


CAR = ("population", "car")
CHANGES = {
    "schema": (lambda c: c.update(schema=2), "schema-unknown", "schema"),
    "missing": (lambda c: c["source"].pop("study"), "key-missing", "source.study"),
    "unknown": (lambda c: c.update(efects=[]), "key-unknown", "the file.efects"),
    "shares": (lambda c: _in(c, *CAR).update(share=0.9), "shares", "population"),
    "share": (_other_share, "vehicles-differ", "baseline.car.share"),
    "classes": (_other_classes, "classes-differ", "baseline"),
    "text": (
        lambda c: _in(c, *CAR, "log_mean").update(time_gap="1e-3"),
        "not-a-number",
        "population.car.log_mean.time_gap",
    ),
    "nan": (
        lambda c: _in(c, *CAR, "log_mean").update(time_gap=float("nan")),
        "not-a-number",
        "population.car.log_mean.time_gap",
    ),
    "huge": (
        lambda c: _in(c, *CAR, "log_mean").update(time_gap=10**400),
        "not-a-number",
        "population.car.log_mean.time_gap",
    ),
    "asymmetric": (
        lambda c: _in(c, *CAR, "log_covariance", 0).__setitem__(1, 3.0),
        "no-covariance",
        "population.car.log_covariance",
    ),
    "rows": (lambda c: _in(c, *CAR, "log_covariance").pop(), "wrong-length", "population.car.log_covariance"),
    "effect": (lambda c: _in(c, "effects", 0).update(name="leader_accel"), "choice-unknown", "effects[0].name"),
    "parameter": (
        lambda c: _in(c, "effects", 0, "parameters").pop("reach"),
        "key-missing",
        "effects[0].parameters.reach",
    ),
    "no variable": (lambda c: _in(c, "effects", 0).update(variable="speed"), "key-unknown", "effects[0].variable"),
    "variable": (lambda c: _in(c, "effects", 1).update(variable="spead"), "choice-unknown", "effects[1].variable"),
    "knots": (
        lambda c: _in(c, "effects", 1, "parameters").update(knots=[0.0, 1.0, 5.0]),
        "knots-uneven",
        "effects[1].parameters.knots",
    ),
    "twice": (lambda c: c["effects"].append(copy.deepcopy(c["effects"][0])), "effect-twice", "effects[3].name"),
    "no list": (lambda c: c.update(effects=None), "wrong-type", "effects"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_wrong_is_named(path, content, change):
    alter, code, key = CHANGES[change]
    alter(content)
    refused(path, content, code, key)


def test_a_misspelt_name_is_told_the_nearest(path, content):
    content["effects"][0].update(name="leader_accel")
    assert "leader_acceleration" in refused(path, content, "choice-unknown", "effects[0].name")


def test_no_file_and_no_yaml(path):
    with pytest.raises(MissingInputError) as caught:
        read_model(path)
    assert (caught.value.code, caught.value.problem.key) == ("file-missing", "model")
    for text in ("a: [", "? [a]\n: 1", "a: 2024-99-99", "a: 0x_", f"a: {'9' * 5000}", "[" * 10_000, b"a: \xff"):
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(BadModelError) as caught:
            read_model(path)
        assert caught.value.code == "not-yaml"


def test_a_key_given_twice_is_refused(path, content):
    text = yaml.safe_dump(content, sort_keys=False)
    path.write_text(text.replace("gain: 0.5\n", "gain: 0.5\n    gain: 0.9\n"))
    assert path.read_text() != text
    with pytest.raises(BadModelError, match="the key gain occurs twice") as caught:
        read_model(path)
    assert caught.value.code == "not-yaml"


def test_cars_alone_are_a_population(path):
    cars = {"car": drivers(1.0, (30.0, 1.2, 2.5, 1.4, 2.0), 4.5, 0.0)}
    write_model(path, dataclasses.replace(model(), population=cars, baseline=cars))
    assert list(read_model(path).population) == ["car"]
    assert set(SD) == set(PARAMETERS)
