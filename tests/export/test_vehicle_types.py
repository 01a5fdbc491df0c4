"""Vehicle types of SUMO as a population: numbers, spreads, correlations, and files that cannot be read."""

import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import ResultsConfig
from rearl_jax.config.export import ImportTask, SumoFileConfig
from rearl_jax.export import read_types, to_sumo
from rearl_jax.export.population_of_types import population_of_types
from rearl_jax.export.reading import run
from rearl_jax.models.file import read_model
from rearl_jax.models.population import population_of_model
from rearl_jax.problems import MissingInputError
from tests.models.drivers import SD, model
from tests.refusal import refused

GAINS = " ".join(
    f'{mode}GainSpace="0.1" {mode}GainSpeed="0.5"' for mode in ("gapControl", "gapClosingControl", "collisionAvoidance")
)


@pytest.fixture
def write(tmp_path):
    """Writes a file with these types; gives its path."""

    def write(*types, distribution="mix"):
        rows = "".join(f'<vType id="t{number}" {own}/>' for number, own in enumerate(types))
        body = f'<vTypeDistribution id="{distribution}">{rows}</vTypeDistribution>' if distribution else rows
        path = tmp_path / "types.add.xml"
        path.write_text(f"<additional>{body}</additional>", encoding="utf-8")
        return path

    return write


def population(path, pattern="*", speed_limit=None):
    return population_of_types(read_types(path, pattern), speed_limit)


@pytest.mark.parametrize("name", ["idm", "improved_idm"])
def test_an_exported_population_comes_back(tmp_path, name):
    path = tmp_path / "types.add.xml"
    people = population_of_model(replace(model(), car_following=name), np.dtype("float64"), with_effects=True)
    path.write_text(to_sumo(people, 3000, 0).text, encoding="utf-8")
    read, classes, said = population(path)
    assert read == name
    assert all(one.where for one in said)
    for kind, share in (("car", 0.8), ("truck", 0.2)):
        own, back = model().population[kind], classes[kind]
        assert back.share == pytest.approx(share, abs=0.03)
        assert back.length == pytest.approx(own.length, rel=0.02)
        for place, parameter in enumerate(own.log_mean):
            assert back.log_mean[parameter] == pytest.approx(own.log_mean[parameter], abs=0.06)
            spread = math.sqrt(back.log_covariance[place][place])
            assert spread == pytest.approx(SD[parameter], rel=0.12)


def test_probabilities_weigh_and_correlations_are_kept(write):
    same = 'carFollowModel="IDM" maxSpeed="30" '
    _, classes, _ = population(
        write(same + 'tau="1" accel="2" probability="0.75"', same + 'tau="2" accel="1" probability="0.25"')
    )
    car = classes["car"]
    assert car.log_mean["time_gap"] == pytest.approx(0.25 * math.log(2))
    assert car.log_covariance[1][1] == pytest.approx(0.75 * 0.25 * math.log(2) ** 2)
    assert car.log_covariance[1][3] == pytest.approx(-car.log_covariance[1][1])


def test_a_speed_factor_multiplies_the_limit(write):
    path = write('carFollowModel="IDM" speedFactor="normc(1.1,0.11,0.5,2)"', distribution="")
    _, classes, said = population(path, speed_limit=25.0)
    car = classes["car"]
    variance = math.log1p(0.1**2)
    assert car.log_covariance[0][0] == pytest.approx(variance)
    assert car.log_mean["desired_speed"] == pytest.approx(math.log(27.5) - variance / 2)
    assert {one.what: one.where for one in said}["speedFactor"] == "desired_speed"


def test_bounds_of_a_distribution_narrow_it(write):
    path = write('speedFactor="normc(1,0.5,0.9,1.2)" maxSpeed="60"', 'speedFactor="normc(1,0.1,0.2,2)" maxSpeed="60"')
    (narrow, wide) = read_types(path)
    # 2000 vehicles of SUMO with the first factor: mean 1.0504, standard deviation 0.0853.
    assert narrow.number("speedFactor") == pytest.approx((1.0504, 0.0853), abs=0.005)
    assert wide.number("speedFactor") == pytest.approx((1.0, 0.1), rel=1e-9)
    (half,) = read_types(write('speedFactor="normc(1,0.3,1)" maxSpeed="60"'))
    assert half.number("speedFactor")[0] == pytest.approx(1 + 0.3 * math.sqrt(2 / math.pi))
    for text, code in (("normc(2,0.1,0.5,1)", "mean-outside"), ("normc(1,0.1,a,2)", "not-a-number")):
        with refused(code):
            read_types(write(f'speedFactor="{text}" maxSpeed="60"'))[0].number("speedFactor")


def test_what_the_file_leaves_open_is_sumos_default_and_said(write):
    _, classes, said = population(
        write('carFollowModel="IDM" vClass="truck" maxSpeed="25"', 'carFollowModel="IDM" maxSpeed="33"')
    )
    assert math.exp(classes["truck"].log_mean["max_accel"]) == pytest.approx(1.3)
    assert math.exp(classes["car"].log_mean["max_accel"]) == pytest.approx(2.6)
    assert classes["truck"].length == pytest.approx(7.1)
    remarks = {one.what: one.remark for one in said}
    assert (remarks["maxSpeed"], remarks["accel"]) == ("", "SUMO's default for 2 of 2 types")


def test_attributes_without_counterpart_are_listed(write):
    path = write('maxSpeed="30" sigma="0.5" color="red" emergencyDecel="9" actionStepLength="0.8"')
    name, _, said = population(path)
    assert name == "krauss"
    assert {one.what for one in said if one.where is None} == {"sigma", "color", "actionStepLength"}


def test_terms_of_eidm_that_act_are_listed_even_if_the_file_leaves_them_to_sumo(write):
    path = write('carFollowModel="EIDM" maxSpeed="30" minGap="2" sigmagap="0" treaction="0" ccoolness="0.9"')
    name, classes, said = population(path)
    assert name == "improved_idm"
    assert math.exp(classes["car"].log_mean["jam_gap"]) == pytest.approx(2.3), "SUMO keeps .3 m more"
    assert {one.what for one in said if one.where is None} == {"ccoolness", "sigmaleader", "sigmaerror"}


def test_cruise_control_is_read_where_its_modes_are_one(write):
    same = f'carFollowModel="ACC" maxSpeed="30" speedControlGain="-0.4" {GAINS}'
    name, classes, _ = population(write(same))
    assert name == "constant_time_headway"
    assert math.exp(classes["car"].log_mean["speed_gain"]) == pytest.approx(0.4)
    with refused("gains-differ", value="0.1"):
        population(write(same.replace('gapClosingControlGainSpace="0.1"', 'gapClosingControlGainSpace="0.04"')))


@pytest.mark.parametrize(
    ("types", "code", "key"),
    [
        (['carFollowModel="W99" maxSpeed="30"'], "equation-unknown-here", "vType t0, carFollowModel"),
        (['maxSpeed="30"', 'carFollowModel="IDM" maxSpeed="30"'], "models-several", "vType t0, carFollowModel"),
        (['maxSpeed="30" tau="fast"'], "not-a-number", "vType t0, tau"),
        (['maxSpeed="30" tau="nan"'], "not-a-number", "vType t0, tau"),
        (['maxSpeed="30" probability="-1"'], "out-of-range", "vType t0, probability"),
        (['maxSpeed="30" minGap="0"'], "out-of-range", "vType t0, minGap"),
        (['maxSpeed="30" vClass="tram"'], "vehicle-class-unknown", "vType t0, vClass"),
        (['maxSpeed="30" vClass="bus"'], "cars-missing", "vType t0, vClass"),
        (['tau="1"'], "attribute-missing", "vType t0, maxSpeed"),
        (['maxSpeed="30" carFollowModel="ACC"'], "attribute-missing", "vType t0, gapControlGainSpace"),
    ],
)
def test_types_that_cannot_be_read(write, types, code, key):
    path = write(*types)
    with refused(code, file=str(path), key=key):
        population(path)


def test_files_that_cannot_be_read(write, tmp_path):
    with refused("file-missing", MissingInputError, key="sumo.file"):
        read_types(tmp_path / "nothing.xml")
    with refused("selects-none", key="sumo.types"):
        read_types(write('maxSpeed="30"'), "truck*")
    path = tmp_path / "bad.xml"
    path.write_text("<additional>", encoding="utf-8")
    with refused("not-xml", file=str(path)):
        read_types(path)
    one = '<vTypeDistribution id="{0}"><vType id="{0}_0" maxSpeed="30"/></vTypeDistribution>'
    path.write_text(f"<additional>{one.format('a')}{one.format('b')}</additional>", encoding="utf-8")
    with refused("distributions-several", key="sumo.types"):
        read_types(path)
    assert [one.name for one in read_types(path, "b")] == ["b_0"]


def test_types_that_a_distribution_names_belong_to_it(tmp_path):
    path = tmp_path / "routes.xml"
    types = '<vType id="a" maxSpeed="30"/><vType id="b" maxSpeed="25"/><vType id="c" maxSpeed="20"/>'
    named = '<vTypeDistribution id="mix" vTypes="a b" probabilities="0.9 0.1"/>'
    path.write_text(f"<routes>{types}{named}</routes>", encoding="utf-8")
    assert [(one.name, one.weight) for one in read_types(path, "mix")] == [("a", 0.9), ("b", 0.1)]


def test_the_task_writes_a_model_that_is_read(write, tmp_path, capsys):
    path = write('carFollowModel="IDM" maxSpeed="30" tau="1.4"')
    config = ImportTask(results=ResultsConfig(str(tmp_path)), sumo=SumoFileConfig(str(path)))
    summary = run(config)
    read = read_model(tmp_path / "import" / "model.yaml")
    assert math.exp(read.population["car"].log_mean["time_gap"]) == pytest.approx(1.4)
    assert read.source.data_id.startswith("sumo-")
    assert (summary["n_types"], summary["n_classes"], summary["n_unread"]) == (1, 1, 0)
    assert json.loads((tmp_path / "import" / "summary.json").read_text())["task"] == "import"
    assert len(pd.read_parquet(tmp_path / "import" / "said.parquet")) == summary["n_read"]
    assert "tau" in capsys.readouterr().out


def test_the_task_needs_a_file():
    with refused("key-missing", key="sumo.file"):
        run(ImportTask())
