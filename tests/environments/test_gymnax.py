"""gymnax's own wrappers around the functional environment; skipped where gymnax is not installed."""

from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("gymnax")
if version("gymnax").startswith("0."):
    pytest.skip("gymnax before 1.0 tells no termination from truncation", allow_module_level=True)


@pytest.fixture(autouse=True)
def lenient():
    """gymnax promotes types as JAX does by default."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


def test_a_rollout_through_gymnax(functional):
    from gymnax.experimental.rollout import RolloutWrapper

    def policy(params, observation, key):
        return jnp.where(observation[0, 3] < params, 3, 1)

    manager = RolloutWrapper(policy, env=functional, env_params={"max_steps_in_episode": 6}, num_env_steps=6)
    assert manager.input_shape == (5, 5)
    keys = jax.random.split(jax.random.key(0), 7)
    observation, action, reward, _, done, total = manager.batch_rollout(keys, jnp.float32(0.35))
    assert observation.shape == (7, 6, 5, 5)
    assert set(np.unique(action)) == {1, 3}
    assert np.asarray(done).any()
    alive = np.cumsum(np.concatenate([np.zeros((7, 1)), done[:, :-1]], axis=1), axis=1) == 0
    np.testing.assert_allclose(total[:, 0], (np.asarray(reward) * alive).sum(axis=1), rtol=1e-5)


def test_its_wrappers_of_training_work(functional):
    from gymnax.wrappers import FlattenObservationWrapper, LogWrapper

    env = LogWrapper(FlattenObservationWrapper(functional))
    params = functional.default_params
    assert env.observation_space(params).shape == (25,)
    keys = jax.random.split(jax.random.key(1), 5)
    observation, state = jax.vmap(env.reset, (0, None))(keys, params)
    assert observation.shape == (5, 25)
    for _ in range(6):
        actions = jax.vmap(env.action_space(params).sample)(keys)
        *_, terminated, truncated, info = (out := jax.vmap(env.step, (0, 0, 0, None))(keys, state, actions, params))
        state = out[1]
    assert (np.asarray(info["returned_episode_lengths"]) > 0).all()
    assert (np.asarray(info["returned_episode_returns"]) > 0).all()


def test_its_step_of_old_works(functional):
    from gymnax.wrappers import LegacyStepAPIWrapper

    env = LegacyStepAPIWrapper(functional)
    key = jax.random.key(4)
    observation, state = env.reset(key)
    observation, state, reward, done, info = env.step(key, state, 1)
    assert observation.shape == (5, 5)
    assert bool(done) == bool(info["terminated"] | info["truncated"])


def test_gymnasium_accepts_it_through_gymnax(functional):
    from gymnax.wrappers import GymnaxToGymWrapper

    env = GymnaxToGymWrapper(functional, seed=0)
    assert env.action_space.n == 5
    assert (env.observation_space.shape, env.observation_space.dtype) == ((5, 5), np.float32)
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(np.asarray(observation))
    assert len(env.step(3)) == 5
