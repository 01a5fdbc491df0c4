"""The core against highway-env: seven scenes of 12 s that the worker processes have run."""

import dataclasses
import functools

import numpy as np
import pytest

from rearl_jax.validation import simulation
from rearl_jax.validation.comparison import aborts, agrees, compare
from rearl_jax.validation.records import stack
from rearl_jax.validation.scenarios import SETS

BY_NAME = {chosen.name: chosen for chosen in SETS}
LEAST = {"stress10": (15, 1, 3), "multi10": (70, 1, 2), "drivers10": (15, 1, 0)}
"""Lane changes, lane changes broken off and crashed vehicles that make a comparison worth something, by set."""


@pytest.fixture(scope="module")
def simulated(recorded, jobs):
    """The tracks of the core, by set and type."""

    @functools.cache
    def run(name, dtype):
        return simulation.simulate([recorded[job] for job in jobs[name]], simulation.model_of(BY_NAME[name]), dtype)

    return run


@pytest.fixture(scope="module")
def batches(recorded, jobs):
    return {name: stack([recorded[job] for job in part]) for name, part in jobs.items()}


@pytest.mark.parametrize("name", LEAST)
def test_something_happens_in_the_scenes(batches, name):
    batch = batches[name]
    lane_changes, broken_off, crashed = LEAST[name]
    assert (batch.tracks.lane[1:] != batch.tracks.lane[:-1]).sum() >= lane_changes
    assert aborts(batch.tracks, batch.start.is_meta).sum() >= broken_off
    assert batch.tracks.crashed[-1].sum() >= crashed


@pytest.mark.parametrize(
    "name", ["drivers10", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("stress10", "multi10"))]
)
def test_the_core_agrees_in_double_precision(batches, simulated, name):
    tracks = simulated(name, np.float64)
    assert tracks.x.dtype == np.float64
    found = compare(batches[name].tracks, tracks)
    assert found.changed.sum() >= LEAST[name][0]
    assert found.errors["position"].max() < 1e-9
    assert found.errors["speed"].max() < 1e-9
    assert found.errors["heading"].max() < 1e-9
    np.testing.assert_array_equal(found.changed_alike, found.changed_either)
    assert agrees(found, tolerance=1e-9, only_before_contact=False).all()


def test_the_core_agrees_in_single_precision_before_contact(batches, simulated):
    tracks = simulated("stress10", np.float32)
    assert tracks.x.dtype == np.float32
    found = compare(batches["stress10"].tracks, tracks)
    assert 1e-9 < found.errors["position"].max()
    assert (found.contact < 181).any()
    assert agrees(found, tolerance=2e-3, only_before_contact=True).all()


@pytest.mark.parametrize("column", ["speed", "desired_speed", "accel_exponent", "timer", "politeness"])
def test_a_wrong_start_is_found(recorded, jobs, column):
    scenes = [recorded[job] for job in jobs["drivers10"]]
    model = simulation.model_of(BY_NAME["drivers10"])
    wrong = [
        dataclasses.replace(scene, start=dataclasses.replace(scene.start, **{column: getattr(scene.start, column) + 1}))
        for scene in scenes
    ]
    found = compare(stack(scenes).tracks, simulation.simulate(wrong, model, np.float64))
    assert not agrees(found, tolerance=1e-9, only_before_contact=False).all()


def test_meta_actions_reach_the_core(recorded, jobs):
    scenes = [recorded[job] for job in jobs["multi10"]]
    idle = [dataclasses.replace(scene, actions=np.ones_like(scene.actions)) for scene in scenes]
    assert not np.array_equal(idle[0].actions, scenes[0].actions)
    found = compare(
        stack(scenes).tracks, simulation.simulate(idle, simulation.model_of(BY_NAME["multi10"]), np.float64)
    )
    assert not agrees(found, tolerance=1e-9, only_before_contact=False).any()


def test_a_scene_does_not_depend_on_its_batch(recorded, jobs, simulated):
    alone = simulation.simulate([recorded[jobs["stress10"][1]]], simulation.model_of(BY_NAME["stress10"]), np.float64)
    np.testing.assert_array_equal(alone.x[..., 0], simulated("stress10", np.float64).x[..., 1])


def test_results_of_the_core_that_are_no_numbers_are_refused(recorded, jobs):
    scene = recorded[jobs["stress10"][0]]
    max_accel = scene.start.max_accel.copy()
    max_accel[4] = np.nan
    broken = dataclasses.replace(scene, start=dataclasses.replace(scene.start, max_accel=max_accel))
    with pytest.raises(ValueError, match="the core's .* is not finite in float64"):
        simulation.simulate([broken], simulation.model_of(BY_NAME["stress10"]), np.float64)


def test_a_batch_fills_whole_vectors():
    for n_vehicles in (2, 10, 15, 30, 60):
        assert simulation.batch_width(n_vehicles) % simulation.VECTOR == 0
    assert simulation.batch_width(2) >= simulation.batch_width(60) > 0
