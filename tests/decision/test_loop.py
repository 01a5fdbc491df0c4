"""The closed loop: nothing where nobody is asked, something where they are, and nothing that depends on the batch."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.decision import ExecConfig, MatcherConfig, PolicyName
from rearl_jax.config.detection import Cues, ReferenceMode
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.decision.loop import LoopOptions, rollout_with_policy
from rearl_jax.decision.policies import make_policy
from rearl_jax.detection.detector import DetectionOptions, Thresholds

N_SCENARIOS, N_SECONDS = 24, 8
LEFT, KEEP, RIGHT, FASTER, SLOWER = range(5)


@functools.cache
def program(model, policy, options):
    """The rollout, compiled once for each choice."""
    policy = policy if callable(policy) else make_policy(policy, MatcherConfig(), model)
    fixed = {"policy": policy, "model": model, "options": options, "n_seconds": N_SECONDS}
    return jax.jit(functools.partial(rollout_with_policy, **fixed))


def run(start, table, model, policy, *, h=0.2, m=0.1, order=None, execution=None, **detection):
    order = np.arange(N_SCENARIOS) if order is None else order
    keys = jax.random.split(jax.random.key(9), N_SCENARIOS)[order]
    thresholds = Thresholds(*(jnp.full(len(order), value, jnp.float32) for value in (h, m)))
    options = LoopOptions(DetectionOptions(**detection), execution=execution or ExecConfig())
    state, drivers = jax.tree.map(lambda leaf: leaf[..., order] if leaf.shape[-1] > 1 else leaf, start)
    _, frames, decisions = program(model, policy, options)(state, drivers, keys, table, thresholds)
    return jax.tree.map(np.asarray, (frames, decisions))


@pytest.fixture(scope="module")
def lean(model):
    """Compiles faster."""
    return replace(model, collisions=False)


@pytest.fixture(scope="module")
def base(start, model):
    plain = replace(model, meta_follows=False)
    frames = jax.jit(lambda state, drivers: rollout(state, drivers, plain, n_seconds=N_SECONDS)[1])(*start)
    return jax.tree.map(np.asarray, frames)


@pytest.fixture(scope="module")
def matched(start, table, model):
    return run(start, table, model, PolicyName.matcher)


@pytest.mark.parametrize(
    ("cues", "h", "m"),
    # The first runs the program of `matched`, the second one of its own.
    [("both", 2.0, np.inf), pytest.param("never", 0.0, 0.0, marks=pytest.mark.thorough)],
)
def test_traffic_that_nobody_asks_about_is_the_base_bit_for_bit(start, table, model, base, cues, h, m):
    assert (np.diff(base.lane, axis=0) != 0).sum() > 5
    frames, decisions = run(start, table, model, PolicyName.matcher, h=h, m=m, cues=Cues[cues])
    assert not decisions.n_asked.any()
    for a, b in zip(jax.tree.leaves(frames), jax.tree.leaves(base), strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_intervention_changes_trajectories(matched, base):
    frames, decisions = matched
    np.testing.assert_array_equal(frames.x[0], base.x[0])  # the first second is nobody's
    asked = decisions.n_asked.sum(axis=0) > 0
    assert asked.any()
    assert (np.abs(frames.x - base.x).max(axis=(0, 1)) > 1.0)[decisions.n_accepted[:, FASTER].sum(axis=0) > 5].all()
    # Every vehicle asked is counted once.
    told = decisions.n_accepted.sum(axis=1) + decisions.n_inadmissible + decisions.n_invalid
    np.testing.assert_array_equal(told, decisions.n_asked)
    np.testing.assert_array_equal(decisions.n_asked[1:] > 0, decisions.triggered[:-1])
    assert not decisions.n_asked[0].any()
    assert decisions.n_accepted.sum(axis=(0, 2)).min() > 0


def test_scenarios_do_not_depend_on_their_place_in_the_batch(start, table, model, matched):
    order = np.random.default_rng(0).permutation(N_SCENARIOS)
    found = run(start, table, model, PolicyName.matcher, order=order)
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(matched), strict=True):
        np.testing.assert_array_equal(a, b[..., order])


@pytest.mark.slow
def test_a_drawn_reference_belongs_to_the_rollout_for_its_whole_time(start, table, lean, matched):
    """Independence of the policy and of the other rollouts in the batch."""
    frames, decisions = run(start, table, lean, PolicyName.matcher, mode=ReferenceMode.drawn)
    drawn = decisions.reference[0]
    assert (np.bincount(drawn, minlength=3) > 0).all()
    assert (matched[1].reference != drawn).any()  # not the nearest ones by chance
    np.testing.assert_array_equal(decisions.reference, np.broadcast_to(drawn, decisions.reference.shape))
    order = np.array([5, 0, 17, 11, 2])
    few_frames, few = run(start, table, lean, PolicyName.matcher, mode=ReferenceMode.drawn, order=order)
    np.testing.assert_array_equal(few.reference, decisions.reference[:, order])
    np.testing.assert_allclose(few_frames.x, frames.x[..., order], rtol=1e-6, atol=1e-4)
    other_frames, other = run(start, table, lean, PolicyName.random_admissible, mode=ReferenceMode.drawn)
    assert (np.abs(other_frames.x - frames.x) > 1.0).any()
    np.testing.assert_array_equal(other.reference, decisions.reference)


@pytest.mark.thorough
def test_random_actions_are_reproducible_and_interval_and_hold_are_kept(start, table, lean):
    changes = {"cues": Cues.always, "interval": 3, "execution": ExecConfig(hold=2)}
    once, again = (run(start, table, lean, PolicyName.random_admissible, **changes) for _ in range(2))
    for a, b in zip(jax.tree.leaves(once), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    decisions = once[1]
    assert np.flatnonzero(decisions.n_asked[:, 0]).tolist() == [3, 6]  # frames 2 and 5, acted on in the next second
    assert (decisions.n_accepted.sum(axis=(0, 2)) > 0).all()


def test_answers_that_do_not_count_leave_everybody_to_idm(start, table, lean, base):
    """Inadmissible or no answers at all: counted, and the traffic is the base."""

    def fails(situation, table, keys):
        worst = jnp.argmin(situation.admissible, axis=0).astype(jnp.int32)
        has_bad = ~situation.admissible.all(axis=0)
        return jnp.where(has_bad, worst, -1)

    frames, decisions = run(start, table, lean, fails, cues=Cues.always)
    assert decisions.n_inadmissible.sum() > 50
    assert decisions.n_invalid.sum() > 50
    assert not decisions.n_accepted.any()
    calm = ~base.crashed.any(axis=(0, 1))
    assert calm.sum() > N_SCENARIOS / 2
    np.testing.assert_array_equal(frames.x[..., calm], base.x[..., calm])


@pytest.mark.thorough
def test_crashed_vehicles_do_no_harm(table, model):
    """Vehicles that crash at the start and later are not asked, and nothing becomes NaN."""
    plain = replace(model, meta_follows=False)
    start = spawn(jax.random.split(jax.random.key(0), N_SCENARIOS), plain, n_vehicles=10, density=8.0)
    object.__setattr__(start[0], "crashed", start[0].crashed.at[::4].set(True))
    frames, decisions = run(start, table, plain, PolicyName.matcher, cues=Cues.always)
    assert frames.crashed[-1].sum() > frames.crashed[0].sum()
    for leaf in jax.tree.leaves((frames, decisions)):
        assert np.isfinite(leaf).all()
    np.testing.assert_array_equal(decisions.n_asked[1:], 10 - frames.crashed[:-1].sum(axis=1))


def test_references_shorter_than_the_rollout_are_refused(start, table, model):
    short = jax.tree.map(lambda leaf: leaf[:5], table)
    with pytest.raises(ValueError, match="exceeds the 5 s of the references"):
        run(start, short, model, PolicyName.idle)
