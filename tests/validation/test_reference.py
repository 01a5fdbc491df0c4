"""highway-env itself, as the reference runs it."""

import dataclasses

import numpy as np
import pytest

from rearl_jax.validation import reference
from rearl_jax.validation.scenarios import SETS

BY_NAME = {chosen.name: chosen for chosen in SETS}


def short(name, n_seconds=2):
    return BY_NAME[name].scenario(0, seed=3, n_seconds=n_seconds)


@pytest.mark.parametrize("name", ["road2", "road10", "env2", "env10", "multi10", "stress2", "edge10", "drivers10"])
def test_scenes_hold_what_the_set_promises(name):
    chosen, scene = BY_NAME[name], reference.simulate(short(name))
    n_vehicles = chosen.n_idm + chosen.n_meta
    assert scene.tracks.x.shape == (31, n_vehicles)
    assert scene.actions.shape == (2, n_vehicles)
    assert scene.start.is_meta.sum() == chosen.n_meta
    assert (scene.actions[:, ~scene.start.is_meta] == reference.IDLE).all()
    assert scene.actions[:, scene.start.is_meta].tolist() == [list(row) for row in short(name).actions]
    moved = scene.tracks.x[-1] - scene.tracks.x[0]
    assert (moved > 10).all()
    for column in ("x", "y", "heading", "speed", "target_lane"):
        np.testing.assert_array_equal(getattr(scene.start, column), getattr(scene.tracks, column)[0])


def test_injected_vehicles_are_placed_as_asked():
    scenario = short("drivers10")
    injection, start = scenario.injection, reference.simulate(scenario).start
    for column in ("x", "y", "heading", "speed", "desired_speed", "timer"):
        assert getattr(start, column).tolist() == list(getattr(injection, column)), column
    assert len(injection.parameters) == 13
    for name, values in injection.parameters:
        assert getattr(start, name).tolist() == list(values), name


def test_the_same_scene_again_is_the_same():
    one, other = (reference.simulate(short("env10")) for _ in range(2))
    np.testing.assert_array_equal(one.tracks.x, other.tracks.x)
    np.testing.assert_array_equal(one.tracks.y, other.tracks.y)
    another = reference.simulate(dataclasses.replace(short("env10"), seed=99))
    assert not np.array_equal(another.start.x, one.start.x)


def test_meta_actions_are_carried_out():
    scenario = short("env10", n_seconds=1)
    (ego,) = np.flatnonzero(reference.simulate(scenario).start.is_meta)
    slower, idle, faster = (
        reference.simulate(dataclasses.replace(scenario, actions=((action,),))) for action in (4, 1, 3)
    )
    assert not faster.tracks.crashed.any()
    assert idle.tracks.speed[-1, ego] == 25.0
    assert slower.tracks.speed[-1, ego] == pytest.approx(20.0, abs=2.0)
    assert faster.tracks.speed[-1, ego] == pytest.approx(30.0, abs=2.0)


def test_results_that_are_no_numbers_are_refused():
    scenario = short("stress2")
    # Without collisions, whose test fails on them in its own way.
    parameters = (("collides", (False, False)),)
    injection = dataclasses.replace(scenario.injection, speed=(float("inf"), 20.0), parameters=parameters)
    with pytest.raises(ValueError, match="finite"), np.errstate(all="ignore"):
        reference.simulate(dataclasses.replace(scenario, injection=injection))


def test_a_scene_without_vehicles_is_named():
    scenario = dataclasses.replace(short("stress10"), injection=None)
    with pytest.raises(ValueError, match="scene 0 of stress10"):
        reference.simulate(scenario)
