"""The whole task on small generated data: what is planted is found, and everything is written."""

import json

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from rearl_jax.problems import InvalidInputError

pytestmark = pytest.mark.slow  # minutes of compiling


@pytest.fixture(scope="module")
def discovered(folder_of, tmp_path_factory):
    """Verdict and folder of a data set with a grade in it."""
    from rearl_jax.discovery.task import run

    root = tmp_path_factory.mktemp("results")
    config = DiscoverTask(
        study="grade",
        results=ResultsConfig(str(root), resume=True),
        data=DataConfig(format=DataFormat.table, root=str(folder_of("grade", 1.5, n_vehicles=24))),
        discover=DiscoverConfig(replicates=6, draws=200, base=("constant_time_headway",)),
    )
    return run(config), root / "grade", config


def test_a_grade_is_found_and_repaired(discovered):
    verdict, folder, _ = discovered
    assert verdict["verdict"] == "named"
    (effect,) = verdict["effects"]
    assert (effect["name"], effect["kind"]) == ("grade", "road")
    assert effect["confidence"] > 0.9
    push = effect["parameters"]["push"]
    assert push["low"] < -0.525 < push["high"] or push["value"] == pytest.approx(-0.525, rel=0.2)
    error = verdict["error"]
    assert error["after"]["value"] < error["before"]["value"]
    assert error["change"]["high"] < 0
    assert error["floor"]["low"] < error["after"]["high"] < error["before"]["low"]
    assert json.loads((folder / "verdict.json").read_text()) == verdict
    assert [row["name"] for row in verdict["candidates"]][0] == "grade"
    assert any(row["name"] == "reaction_delay" and row["strength"] > 0 for row in verdict["unseen"])
    assert any("too few lane changes" in note for note in verdict["data"]["notes"])
    assert verdict["lane_choice"]["loss"] is None


def test_drivers_of_idm_keep_it_and_a_grade_is_there_whatever_they_follow_by(discovered):
    from rearl_jax.models.file import read_model

    verdict, folder, _ = discovered
    base = verdict["base"]
    assert (base["chosen"], base["differs"]) == ("idm", False)
    assert [row["name"] for row in base["compared"]] == ["idm", "constant_time_headway"]
    assert base["compared"][1]["gain"]["value"] < 0
    assert 0.5 < base["equilibrium_time_gap"]["10"]["value"] < 3.0
    (effect,) = verdict["effects"]
    assert effect["depends_on_base"] == []
    assert read_model(folder / "model.yaml").car_following == "idm"
    table = pd.read_parquet(folder / "base.parquet")
    assert set(table["model"]) == {"idm", "constant_time_headway"}


def test_errors_are_told_under_every_protocol(discovered):
    verdict, folder, _ = discovered
    error = verdict["error"]
    found = error["protocols"]
    assert found["other_runs"] is None  # nobody is known from two runs
    mean = {name: found[name]["gap_rmse"]["mean"] for name in ("population", "first_half", "in_sample")}
    assert mean["population"]["after"]["value"] > mean["first_half"]["after"]["value"]
    assert mean["first_half"]["after"]["value"] > mean["in_sample"]["after"]["value"]
    assert mean["first_half"]["population_share"]["high"] < 0
    assert found["in_sample"]["gap_rmse"]["pooled"]["before"] == error["before"]
    assert error["floor"]["value"] <= error["after"]["value"]
    assert error["explained_share"] is None or 0 <= error["explained_share"] <= 1
    table = pd.read_parquet(folder / "errors.parquet")
    drivers = table.groupby(["model", "protocol"]).size()
    assert (drivers["after"] == drivers["before"]).all()
    assert drivers["after"]["first_half"] == found["first_half"]["n_drivers"]
    assert (drivers["idm"] == drivers["before"]).all()
    assert mean["population"]["idm_share"]["value"] < 0


def test_everything_is_written_and_finite(discovered):
    from rearl_jax.models.file import read_model

    _, folder, _ = discovered
    names = {path.name for path in folder.iterdir()}
    assert {"verdict.json", "model.yaml", "errors.parquet", "candidates.parquet", "drivers.parquet"} <= names
    model = read_model(folder / "model.yaml")
    assert [effect.name for effect in model.effects] == ["grade"]
    assert set(model.population) == set(model.baseline)
    for drivers in model.population.values():
        covariance = np.array(drivers.log_covariance)
        assert np.linalg.eigvalsh(covariance).min() > 0
    assert "NaN" not in (folder / "verdict.json").read_text()


def test_a_finished_study_is_left_alone(discovered):
    from rearl_jax.discovery.task import run

    verdict, folder, config = discovered
    before = (folder / "verdict.json").stat().st_mtime_ns
    assert run(config) == verdict
    assert (folder / "verdict.json").stat().st_mtime_ns == before


def test_the_oracle_reports_an_error_and_nothing_else(discovered, folder_of):
    from dataclasses import replace

    from rearl_jax.discovery.task import run

    verdict, _, config = discovered
    told = run(replace(config, study="oracle", discover=replace(config.discover, oracle="grade")))
    assert told["effects"] == []
    assert told["error"]["oracle"]["value"] == pytest.approx(verdict["error"]["after"]["value"], rel=0.05)
    with pytest.raises(InvalidInputError) as error:
        run(replace(config, study="wrong", discover=replace(config.discover, oracle="magic")))
    assert (error.value.problem.key, error.value.problem.value) == ("discover.oracle", "magic")
