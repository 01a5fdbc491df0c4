"""The core against highway-env: seven scenes of 12 s that the worker processes have run."""

import dataclasses

import numpy as np
import pytest

from rearl_jax.validation import simulation
from rearl_jax.validation.comparison import aborts, compare, first_disagreement
from rearl_jax.validation.records import stack
from rearl_jax.validation.scenarios import SETS

BY_NAME = {chosen.name: chosen for chosen in SETS}
LEAST = {"stress10": (15, 1, 3), "multi10": (70, 1, 2), "drivers10": (15, 1, 0)}
"""Lane changes, lane changes broken off and crashed vehicles that make a comparison worth something, by set."""


@pytest.fixture(scope="module")
def scenes(recorded, jobs):
    """highway-env's results of the scenes, by set."""
    return {name: [recorded[job] for job in part] for name, part in jobs.items()}


def simulated(scenes, name):
    """The tracks of the core. float32, and the set stress10, are compared in `test_task`."""
    return simulation.simulate(scenes, simulation.model_of(BY_NAME[name]), np.float64)


def agrees(found):
    """Mask of the scenes that agree at all ticks."""
    return ~first_disagreement(found, tolerance=1e-9, only_before_contact=False)[0]


def changed(scene, **columns):
    """The scene with another start."""
    return dataclasses.replace(scene, start=dataclasses.replace(scene.start, **columns))


@pytest.mark.parametrize("name", LEAST)
def test_something_happens_in_the_scenes(scenes, name):
    batch = stack(scenes[name])
    lane_changes, broken_off, crashed = LEAST[name]
    assert (batch.tracks.lane[1:] != batch.tracks.lane[:-1]).sum() >= lane_changes
    assert aborts(batch.tracks, batch.start.is_meta).sum() >= broken_off
    assert batch.tracks.crashed[-1].sum() >= crashed


@pytest.mark.parametrize("name", ["drivers10", pytest.param("multi10", marks=pytest.mark.thorough)])
def test_the_core_agrees_in_double_precision(scenes, name):
    tracks = simulated(scenes[name], name)
    assert tracks.x.dtype == np.float64
    found = compare(stack(scenes[name]).tracks, tracks)
    assert found.changed.sum() >= LEAST[name][0]
    assert found.errors["position"].max() < 1e-9
    assert found.errors["speed"].max() < 1e-9
    assert found.errors["heading"].max() < 1e-9
    np.testing.assert_array_equal(found.changed_alike, found.changed_either)
    assert agrees(found).all()


@pytest.mark.parametrize("column", ["speed", "desired_speed", "accel_exponent", "timer", "politeness"])
def test_a_wrong_start_is_found(scenes, column):
    right = scenes["drivers10"]
    wrong = [changed(scene, **{column: getattr(scene.start, column) + 1}) for scene in right]
    found = compare(stack(right).tracks, simulated(wrong, "drivers10"))
    assert not agrees(found).all()


@pytest.mark.thorough
def test_meta_actions_reach_the_core(scenes):
    right = scenes["multi10"]
    idle = [dataclasses.replace(scene, actions=np.ones_like(scene.actions)) for scene in right]
    assert not np.array_equal(idle[0].actions, right[0].actions)
    found = compare(stack(right).tracks, simulated(idle, "multi10"))
    assert not agrees(found).any()


def test_a_scene_does_not_depend_on_its_batch(scenes):
    both = scenes["drivers10"]
    alone = simulated(both[1:], "drivers10")
    np.testing.assert_array_equal(alone.x[..., 0], simulated(both, "drivers10").x[..., 1])


def test_results_of_the_core_that_are_no_numbers_are_refused(scenes):
    scene = scenes["drivers10"][0]
    broken = changed(scene, max_accel=np.where(np.arange(10) == 4, np.nan, scene.start.max_accel))
    with pytest.raises(ValueError, match="not finite"):
        simulated([broken], "drivers10")


def test_a_batch_fills_whole_vectors():
    for n_vehicles in (2, 10, 15, 30, 60):
        assert simulation.batch_size(n_vehicles) % simulation.VECTOR_WIDTH == 0
    assert simulation.batch_size(2) >= simulation.batch_size(60) > 0
