"""Policies that record their decisions leave the traffic unchanged; the records agree with the counts of the loop."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import Method
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.simulators import interventions
from rearl_jax.progress import progress_bar
from rearl_jax.report.decision_recorder import DecisionRecorder, policy_of
from rearl_jax.results import Study
from tests.evaluation.conftest import representatives


@pytest.fixture(scope="module")
def intervening(tmp_path_factory):
    """Scenes of the shipped recordings, references from two of them, and a configuration that intervenes often."""
    config = EvaluateTask(method=Method.rearl)
    config = replace(config, core=replace(config.core, collisions=False), eval=replace(config.eval, n_runs=2))
    with progress_bar() as bar:
        study = Study(tmp_path_factory.mktemp("results"), "recorded", config, "evaluate")
        scenes = read_inputs(config, study, bar, with_references=False).scenes
    return config, scenes, representatives(scenes)


@pytest.mark.slow
def test_a_recorded_policy_gives_the_same_traffic_and_counts(intervening):
    """With the policy that draws at random, which also needs the random keys of the rollouts."""
    config, scenes, references = intervening
    config = replace(config, decision=replace(config.decision, policy=PolicyName.random_admissible))
    acts = interventions(config)
    arguments = ([Row(config, thresholds=(0.3, 0.1))], scenes, np.array([1, 4, 6]), references)
    inside = Rollouts(*arguments)[3:6]
    recorder = DecisionRecorder(policy_of(acts, inside.decision_keys))
    outside = Rollouts(*arguments, recorder)[3:6]
    (before,), (after,) = list(inside.chunks()), list(outside.chunks())
    for leaf, other in zip(jax.tree.leaves(before.frames), jax.tree.leaves(after.frames), strict=True):
        np.testing.assert_array_equal(np.asarray(leaf), np.asarray(other))

    counted = np.zeros_like(before.decisions.n_asked)
    followed = np.zeros_like(before.decisions.n_accepted)
    for decision in recorder.decisions:
        counted[decision.second + 1, decision.rollout] += 1  # counted in the second in which it is followed
        if decision.action >= 0:
            followed[decision.second + 1, decision.action, decision.rollout] += 1
    assert counted.sum() > 100
    assert len({decision.action for decision in recorder.decisions}) > 2
    np.testing.assert_array_equal(counted, before.decisions.n_asked)
    np.testing.assert_array_equal(followed, before.decisions.n_accepted)
    assert len({(decision.rollout, decision.second, decision.vehicle) for decision in recorder.decisions}) == len(
        recorder.decisions
    )
