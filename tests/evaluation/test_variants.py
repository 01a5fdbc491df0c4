"""`rearl evaluate model=...`: four rows from the same initial states, their interventions, and what names the model."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import EvaluateTask, ResultsConfig
from rearl_jax.config.evaluation import EvaluationConfig, Method, Variant
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.core.rollout import Frames
from rearl_jax.evaluation import task
from rearl_jax.evaluation.extras import Extra
from rearl_jax.evaluation.runner import Evaluation, Sample
from rearl_jax.evaluation.scores import Scores
from rearl_jax.evaluation.tables import summary_rows
from rearl_jax.evaluation.traffic import inputs_id, is_cooperative, model_notes, population_of
from rearl_jax.models.file import model_id, write_model
from tests.models.drivers import GAIN, MOBIL, model
from tests.refusal import refused


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    write_model(path, model(GAIN))
    return str(path)


def config_of(path, **changes):
    return EvaluateTask(model=path, eval=EvaluationConfig(n_runs=1), **changes)


def test_identity_is_that_of_data_and_model(path, tmp_path):
    before = inputs_id(config_of(path))
    assert before.endswith(f", {model_id(path)}")
    assert inputs_id(config_of(None)) == before.partition(",")[0]
    changed = tmp_path / "model.yaml"
    write_model(changed, model())
    assert inputs_id(config_of(str(changed))) != before


def test_drivers_of_their_own_are_refused(path):
    for method in (Method.ppo, Method.critical):
        with refused("drivers-of-method", key="model"):
            population_of(config_of(path, method=method, variant=Variant.repaired))
    with refused("out-of-range", key="variant"):
        population_of(config_of(path))
    assert population_of(config_of(None)) is None


def test_variants_differ_by_drivers_and_effects_alone(path):
    with_effects = population_of(config_of(path, variant=Variant.repaired))
    without = population_of(config_of(path, variant=Variant.calibrated))
    assert [effect.name for effect in with_effects.effects] == ["leader_acceleration"]
    assert without.effects == ()
    np.testing.assert_array_equal(with_effects.length, without.length)
    assert (with_effects.median != without.median).any()


@pytest.mark.parametrize("variant", [Variant.repaired, Variant.calibrated])
def test_lanes_are_changed_as_the_file_says_unless_keys_do(tmp_path, path, variant):
    file = tmp_path / "model.yaml"
    write_model(file, replace(model(GAIN), lane_changing=MOBIL))
    config = config_of(str(file), variant=variant)
    own = population_of(config).lane_changing
    assert (own.gain_threshold, own.delay) == (pytest.approx(MOBIL.gain_threshold), MOBIL.delay)
    assert is_cooperative(config)
    assert any("politeness 0.3" in note for note in model_notes(config))
    keys = replace(config, mobil=MobilConfig(gain_threshold=0.9))
    assert population_of(keys).lane_changing.gain_threshold == pytest.approx(0.9)
    assert not is_cooperative(keys)
    assert population_of(config_of(path, variant=variant)).lane_changing is None
    assert not is_cooperative(config_of(path, variant=variant))


def test_the_questions_to_a_language_model_belong_to_a_row_that_asks(scenes):
    names, figures = ("base", "base_effect", "rearl", "rearl_effect", "real"), {"questions": 7}
    rows = [Scores(name, np.array([2]), np.zeros(1, int), {}, {}) for name in names]
    frames = Frames(*[jnp.zeros((12, 4), kind) for kind in ("f4",) * 5 + ("i4", bool)])
    sample = Sample(2, frames, np.full(4, 5.0), None, np.zeros(32, np.int64))
    extras = (Extra(summary=figures),)
    evaluation = Evaluation(config_of("m"), scenes, np.array([2]), rows, sample, "rearl_effect", extras=extras)
    questions = {row["method"]: row["questions"] for row in summary_rows(evaluation, {})}
    assert questions == dict.fromkeys(names) | {"rearl_effect": 7}


@pytest.mark.slow  # four programs
def test_four_rows_side_by_side(path, tmp_path, capsys):
    config = config_of(path, results=ResultsConfig(root=str(tmp_path)))
    rows = task.run(config)["rows"]
    names = ["base", "base_effect", "rearl", "rearl_effect"]
    assert [row["method"] for row in rows][:4] == names
    folder = tmp_path / "evaluate"
    printed = " ".join(capsys.readouterr().out.split())
    assert "rearl + effect: " in printed
    assert "leader_acceleration (gain 0.5, reach 60)" in printed

    runs = pd.read_parquet(folder / "runs.parquet")
    assert set(runs["method"]) >= set(names)
    decisions = pd.read_parquet(folder / "decisions.parquet")
    for row in rows[2:4]:
        own = decisions[decisions["method"] == row["method"]]
        accepted = own[["left", "keep", "right", "faster", "slower"]].to_numpy().sum()
        assert row["interventions"] == accepted > 0
        assert row["triggered_seconds"] == own["triggered"].sum()
        minutes = len(own) * 10 / 60
        assert row["interventions_per_vehicle_minute"] == pytest.approx(accepted / minutes)
    assert rows[0]["interventions"] is None
    # The same initial states: nothing but the drivers' reactions differs in the first second.
    frames = pd.read_parquet(folder / "frames.parquet").query("frame == 0").set_index(["method", "scene_id"])
    spacing = [frames.loc[name, "spacing"].to_numpy(float) for name in names]
    assert np.abs(spacing[0] - spacing[1]).max() < 1.0
    np.testing.assert_array_equal(spacing[0], spacing[2])
    np.testing.assert_array_equal(spacing[1], spacing[3])
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "rearl + effect against" in page
    assert "which are not marked here" in page

    again = replace(config, results=ResultsConfig(root=str(tmp_path), resume=True))
    stored = json.loads((folder / "summary.json").read_text())
    assert task.run(again)["rows"] == stored
