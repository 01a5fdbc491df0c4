"""The environment against highway-env: the same vehicles and actions, the same observations, rewards and ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from highway_env.envs.highway_env import HighwayEnv

from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.environments import highway
from rearl_jax.validation import reference, simulation
from rearl_jax.validation.reference import DENSITY
from rearl_jax.validation.scenarios import Scenario, Source

pytestmark = pytest.mark.thorough

N_OTHERS, SECONDS, SEEDS = 10, 15, (2, 3, 4, 5)


def start_of(scenario):
    """The vehicles of highway-env after its reset, as the core has them."""
    start = reference.simulate(scenario).start
    return start, lambda model: (
        simulation.initial_state(start, model, np.float64),
        highway_env_drivers(jnp.asarray(start.accel_exponent)),
    )


@pytest.fixture(scope="module")
def driven():
    """Returned values of highway-env and of this package in every second; scenes are the last axis."""
    options = highway.HighwayOptions(n_others=N_OTHERS, duration=SECONDS, dtype="float64")
    config = {"vehicles_count": N_OTHERS, "vehicles_density": DENSITY, "duration": SECONDS}
    actions = np.random.default_rng(7).choice(5, (SECONDS, len(SEEDS)), p=[0.25, 0.25, 0.2, 0.15, 0.15])
    theirs, first, starts = [], [], []
    for number, seed in enumerate(SEEDS):
        scenario = Scenario("env", number, Source.env, seed, N_OTHERS, 1, (20.0, 25.0, 30.0), ((1,),))
        start, build = start_of(scenario)
        env = HighwayEnv(config)
        first.append(env.reset(seed=seed)[0])
        assert [vehicle.position[0] for vehicle in env.road.vehicles] == start.x.tolist()
        starts.append(build(options.model))
        theirs.append([env.step(int(action))[:4] for action in actions[:, number]])
    traffic, drivers = jax.tree.map(lambda *leaves: jnp.stack(leaves, axis=-1), *starts)
    state = highway.HighwayState(traffic, drivers, jnp.zeros(len(SEEDS), jnp.int32))

    def second(state, action):
        state = highway.advance(state, action, options)
        outcome = highway.outcome_of(state, options, options.duration)
        return state, (outcome.observation, outcome.reward, outcome.terminated, outcome.truncated)

    begun = highway.observe(state, options)
    ours = jax.jit(lambda state: jax.lax.scan(second, state, jnp.asarray(actions)))(state)[1]
    columns = [np.moveaxis(np.array([[step[k] for step in run] for run in theirs]), 0, -1) for k in range(4)]
    return (np.stack(first, axis=-1), *columns), (begun, *ours)


def test_something_happens(driven):
    (first, observation, reward, terminated, truncated), _ = driven
    assert terminated.any()
    assert not terminated[-1].all()
    assert len(np.unique(np.round(reward, 3))) > 12
    assert (observation[:, 1:, 0] == 0).any()  # vehicles out of sight
    assert (np.abs(observation[..., 4, :]) > 0.001).any()  # lane changes


def test_it_sees_what_highway_env_sees(driven):
    (first, observation, *_), (our_first, our_observation, *_) = driven
    np.testing.assert_allclose(our_first, first, atol=1e-6)
    np.testing.assert_allclose(our_observation, observation, atol=1e-6)


def test_it_rewards_what_highway_env_rewards(driven):
    theirs, ours = driven
    np.testing.assert_allclose(ours[2], theirs[2], atol=1e-6)


def test_it_ends_when_highway_env_ends(driven):
    theirs, ours = driven
    np.testing.assert_array_equal(ours[3], theirs[3])
    np.testing.assert_array_equal(ours[4], theirs[4])
    assert theirs[4][-1].all()
    assert not theirs[4][-2].any()
