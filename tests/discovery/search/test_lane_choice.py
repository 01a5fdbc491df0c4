"""Findings on lane choice in the verdict, in the repaired model, and with smoothed positions."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config import DiscoverConfig
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import nearest_lane
from rearl_jax.discovery.claims import Claim, Estimate
from rearl_jax.discovery.lane_changes import KnownDrivers, lane_change_findings
from rearl_jax.discovery.lane_changes.candidates import CANDIDATES
from rearl_jax.discovery.lane_changes.findings import LaneChangeFindings
from rearl_jax.discovery.lane_changes.opportunities import opportunities
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.read.reading import measure
from rearl_jax.discovery.read.smoothing import thinned
from rearl_jax.discovery.read.split import split_drivers
from rearl_jax.discovery.report.repaired import lane_effect_values
from rearl_jax.discovery.search.lane_choice import lane_choice, with_lane_choice
from rearl_jax.models.file import read_model, write_model
from rearl_jax.models.population import population_of_model
from rearl_jax.models.traffic import populate
from tests.discovery.search.searches import search_that_added
from tests.models.drivers import model

ROAD = TrafficModel(n_lanes=3, speed_limit=None)
BIAS = {"bias": Estimate(0.35, 0.3, 0.4, "m/s^2")}
KEEP_RIGHT = Claim("keep_right", "driver", BIAS, ("side",), 0.98, 90.0)


@pytest.fixture(scope="module")
def search(solver, calibrated):
    """A search that has calibrated drivers and nothing more."""
    return search_that_added(solver, calibrated)


def parts_of(recordings, *findings):
    data = measure(list(map(thinned, recordings)))
    kept = data.select(np.flatnonzero(data.driver % 20 == 0))  # few are enough, and faster
    return Parts("id", True, (), list(findings), *split_drivers(kept), ())


def test_vehicles_have_the_numbers_that_measure_gives_them(recordings_of):
    uneven = [*recordings_of(n_vehicles=15, duration=40.0)[:1], *recordings_of(n_vehicles=60, duration=40.0)[:2]]
    data, table = measure(list(map(thinned, uneven))), opportunities(uneven, KnownDrivers.of([]))[0]
    both, rows, pieces = np.intersect1d(table.vehicle, data.vehicle, return_indices=True)
    assert len(both) > 60
    np.testing.assert_array_equal(table.recording[rows], data.recording[pieces])
    np.testing.assert_array_equal(table.is_truck[rows], data.is_truck[pieces])
    assert table.is_truck[rows].any()
    assert {1, 2} <= set(table.recording[rows])  # whose numbers begin where those of another recording end


@pytest.mark.thorough
def test_drivers_are_known_and_split_as_they_were_for_car_following(keep_right, solver, search, monkeypatch):
    asked = []

    def record(*arguments):
        asked.append(arguments)
        return lane_change_findings(*arguments)

    monkeypatch.setattr("rearl_jax.discovery.search.lane_choice.lane_change_findings", record)
    parts = parts_of(keep_right)
    found = replace(search, checked=parts.checked)
    lanes = lane_choice(solver, found, parts, keep_right, DiscoverConfig(confidence=0.8, seed=3))
    ((_, known, split, confidence, seed),) = asked
    assert (confidence, seed) == (0.8, 3)
    for part, vehicles in zip((parts.fitted, parts.checked, parts.reported), split, strict=True):
        np.testing.assert_array_equal(part.vehicle, vehicles)
    assert known.is_known(parts.checked.vehicle).all()
    assert known.is_known(search.first.state.data.vehicle).all()
    assert [effect.name for effect in lanes.effects] == ["keep_right"]


def test_nobody_is_calibrated_for_a_few_changes(recordings_of, solver, search, monkeypatch):
    monkeypatch.setattr("rearl_jax.discovery.search.lane_choice.recalibrated", None)  # would be called
    few = recordings_of()[:1]
    lanes = lane_choice(solver, search, parts_of(few), few, DiscoverConfig())
    assert "too few lane changes: " in lanes.words
    assert (lanes.effects, lanes.candidates, lanes.prediction) == ((), (), None)
    assert 0 < lanes.n_changes < 30


def verdict(word, *effects):
    return {"verdict": word, "effects": list(effects), "candidates": [{"name": "grade"}], "data": {"notes": ["a note"]}}


def lanes_with(*effects):
    return LaneChangeFindings(400, 9000, "some words", effects)


@pytest.mark.thorough  # the traffic takes seconds
def test_findings_go_behind_those_of_car_following(lane_findings):
    whole = with_lane_choice(verdict("named", {"name": "grade"}), lane_findings)
    assert whole["verdict"] == "named"
    assert [effect["name"] for effect in whole["effects"]] == ["grade", "keep_right"]
    assert [row["name"] for row in whole["candidates"]][:2] == ["grade", "keep_right"]
    assert len(whole["candidates"]) == 1 + len(CANDIDATES)
    assert whole["data"]["notes"] == ["a note", lane_findings.words]
    assert whole["lane_choice"]["changes"] == lane_findings.n_changes >= 150


@pytest.mark.parametrize(
    ("before", "effects", "after"),
    [
        ("nothing", (), "nothing"),
        ("nothing", (KEEP_RIGHT,), "named"),
        ("artefact", (KEEP_RIGHT,), "artefact"),
        ("unexplained", (KEEP_RIGHT,), "unexplained"),
    ],
)
def test_a_name_in_lane_changing_is_a_name(before, effects, after):
    assert with_lane_choice(verdict(before), lanes_with(*effects))["verdict"] == after


@pytest.mark.parametrize("candidate", [one for one in CANDIDATES if one.kind == "driver"], ids=lambda one: one.name)
def test_every_effect_that_can_be_found_can_be_written(candidate, tmp_path):
    name, unit = candidate.strength
    for form in candidate.forms:
        shape = {key: Estimate(value, None, None, its) for key, value, its in form.shape}
        for value in (candidate.low, candidate.high):
            strength = {name: Estimate(value, None, None, unit)}
            effect = Claim(candidate.name, "driver", strength | shape, (), 0.9, 30.0)
            write_model(tmp_path / "model.yaml", model(lane_effect_values(effect)))
            (read,) = read_model(tmp_path / "model.yaml").effects
            assert set(read.parameters) == {one.name for one in EFFECTS[candidate.name].parameters}
            assert all(read.parameters[key] == estimate.value for key, estimate in shape.items())


@pytest.mark.slow
def test_what_was_found_changes_the_simulation(lane_findings, tmp_path):
    (effect,) = lane_findings.effects
    write_model(tmp_path / "model.yaml", model(lane_effect_values(effect)))
    repaired = read_model(tmp_path / "model.yaml")
    (read,) = repaired.effects
    assert (read.name, read.parameters["bias"]) == ("keep_right", effect.parameters["bias"].value)
    off = replace(repaired, effects=[replace(read, parameters={"bias": 0.0})])
    keys = jax.vmap(jax.random.key)(jnp.arange(64))

    @jax.jit
    def lanes(numbers):
        state, drivers = spawn(keys, ROAD, n_vehicles=10, dtype=jnp.dtype("float64"))
        state, drivers = populate(state, drivers, keys, numbers, ROAD)
        return nearest_lane(state.y, ROAD), nearest_lane(rollout(state, drivers, ROAD, n_seconds=20)[0].y, ROAD)

    numbers = (population_of_model(one, np.dtype("float64"), with_effects=True) for one in (repaired, off))
    (start, kept), (same, free) = (jax.tree.map(np.asarray, lanes(one)) for one in numbers)
    np.testing.assert_array_equal(start, same)
    assert (free != start).mean() > 0.02  # lanes are changed at all
    assert kept.mean() > free.mean() + 0.1  # lane 2 is the right one
