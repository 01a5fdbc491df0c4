"""Pictures of the environments: Gymnasium's modes, and that they show the vehicles."""

from dataclasses import replace

import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from rearl_jax import make_env
from rearl_jax.environments import rendering
from rearl_jax.environments.single import HighwayEnv
from rearl_jax.environments.vector import HighwayVectorEnv
from tests.refusal import refused

CAR, EGO, CRASHED = rendering._CAR, rendering._EGO, rendering._CRASHED


def n_pixels(picture, colour) -> int:
    return int((picture == np.array(colour, np.uint8)).all(axis=-1).sum())


@pytest.fixture(scope="module")
def shown(small):
    env = make_env(**small, render_mode="rgb_array")
    env.reset(seed=0)
    return env


def test_a_picture_shows_the_controlled_vehicle_in_the_middle_and_others(shown):
    shown.reset(seed=0)
    picture = shown.render()
    assert (picture.dtype, picture.ndim, picture.shape[-1]) == (np.uint8, 3, 3)
    assert all(side % 2 == 0 for side in picture.shape[:2])  # as video codecs want
    assert n_pixels(picture, EGO) > 0
    assert n_pixels(picture, CAR) > 0
    columns = np.flatnonzero((picture == np.array(EGO, np.uint8)).all(axis=-1).any(axis=0))
    assert abs(columns.mean() - picture.shape[1] / 2) < 5
    before = picture.copy()
    shown.step(3)
    assert not np.array_equal(shown.render(), before)


def test_a_crash_and_an_absent_vehicle_show(shown):
    shown.reset(seed=0)
    env = shown.unwrapped
    state = env._scenarios.state
    whole = rendering.pictures(state, env.options)[0]
    crashed = replace(state, traffic=replace(state.traffic, crashed=state.traffic.crashed.at[0].set(True)))
    assert n_pixels(whole, CRASHED) == 0
    assert n_pixels(rendering.pictures(crashed, env.options)[0], CRASHED) > 0
    alone = jnp.zeros_like(state.traffic.controller).at[0].set(2)
    absent = replace(state, traffic=replace(state.traffic, controller=alone))
    assert n_pixels(rendering.pictures(absent, env.options)[0], CAR) == 0


def test_gymnasium_finds_nothing_wrong_with_pictures(shown):
    check_env(shown.unwrapped)  # every warning is an error


def test_wrappers_that_need_pictures_work(small):
    env = gymnasium.wrappers.AddRenderObservation(make_env(**small, render_mode="rgb_array"))
    observation, _ = env.reset(seed=0)
    assert observation.dtype == np.uint8
    listed = make_env(**small, render_mode="rgb_array_list")
    listed.reset(seed=0)
    listed.step(1)
    assert len(listed.render()) == 2


def test_no_pictures_without_a_mode(small):
    env = make_env(**small, render_mode=None)
    env.reset(seed=0)
    assert env.render_mode is None
    assert env.unwrapped.render() is None
    assert HighwayVectorEnv(2, **small).render() is None


@pytest.mark.parametrize("mode", ["ansi", "human", ""])
@pytest.mark.parametrize("kind", [HighwayEnv, HighwayVectorEnv])
def test_other_modes_are_refused(small, kind, mode):
    with refused("out-of-range", key="render_mode"):
        kind(**small, render_mode=mode)


@pytest.mark.parametrize("mode", [True, ["rgb_array"], b"rgb_array"])
def test_a_mode_is_a_text(small, mode):
    for number in (None, 2):
        with refused("out-of-range", key="render_mode"):
            make_env(number, **small, render_mode=mode)


def test_a_picture_needs_an_episode(small):
    with pytest.raises(RuntimeError):
        HighwayEnv(**small, render_mode="rgb_array").render()


def test_a_vector_environment_has_a_picture_of_every_scenario(small):
    envs = make_env(num_envs=3, **small, render_mode="rgb_array")
    assert envs.render_mode == "rgb_array"
    envs.reset(seed=0)
    pictures = envs.render()
    assert len(pictures) == 3
    assert not np.array_equal(pictures[0], pictures[1])
    single = make_env(**small, render_mode="rgb_array")
    single.reset(seed=1)
    np.testing.assert_array_equal(pictures[1], single.render())
