"""The Gymnasium environment: what its ecosystem checks, and what its options do."""

import subprocess
import sys
from functools import partial

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from rearl_jax import FunctionalHighway, MetaAction, make_env
from rearl_jax.environments.arguments import check_reset_options
from rearl_jax.environments.highway import HighwayOptions
from rearl_jax.environments.single import HighwayEnv
from rearl_jax.environments.starts import options_of
from rearl_jax.problems import InvalidInputError
from tests.refusal import refused


@pytest.fixture(scope="module")
def env(small):
    return make_env(**small)


def test_gymnasium_finds_nothing_wrong(env):
    assert env.spec is not None
    assert env.spec.id == "rearl_jax/Highway-v0"
    check_env(env.unwrapped)  # every warning is an error


def test_an_episode_ends_by_a_crash_or_after_its_duration(env):
    ends = set()
    for seed in range(12):
        env.reset(seed=seed)
        for second in range(1, 7):
            observation, reward, terminated, truncated, info = env.step(3)
            assert env.observation_space.contains(observation)
            assert 0 <= reward <= 1
            assert truncated == (second == 6)
            assert info == {"speed": pytest.approx(observation[0, 3] * 80, abs=2), "crashed": terminated}
            if terminated or truncated:
                break
        ends.add((terminated, truncated))
    assert {(True, False), (False, True)} <= ends


def test_episodes_follow_from_the_seed_and_differ_from_each_other(env):
    first, later = env.reset(seed=3)[0], env.reset()[0]
    assert not np.array_equal(first, later)
    np.testing.assert_array_equal(env.reset(seed=3)[0], first)
    np.testing.assert_array_equal(env.reset()[0], later)
    assert not np.array_equal(env.reset(seed=4)[0], first)


def test_actions_do_what_they_say(env):
    def after(action):
        env.reset(seed=8)
        return env.step(action)

    by_action = [after(action) for action in range(5)]
    speeds = [info["speed"] for *_, info in by_action]
    assert speeds[3] > speeds[1] + 2 > speeds[4] + 4
    across = [observation[0, 2] for observation, *_ in by_action]
    assert across[0] < across[1] < across[2]


@pytest.mark.parametrize(
    "kind", [jax.numpy.int32, np.int64, np.uint8, np.array, lambda n: np.array([n]), jax.numpy.array, MetaAction, int]
)
def test_an_action_is_a_number_of_any_library(env, kind):
    env.reset(seed=8)
    expected = env.step(4)
    env.reset(seed=8)
    found = env.step(kind(4))
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1:] == expected[1:]


@pytest.mark.parametrize(
    "action",
    [
        5,
        -1,
        1.5,
        None,
        "1",
        [1, 2],
        [[1], [1, 2]],
        True,
        np.array(1, object),
        jax.numpy.float32(1),
        jax.numpy.int32(5),
        jax.numpy.array([1, 2]),
    ],
)
def test_no_other_actions(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="is none of 0 to 4"):
        env.unwrapped.step(action)


def test_a_step_needs_an_episode(small):
    with pytest.raises(RuntimeError):
        HighwayEnv(**small).step(1)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("n_others", -1),
        ("duration", 0),
        ("density", 0.0),
        ("density", float("inf")),
        ("n_lanes", 9),
        ("speed_levels", [20.0]),
        ("speed_levels", [30.0, 20.0]),
        ("dtype", "float16"),
    ],
)
def test_bad_options_are_named(key, value):
    with pytest.raises(InvalidInputError) as error:
        HighwayOptions(**{key: value})
    assert (error.value.code, error.value.problem.key) == ("out-of-range", key)


def test_unknown_options_are_named(small):
    with refused("key-unknown", key="vehicles_count"):
        make_env(**small, vehicles_count=4)
    with refused("key-unknown", key="n_other") as caught:
        make_env(n_other=4)
    assert "n_others" in caught.value.problem.fault


@pytest.mark.parametrize(
    ("key", "value"),
    [("n_others", "4"), ("n_others", None), ("n_others", True), ("density", "1"), ("see_behind", 1)]
    + [("speed_levels", 20.0), ("speed_levels", ["20", "30"]), ("n_lanes", 2.5), ("dtype", 32)],
)
@pytest.mark.parametrize("make", [make_env, partial(make_env, num_envs=2), FunctionalHighway])
def test_options_of_another_type_are_named(make, key, value):
    with refused("wrong-type") as caught:
        make(**{key: value})
    assert caught.value.problem.key.startswith(key)


def test_options_may_be_numbers_and_arrays_of_numpy():
    options = options_of({"n_others": np.int64(3), "speed_levels": np.array([20.0, 30.0])})
    assert options == HighwayOptions(n_others=3, speed_levels=(20.0, 30.0))


@pytest.mark.parametrize("kind", [np.int64, np.uint32, jax.numpy.int32, np.array])
def test_a_seed_is_a_number_of_any_library(env, kind):
    np.testing.assert_array_equal(env.reset(seed=kind(3))[0], env.reset(seed=3)[0])


@pytest.mark.parametrize("seed", [-1, 1.5, np.float64(3), "3", [3]])
def test_no_other_seeds(env, seed):
    with pytest.raises(ValueError, match="whole numbers from 0"):
        env.reset(seed=seed)


def test_an_option_of_another_environment_is_not_proposed():
    with refused("key-unknown", key="render_mode") as caught:
        FunctionalHighway(render_mode="rgb_array")
    assert "nearest: render_mode" not in caught.value.problem.fault


@pytest.mark.parametrize("options", ["x", 3, [("x", 1)]])
def test_options_of_reset_are_a_mapping(options):
    with refused("wrong-type", key="options"):
        check_reset_options(options, "reset_mask")


def test_options_of_reset_are_refused_unless_known(env, small):
    with refused("key-unknown", key="1"):
        check_reset_options({1: 2})
    with refused("key-unknown", key="x"):
        env.reset(options={"x": 1})
    with refused("key-unknown", key="x"):
        make_env(num_envs=2, **small).reset(options={"x": 1})


def test_double_precision_needs_x64(monkeypatch):
    monkeypatch.setattr(jax.config, "read", lambda name: False)
    with pytest.raises(InvalidInputError) as error:
        HighwayOptions(dtype="float64")
    assert error.value.problem.key == "dtype"


def test_gymnasium_imports_it_by_name():
    """In a new process, in which nothing of the package has been imported."""
    program = (
        "import gymnasium\n"
        "env = gymnasium.make('rearl_jax.environments:rearl_jax/Highway-v0', n_others=2, speed_levels=[5.0, 20.0])\n"
        "print(type(env.unwrapped).__name__, env.unwrapped.options.speed_levels)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "HighwayEnv (5.0, 20.0)"


def test_importing_the_environments_imports_no_jax():
    program = "import sys, rearl_jax.environments; print('jax' in sys.modules, 'gymnasium' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_wrappers_of_gymnasium_work(env):
    wrapped = gymnasium.wrappers.FlattenObservation(gymnasium.wrappers.RecordEpisodeStatistics(env))
    observation, _ = wrapped.reset(seed=1)
    assert observation.shape == (25,)
    for _ in range(6):
        *_, terminated, truncated, info = wrapped.step(4)
        if terminated or truncated:
            break
    assert info["episode"]["l"] <= 6
    assert 0 < info["episode"]["r"] <= 6
