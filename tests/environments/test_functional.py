"""The functional environment: gymnax's protocol, and that all scenarios at once are what each is alone."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax import FunctionalHighway
from rearl_jax.environments import functional as functional_module

pytestmark = pytest.mark.thorough

N, SECONDS = 12, 8


@pytest.fixture(scope="module")
def step(functional):
    """All scenarios at once, with params for all."""
    return jax.jit(jax.vmap(functional.step, (0, 0, 0, None)))


@pytest.fixture(scope="module")
def episodes(functional, step):
    """Eight seconds of twelve scenarios: keys, states and actions before each, and what came of them."""
    state = jax.vmap(functional.reset)(jax.random.split(jax.random.key(2), N))[1]
    seconds = []
    for number in range(SECONDS):
        keys = jax.random.split(jax.random.key(100 + number), N)
        actions = jax.random.randint(keys[0], (N,), 0, 5, jnp.int32)
        result = step(keys, state, actions, functional.default_params)
        seconds.append((keys, state, actions, result))
        state = result[1]
    return seconds


@pytest.mark.slow  # compiles it for one scenario too
def test_all_scenarios_at_once_are_each_one_alone(functional, episodes):
    n_ended = 0
    for keys, state, actions, result in episodes:
        for scenario in (0, 5, 11):
            before, expected = jax.tree.map(lambda leaf, at=scenario: leaf[at], (state, result))
            alone = functional.step(keys[scenario], before, actions[scenario])
            for one, other in zip(jax.tree.leaves(alone), jax.tree.leaves(expected), strict=True):
                if not jnp.issubdtype(one.dtype, jax.dtypes.prng_key):
                    np.testing.assert_allclose(one, other, atol=1e-3)
            n_ended += int(alone[3] | alone[4])
    assert n_ended >= 3


def test_episodes_begin_anew_where_they_end(episodes):
    both = np.zeros(2, int)
    for _, state, _, (observation, after, reward, terminated, truncated, info) in episodes:
        ended = np.asarray(terminated | truncated)
        both += int(terminated.sum()), int(truncated.sum())
        assert (observation.dtype, reward.dtype) == (np.float32, np.float32)
        assert (np.asarray(reward)[~np.asarray(terminated)] > 0.5).all()
        last = np.asarray(info["final_observation"])
        np.testing.assert_array_equal(last[~ended], np.asarray(observation)[~ended])
        assert (np.abs(last - np.asarray(observation))[ended].max(axis=(1, 2)) > 0.01).all()
        np.testing.assert_array_equal(after.time, np.where(ended, 0, state.time + 1))
        np.testing.assert_array_equal(truncated, state.time == 5)  # six seconds long
    assert (both > 2).all()


def test_params_need_no_new_program(functional, step, episodes):
    keys, state, actions, _ = episodes[0]
    for duration in (1, 9):
        params = functional.default_params.replace(max_steps_in_episode=duration)
        assert step(keys, state, actions, params)[4].all() == (duration == 1)
    assert step._cache_size() == 1


@pytest.mark.slow
def test_its_parts_are_what_the_step_is_made_of(functional, episodes):
    keys, state, actions, (*_, terminated, truncated, info) = episodes[5]
    params = functional.default_params
    step = jax.jit(jax.vmap(lambda key, state, action: functional.step_env(key, state, action, params)))
    seen, after, _, crashed, _ = step(keys, state, actions)
    np.testing.assert_allclose(seen, info["final_observation"], atol=1e-5)
    np.testing.assert_array_equal(crashed, terminated)
    np.testing.assert_array_equal(jax.vmap(functional.is_terminated, (0, None))(after, params), terminated)
    np.testing.assert_array_equal(jax.vmap(functional.is_truncated, (0, None))(after, params), truncated)
    look = jax.vmap(lambda state: functional.observe(jax.random.key(0), state, None, params))
    np.testing.assert_allclose(look(after), seen, atol=1e-6)


def test_old_keys_are_keys(functional):
    old, new = jax.random.PRNGKey(3), jax.random.key(3)
    np.testing.assert_array_equal(functional.reset(old)[0], functional.reset(new)[0])
    assert functional.reset(old)[0].shape == (5, 5)
    assert (functional.name, functional.num_actions) == ("Highway-rearl_jax", 5)


@pytest.mark.parametrize("options", [{"n_others": 0, "n_rows": 1}, {"n_others": 30, "n_lanes": 1, "n_rows": 40}])
def test_traffic_of_any_size(options):
    env = FunctionalHighway(**options)
    observation, state = jax.eval_shape(env.reset, jax.random.key(0))
    result = jax.eval_shape(env.step, jax.random.key(0), state, 1)
    assert observation.shape == result[0].shape == (options["n_rows"], 5)
    assert jax.tree.map(lambda leaf: leaf.shape, result[1]) == jax.tree.map(lambda leaf: leaf.shape, state)


@pytest.mark.parametrize("number", [1.7, True, np.array([1]), jnp.float32(1)])
def test_a_number_that_a_conversion_would_change_is_refused(number):
    with pytest.raises(ValueError, match="action must be a whole number"):
        functional_module._whole("action", number)
    assert functional_module._whole("action", np.uint8(3)) == 3


def test_it_needs_no_gymnax():
    program = (
        "import sys\n"
        "sys.modules['gymnax'] = None\n"
        "from rearl_jax import FunctionalHighway\n"
        "env = FunctionalHighway()\n"
        "print(env.default_params.max_steps_in_episode)\n"
        "try:\n"
        "    env.action_space()\n"
        "except ImportError as error:\n"
        "    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    duration, complaint = done.stdout.splitlines()
    assert duration == "40"
    assert "pip install 'rearl_jax[gymnax]'" in complaint
