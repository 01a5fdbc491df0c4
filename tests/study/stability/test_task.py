"""The task: analysis and simulation agree, what is finished is kept, the report reads the folder."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import ResultsConfig
from rearl_jax.config._schema import finished
from rearl_jax.config.driver import record_of
from rearl_jax.config.evaluation import Variant
from rearl_jax.config.stability import StabilityConfig, StudyStabilityTask
from rearl_jax.models.file import write_model
from rearl_jax.problems import InvalidInputError
from rearl_jax.report.documents import DOCUMENTS
from rearl_jax.report.finished import read_finished
from rearl_jax.study.stability import task
from rearl_jax.study.stability.amplification import amplification_table
from rearl_jax.study.stability.cases import cases_of
from rearl_jax.study.stability.rings import ring_table
from tests.models.drivers import GAIN, model
from tests.refusal import refused

SMALL = StabilityConfig(
    models=("constant_time_headway",),
    speeds=(15.0,),
    frequencies=(0.05, 0.1),
    ring_vehicles=5,
    ring_lengths=(60.0, 100.0),
    ring_seconds=300,
    densities=(30.0,),
    flow_vehicles=5,
    flow_seconds=300,
    queue_vehicles=30,
    scenes=1,
    measured=False,
)


def test_cases_are_the_models_the_driver_or_the_repaired_model(tmp_path):
    usual = StudyStabilityTask()
    assert [case.name for case in cases_of(usual)] == list(usual.stability.models)
    assert cases_of(usual)[-1].desired_speed > 0
    driven = replace(usual, driver=record_of("idm")(time_gap=1.5, time_gap_sd=0.3))
    (case,) = cases_of(driven)
    assert case.name == "idm"
    assert not case.typical.factor.any()
    path = tmp_path / "model.yaml"
    write_model(path, model(GAIN))
    (repaired,) = cases_of(replace(usual, model=str(path)))
    assert repaired.beyond_analysis == (GAIN.name,)
    assert len(repaired.typical.shares) == 0
    with refused("drivers-twice", key=f"model={path}"):
        finished(replace(driven, model=str(path)))
    with refused("out-of-range", key="variant"):
        finished(replace(usual, variant=Variant.all))


def test_platoons_amplify_as_the_analysis_says():
    (case,) = cases_of(StudyStabilityTask(stability=SMALL))
    table = amplification_table(case, SMALL)
    np.testing.assert_allclose(table["simulated"], table["analysis"], rtol=1e-5)
    assert table["analysis"].nunique() == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", StabilityConfig().models)
def test_waves_appear_on_rings_as_the_analysis_says(name):
    options = StabilityConfig(models=(name,))
    (case,) = cases_of(StudyStabilityTask(stability=options))
    table = ring_table(case, options)
    assert table["length"].iloc[0] == 230.0
    assert table["agree"].all()


@pytest.mark.thorough
def test_a_study_is_written_kept_and_reported(tmp_path, monkeypatch):
    config = StudyStabilityTask(results=ResultsConfig(str(tmp_path)), stability=SMALL)
    summary = task.run(config)
    folder = tmp_path / "study_stability"
    assert summary["n_models"] == 1
    assert summary["n_bands"] == 0
    assert summary["largest_difference"] < 1e-4
    assert summary["n_agree"] == summary["n_rings"] > 0
    (verdict,) = json.loads((folder / "verdict.json").read_text())
    assert (verdict["model"], verdict["recording_collides"], verdict["statements"]) == (SMALL.models[0], None, [])
    flow = pd.read_parquet(folder / "flow.parquet")
    np.testing.assert_allclose(flow["flow"], 3.6 * flow["density"] * flow["speed"])
    assert (folder / "fundamental_diagram.png").stat().st_size > 1000
    study = read_finished(str(tmp_path), "study_stability")
    assert DOCUMENTS["study stability"](study).verdict in (folder / "page.html").read_text()
    content = (folder / "verdict.json").read_text()
    for damaged in ("3", "[3]", '[{"model": "idm"}]'):
        (folder / "verdict.json").write_text(damaged)
        with pytest.raises(InvalidInputError):
            DOCUMENTS["study stability"](study)
    (folder / "verdict.json").write_text(content)

    monkeypatch.setattr(task, "flow_table", None)  # would fail if called
    (folder / "summary.json").unlink()
    assert task.run(config) == summary
