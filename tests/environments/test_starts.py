"""Episodes that begin with measured scenes."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax import FunctionalHighway, make_env
from rearl_jax.core.state import Controller
from rearl_jax.environments.highway import HighwayOptions
from rearl_jax.environments.starts import with_scenes
from rearl_jax.problems import InvalidInputError


def test_every_vehicle_of_every_scene_is_once_the_controlled_one(us101):
    options, starts = with_scenes(HighwayOptions(), us101)
    cases = starts.state
    n_slots = us101.n_slots
    assert cases.x.shape == (n_slots, len(us101) * n_slots)
    assert options.model.n_lanes == us101.lane[:, 0].max() + 1
    for case in (0, 7, len(us101) * n_slots - 1):
        scene, slot = divmod(case, n_slots)
        order = np.roll(np.arange(n_slots), -slot)
        position = us101.position[scene, 0]
        np.testing.assert_allclose(cases.x[:, case], (position - position.min())[order], atol=1e-3)
        np.testing.assert_allclose(cases.speed[:, case], us101.scaled_speed[scene, 0][order], atol=1e-5)
        np.testing.assert_array_equal(cases.target_lane[:, case], us101.lane[scene, 0][order])
    controller = np.asarray(cases.controller)
    assert (controller[0] == Controller.META).all()
    assert (controller[1:] == Controller.IDM).all()
    assert set(np.unique(cases.desired_speed[0])) <= {20.0, 25.0, 30.0}
    assert (cases.desired_speed[1:] >= cases.speed[1:]).all()
    assert float(cases.desired_speed[1:].max()) <= us101.scaled_speed.max() + 1e-5
    assert (np.diff(np.take_along_axis(np.asarray(cases.x), np.asarray(cases.order), 0), axis=0) >= 0).all()


@pytest.mark.thorough  # a program of its own
def test_environments_begin_with_them(us101):
    cases = with_scenes(HighwayOptions(), us101)[1].state
    known = {(round(float(v), 3), round(float(y), 3)) for v, y in zip(cases.speed[0], cases.y[0], strict=True)}
    env = make_env(scenes=us101)
    n_lanes = env.unwrapped.options.n_lanes
    drawn = set()
    for seed in range(20):
        observation, info = env.reset(seed=seed)
        drawn.add((round(info["speed"], 3), round(float(observation[0, 2]) * 4 * n_lanes, 3)))
    assert drawn <= known
    assert len(drawn) > 10


def test_the_functional_environment_begins_with_them(us101):
    cases = with_scenes(HighwayOptions(), us101)[1].state
    np.testing.assert_array_equal(FunctionalHighway(us101).default_params.starts.state.x, cases.x)


def test_a_road_with_too_few_lanes_is_refused(us101):
    with pytest.raises(InvalidInputError) as caught:
        make_env(scenes=us101, n_lanes=2)
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", "core.n_lanes")


def test_unknown_lanes_are_refused(us101):
    lane = us101.lane.copy()
    lane[0, 0, 0] = -1
    with pytest.raises(InvalidInputError) as caught:
        make_env(scenes=replace(us101, lane=lane))
    assert (caught.value.code, caught.value.problem.key) == ("lane-missing", "init.source")
