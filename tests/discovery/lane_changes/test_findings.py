"""Findings in generated recordings, and none in recordings without an effect."""

import json

import pytest

from rearl_jax.blind.traffic import Planted, Scenario, write_dataset
from rearl_jax.blind.traffic.catalogue import LANE_CHOICE
from rearl_jax.blind.traffic.scenario import FREE_CHANGES
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.core.effects import EFFECTS
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.discovery.lane_changes import lane_change_findings
from rearl_jax.discovery.lane_changes.candidates import CANDIDATES
from rearl_jax.discovery.lane_changes.motion import count_changes
from rearl_jax.discovery.lane_changes.prediction import log_loss


def test_candidates_are_effects_of_the_library_in_its_units():
    for candidate in CANDIDATES:
        if candidate.kind == "generic":
            continue
        known = {one.name: one for one in EFFECTS[candidate.name].parameters}
        name, unit = candidate.strength
        assert known[name].unit == unit
        assert known[name].is_strength
        for form in candidate.forms:
            assert all(known[shape].unit == unit for shape, _, unit in form.shape)


@pytest.mark.slow
def test_keep_right_is_named_with_its_strength(lane_findings):
    found = lane_findings
    assert found.n_changes >= 150
    assert [effect.name for effect in found.effects] == ["keep_right"]
    bias = found.effects[0].parameters["bias"]
    assert bias.low is not None
    assert bias.high is not None
    assert bias.low < bias.value < bias.high
    assert bias.value == pytest.approx(0.35, rel=0.25)
    assert found.loss is not None
    assert found.loss.change.value < 0


def test_parts_of_a_verdict_are_plain_and_complete(lane_findings):
    found = lane_findings
    parts = json.loads(json.dumps(found.as_verdict_parts(), allow_nan=False))
    (effect,) = parts["effects"]
    assert set(effect) == {"name", "kind", "parameters", "variables", "confidence", "evidence", "depends_on_base"}
    assert set(effect["parameters"]["bias"]) == {"value", "low", "high", "unit"}
    assert len(parts["candidates"]) == len(CANDIDATES)
    keys = {"name", "kind", "variables", "evidence", "z_score", "gain", "check", "ambiguous", "told_apart_by"}
    assert all(set(row) == keys for row in parts["candidates"])
    assert parts["lane_choice"]["changes"] == found.n_changes
    assert parts["lane_choice"]["loss"]["change"]["value"] < 0
    z_scores = [row["z_score"] for row in parts["candidates"]]
    assert z_scores == sorted(z_scores, reverse=True)


@pytest.mark.slow
def test_nothing_is_named_in_a_control(recordings_of):
    found = lane_change_findings(recordings_of(None, **{**FREE_CHANGES, "n_vehicles": 150, "duration": 75.0}))
    assert found.n_changes >= 150
    assert found.effects == ()
    assert found.loss is not None
    assert found.loss.change.value == 0.0


def test_too_few_changes_are_said(recordings_of):
    found = lane_change_findings(recordings_of())
    lanes = {"changes": found.n_changes, "opportunities": found.n_opportunities, "loss": None}
    assert found.as_verdict_parts() == {"effects": [], "candidates": [], "lane_choice": lanes}
    assert 0 < found.n_changes < found.n_opportunities
    assert "could not have been detected here" in found.words
    recorded = sum(count_changes(recording.table) for recording in recordings_of())
    assert f"too few lane changes: {recorded}, 150 are needed" in found.words


def test_without_changes_nothing_is_looked_at(recording):
    found = lane_change_findings([recording([(0.0, 20.0, 0, "car"), (50.0, 20.0, 0, "car")])])
    assert (found.n_changes, found.n_opportunities, found.prediction) == (0, 0, None)
    assert "too few lane changes: 0" in found.words


def test_changes_of_drivers_who_keep_right_are_predicted_and_mobil_knows_it(lane_findings):
    found = lane_findings.prediction
    assert found is not None
    changes = found.table.changes
    loss = {name: log_loss(chance, changes).mean() for name, chance in found.chance.items()}
    assert loss["hazard"] < loss["base_rate"]
    assert loss["mobil_calibrated"] < loss["mobil_rates"] < loss["base_rate"]
    assert found.mobil.rule.bias == pytest.approx(0.35, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", LANE_CHOICE)
def test_each_effect_is_named_alone(tmp_path, name):
    truth = write_dataset(tmp_path, Scenario(52, (Planted(name),), **FREE_CHANGES))
    recordings = iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path)))
    found = lane_change_findings(list(recordings))
    assert found.n_changes >= 300
    assert [effect.name for effect in found.effects] == [name]
    for parameter, value in truth["planted"][0]["parameters"].items():
        assert found.effects[0].parameters[parameter].value == pytest.approx(value, rel=0.25)
