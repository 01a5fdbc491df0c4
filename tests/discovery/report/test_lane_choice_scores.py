"""Scores of predicted lane changes against sums worked out by hand, and how they are said."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.claims import Estimate
from rearl_jax.discovery.lane_changes.mobil import UNITS, CalibratedMobil, MobilRule
from rearl_jax.discovery.lane_changes.prediction import PREDICTORS, Prediction
from rearl_jax.discovery.report.lane_choice_scores import prediction_block, prediction_table
from rearl_jax.discovery.report.lane_choice_section import lane_choice_section, significantly_worse
from rearl_jax.discovery.report.repaired import lane_change_values
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.models.file import read_model, write_model
from rearl_jax.models.record import LaneChangeValues
from tests.discovery.lane_changes.made import made
from tests.models.drivers import model

OVER = Resampling(0.9, 300, 0)
N_DRIVERS, EACH = 40, 20


def predicted(sure=0.6, doubtful=0.02, wrong=False):
    """Every driver changes to the left once, which a model foresees or a wrong one takes for unlikely."""
    n = N_DRIVERS * EACH
    changes = np.arange(n) % EACH == 0
    table = made(
        n,
        vehicle=np.repeat(np.arange(N_DRIVERS), EACH),
        side=np.where(np.arange(n) % 2, 1, -1),
        frame=np.arange(n) % EACH // 2,
        changes=changes,
    )
    constant = np.where(table.side < 0, 0.1, 0.001)
    foreseen = np.where(changes != wrong, sure, doubtful)
    chance = {name: foreseen if name == "hazard" else constant for name in PREDICTORS}
    estimates = {name: Estimate(getattr(MobilRule(), name), None, None, unit) for name, unit in UNITS.items()}
    is_predicted = {name: values > constant for name, values in chance.items()}
    return Prediction(table, chance, is_predicted, CalibratedMobil(MobilRule(), estimates), 80, 70, 200, 3)


def test_figures_are_those_of_the_sums():
    block = json.loads(json.dumps(prediction_block(predicted(), OVER), allow_nan=False))
    every = block["strata"]["all"]
    assert (every["changes"], every["opportunities"], every["drivers"]) == (40, 800, 40)
    assert every["seconds"] == pytest.approx(40 * 10 * 0.5)
    hazard, constant = every["models"]["hazard"], every["models"]["base_rate"]
    loss = -(40 * np.log(0.6) + 760 * np.log(0.98)) / 200
    assert hazard["log_loss"]["value"] == pytest.approx(loss)
    assert hazard["less_base_rate"]["value"] == pytest.approx(loss - constant["log_loss"]["value"])
    assert constant["less_base_rate"] == {"value": 0.0, "low": 0.0, "high": 0.0}
    assert constant["balanced_accuracy"]["value"] == 0.5  # never above itself
    # The chance .02 is above the rate on the right, where nobody changes: half of all else is told wrong.
    assert hazard["balanced_accuracy"]["value"] == pytest.approx((1.0 + 360 / 760) / 2)
    assert hazard["expected"] == pytest.approx(40 * 0.6 + 760 * 0.02)
    assert block["refused_share"] == 1.0


def test_what_cannot_be_told_is_null():
    block = prediction_block(predicted(), OVER)
    assert block is not None
    right, mandatory = block["strata"]["right"], block["strata"]["mandatory"]
    assert right["changes"] == 0
    assert right["models"]["hazard"]["balanced_accuracy"] is None
    assert right["models"]["hazard"]["log_loss"]["value"] > 0
    assert mandatory["opportunities"] == 0
    assert mandatory["models"]["hazard"]["log_loss"] is None
    assert prediction_block(None, OVER) is None


def test_the_table_has_a_row_per_driver():
    table = prediction_table(predicted())
    assert table["driver"].tolist() == list(range(N_DRIVERS))
    assert (table["left"] == 1).all()
    assert (table["right"] == 0).all()
    np.testing.assert_allclose(table["seconds"], 5.0)
    np.testing.assert_allclose(table["log_loss_hazard"], -(np.log(0.6) + 19 * np.log(0.98)) / 5)
    np.testing.assert_allclose(table["balanced_accuracy_hazard"], (1.0 + 9 / 19) / 2)


def test_a_model_that_is_surely_worse_than_the_constant_rate_is_named():
    block = prediction_block(predicted(wrong=True), OVER)
    assert block is not None
    assert significantly_worse(block) == ["hazard"]
    section = lane_choice_section({"lane_choice": {"changes": 40, "prediction": block}})
    assert "Significantly worse than the constant rate: calibrated hazard." in section.paragraphs[0]
    good = prediction_block(predicted(), OVER)
    assert good is not None
    assert significantly_worse(good) == []


def test_the_section_has_models_strata_and_parameters():
    section = lane_choice_section({"lane_choice": {"changes": 40, "prediction": prediction_block(predicted(), OVER)}})
    models, losses, accuracies, mobil = section.tables
    assert [row.title for row in models.rows] == list(PREDICTORS.values())
    assert [row.title for row in losses.rows] == [row.title for row in accuracies.rows]
    assert len(mobil.rows) == len(UNITS)
    cells = [cell.value for table in section.tables for row in table.rows for cell in row.cells]
    assert not {"nan", "None"} & set(cells)


def test_where_nothing_is_scored_it_is_said_why():
    section = lane_choice_section({"lane_choice": {"changes": 0, "prediction": None}})
    assert "there are 0" in section.paragraphs[0]
    assert not section.tables
    for old in ({}, {"lane_choice": None}, {"lane_choice": {"changes": 3, "opportunities": 4, "loss": None}}):
        empty = lane_choice_section(old)
        assert (empty.paragraphs, empty.tables, empty.notes) == ((), (), ())


def test_calibrated_parameters_come_back_from_the_model_file(tmp_path):
    rule = MobilRule(0.3, 0.7, 1.5, -0.2, 3600.0, 0.01)
    values = lane_change_values(replace(predicted(), mobil=CalibratedMobil(rule, {})))
    write_model(tmp_path / "model.yaml", replace(model(), lane_changing=values))
    assert read_model(tmp_path / "model.yaml").lane_changing == LaneChangeValues(0.3, 0.7, 1.5, -0.2, 3600.0)
