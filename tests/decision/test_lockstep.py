"""The closed loop driven from outside: the same as inside, asked at the right times, in halves."""

import functools
from concurrent.futures import Future, ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.decision import MatcherConfig, PolicyName
from rearl_jax.decision.lockstep import rollout_in_lockstep
from rearl_jax.decision.loop import LoopOptions, rollout_with_policy
from rearl_jax.decision.policies import make_policy
from rearl_jax.detection.detector import Thresholds
from rearl_jax.models.population import population_of_model
from rearl_jax.models.traffic import populate
from tests.models.drivers import CURVE, NOISE
from tests.models.drivers import model as repaired_model

pytestmark = pytest.mark.thorough

N_SECONDS = 6


class OnHost:
    """The matcher, called from outside; keeps what it was shown."""

    def __init__(self, table, model, pool=None):
        self._decide = jax.jit(functools.partial(make_policy(PolicyName.matcher, MatcherConfig(), model), table=table))
        self._pool, self.shown = pool, []

    def ask(self, situation):
        assert all(isinstance(leaf, np.ndarray) for leaf in jax.tree.leaves(situation))
        self.shown.append(situation)
        if self._pool is not None:
            return self._pool.submit(self._answer, situation)
        done = Future()
        done.set_result(self._answer(situation))
        return done

    def _answer(self, situation):
        keys = jax.random.split(jax.random.key(0), situation.detection.mask.shape[-1])
        return np.asarray(self._decide(jax.tree.map(jnp.asarray, situation), keys=keys))


@pytest.fixture(scope="module")
def options():
    return LoopOptions()


def parts(start, n_scenarios, h=0.2, m=0.1):
    keys = jax.random.split(jax.random.key(9), n_scenarios)
    thresholds = Thresholds(*(jnp.full(n_scenarios, value, jnp.float32) for value in (h, m)))
    return *jax.tree.map(lambda leaf: leaf[..., :n_scenarios] if leaf.shape[-1] > 1 else leaf, start), keys, thresholds


@pytest.fixture(scope="module", params=[7, pytest.param(1, marks=pytest.mark.slow)])
def both(request, start, table, model, options):
    """Frames and decisions from inside and from outside, and the policies of the halves."""
    state, drivers, keys, thresholds = parts(start, request.param)
    policy = make_policy(PolicyName.matcher, MatcherConfig(), model)
    inside = jax.jit(
        functools.partial(rollout_with_policy, policy=policy, model=model, options=options, n_seconds=N_SECONDS)
    )(state, drivers, keys, table, thresholds)[1:]
    seen = []
    with ThreadPoolExecutor(2) as pool:
        policies = OnHost(table, model, pool), OnHost(table, model, pool)
        outside = rollout_in_lockstep(
            *(state, drivers, keys, table, thresholds, policies, model, options),
            n_seconds=N_SECONDS,
            progress=lambda done, total: seen.append((done, total)),
        )
    return jax.tree.map(np.asarray, inside), outside, policies, seen


def test_the_result_is_that_of_the_compiled_loop_bit_for_bit(both):
    inside, outside, _, _ = both
    assert inside[1].n_asked.sum() > 0
    for a, b in zip(jax.tree.leaves(inside), jax.tree.leaves(outside), strict=True):
        np.testing.assert_array_equal(a, b)


def test_each_half_is_asked_once_per_second_but_not_after_the_last(both):
    (frames, _), _, policies, seen = both
    n_scenarios = frames.x.shape[-1]
    for policy, size in zip(policies, (-(-n_scenarios // 2), n_scenarios // 2), strict=True):
        assert [int(shown.second) for shown in policy.shown] == (list(range(N_SECONDS - 1)) if size else [])
        assert all(shown.detection.mask.shape[-1] == size for shown in policy.shown)
    assert seen[-1] == (2 * N_SECONDS, 2 * N_SECONDS)


def test_one_half_computes_while_the_other_waits(start, table, model, options):
    """The first half's answer comes only once the second half has been asked: in turn, nobody waits for ever."""

    class Waits(OnHost):
        other = None

        def ask(self, situation):
            answer = Future()
            self.shown.append(situation)
            self.open = (answer, self._answer(situation))
            if self.other is not None and len(self.other.shown) == len(self.shown):
                for policy in (self.other, self):
                    policy.open[0].set_result(policy.open[1])
            return answer

    first, second = Waits(table, model), Waits(table, model)
    second.other = first
    state, drivers, keys, thresholds = parts(start, 8)
    frames, decisions = rollout_in_lockstep(
        *(state, drivers, keys, table, thresholds, (first, second), model, options), n_seconds=N_SECONDS
    )
    assert decisions.n_asked.sum() > 0
    assert np.isfinite(frames.x).all()


def test_references_must_last(start, table, model, options):
    state, drivers, keys, thresholds = parts(start, 2)
    with pytest.raises(ValueError, match="exceeds the 8 s of the references"):
        rollout_in_lockstep(
            *(state, drivers, keys, table, thresholds, (OnHost(table, model), OnHost(table, model)), model, options),
            n_seconds=9,
        )


@pytest.mark.slow  # two programs of their own
def test_drivers_with_effects_are_the_same_from_outside(start, table, model, options):
    """Three scenarios and a curve of three knots: what belongs to scenarios is told by its axes, not by its length."""
    state, drivers, keys, thresholds = parts(start, 3)
    numbers = population_of_model(repaired_model(CURVE, NOISE), np.dtype("float32"), with_effects=True)
    state, drivers = jax.jit(lambda state: populate(state, drivers, keys, numbers, model))(state)
    assert drivers.effects[0].knots.shape == (3,)
    policy = make_policy(PolicyName.matcher, MatcherConfig(), model)
    inside = jax.jit(
        functools.partial(rollout_with_policy, policy=policy, model=model, options=options, n_seconds=N_SECONDS)
    )(state, drivers, keys, table, thresholds)[1:]
    frames, decisions = rollout_in_lockstep(
        *(state, drivers, keys, table, thresholds, (OnHost(table, model), OnHost(table, model)), model, options),
        n_seconds=N_SECONDS,
    )
    assert decisions.n_asked.sum() > 0
    np.testing.assert_array_equal(decisions.n_accepted, inside[1].n_accepted)
    np.testing.assert_allclose(frames.x, inside[0].x, atol=1e-3)
