"""The vector environment: Gymnasium's own, of single environments, must not differ from it."""

import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from rearl_jax import make_env
from rearl_jax.environments.arguments import number_of_scenarios
from rearl_jax.environments.single import HighwayEnv
from tests.refusal import refused

pytestmark = pytest.mark.thorough

N = 3


@pytest.fixture
def pair(small):
    """Ours, and Gymnasium's of single environments, in a mode."""

    def make(mode):
        ours = make_env(N, **small, autoreset_mode=mode)
        theirs = SyncVectorEnv([lambda: HighwayEnv(**small)] * N, autoreset_mode=mode)
        return ours, theirs

    return make


def assert_same(ours, theirs):
    """Equal keys, types and values, at any depth."""
    assert type(ours) is type(theirs)
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for name in ours:
            assert_same(ours[name], theirs[name])
    elif isinstance(ours, np.ndarray):
        assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape)
        if ours.dtype == object:
            for one, other in zip(ours, theirs, strict=True):
                assert_same(one, other)
        else:
            np.testing.assert_allclose(ours, theirs, atol=1e-5)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_like_single_environments(pair, mode):
    ours, theirs = pair(mode)
    assert ours.metadata["autoreset_mode"] is mode
    for space in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(ours, space) == getattr(theirs, space)
    for seed in (5, None, [9, None, 2]):
        for one, other in zip(ours.reset(seed=seed), theirs.reset(seed=seed), strict=True):
            assert_same(one, other)
    rng, ends = np.random.default_rng(0), np.zeros((2, N), int)
    for _ in range(16):
        actions = rng.integers(0, 5, N)
        found, expected = ours.step(actions), theirs.step(actions)
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other)
        ends += np.array(found[2:4])
    assert (ends.sum(axis=1) > 1).all()  # episodes were terminated and truncated


def test_without_automatic_resets(pair):
    ours, theirs = pair(AutoresetMode.DISABLED)
    ours.reset(seed=7)
    theirs.reset(seed=7)
    actions = np.full(N, 3)
    for _ in range(6):
        found, expected = ours.step(actions), theirs.step(actions)
        ended = found[2] | found[3]
        if ended.any() and not ended.all():
            break
        assert not ended.any()
    assert ended.any()
    assert_same(found[0], expected[0])
    with pytest.raises(RuntimeError):
        ours.step(actions)
    for one, other in zip(
        ours.reset(options={"reset_mask": ended}), theirs.reset(options={"reset_mask": ended}), strict=True
    ):
        assert_same(one, other)
    for one, other in zip(ours.step(actions), theirs.step(actions), strict=True):
        assert_same(one, other)


def test_seeds_may_be_of_any_kind_and_size(pair):
    ours, _ = pair(AutoresetMode.NEXT_STEP)
    first = ours.reset(seed=5)[0]
    for seed in (np.int64(5), [5, 6, 7], 2**32 + 5, jnp.int32(5), jnp.array([5, 6, 7]), range(5, 8)):
        np.testing.assert_array_equal(ours.reset(seed=seed)[0], first)


def test_what_is_returned_may_be_kept_and_changed(pair):
    ours, _ = pair(AutoresetMode.NEXT_STEP)
    observation, _ = ours.reset(seed=0)
    kept = observation.copy()
    following, *_ = ours.step(np.ones(N, int))
    np.testing.assert_array_equal(observation, kept)
    observation[:] = 9.0
    following[:] = 9.0
    assert (ours.step(np.ones(N, int))[0] <= 1).all()


@pytest.mark.parametrize("actions", [[1, 2], [0, 1, 5], [0.5, 1.0, 2.0], [[1, 1, 1]], [True] * 3])
def test_bad_actions_are_refused(pair, actions):
    ours, _ = pair(AutoresetMode.NEXT_STEP)
    ours.reset(seed=0)
    with pytest.raises(ValueError, match="actions must be 3 whole numbers from 0 to 4"):
        ours.step(np.array(actions))


def test_bad_resets_are_refused(pair, small):
    ours, _ = pair(AutoresetMode.NEXT_STEP)
    with pytest.raises(RuntimeError):
        ours.step(np.ones(N, int))
    with pytest.raises(ValueError, match="never begun"):
        ours.reset(options={"reset_mask": np.array([True, False, False])})
    ours.reset(seed=0)
    with pytest.raises(ValueError, match="2 seeds for 3 scenarios"):
        ours.reset(seed=[1, 2])
    with pytest.raises(ValueError, match="whole numbers from 0"):
        ours.reset(seed=[1, None, -1])
    for seed in (-1, 1.5, "5", iter([1, 2, 3])):
        with pytest.raises(ValueError, match="whole numbers from 0"):
            ours.reset(seed=seed)
    for mask in (np.zeros(N, bool), np.ones(2, bool), np.ones(N, int)):
        with pytest.raises(ValueError, match="reset_mask must be 3 booleans"):
            ours.reset(options={"reset_mask": mask})
    with refused("out-of-range", key="num_envs"):
        make_env(0, **small)
    for number in (-1, 1.5, "2", [2], True):
        with refused("out-of-range", key="num_envs"):
            number_of_scenarios(number)
    with refused("out-of-range", key="autoreset_mode"):
        make_env(2, **small, autoreset_mode="SAME_STEP")


def test_wrappers_of_gymnasium_work(pair):
    ours, _ = pair(AutoresetMode.NEXT_STEP)
    wrapped = RecordEpisodeStatistics(ours)
    wrapped.reset(seed=0)
    lengths = []
    for _ in range(14):
        *_, info = wrapped.step(np.ones(N, int))
        if "episode" in info:
            lengths += info["episode"]["l"][info["_episode"]].tolist()
    assert len(lengths) >= 2 * N - 1
    assert max(lengths) == 6
