"""Policies that write down their decisions change nothing, and what they write agrees with the counts of the loop."""

from dataclasses import replace

import jax
import numpy as np
import pytest


@pytest.fixture(scope="module")
def intervening(tmp_path_factory):
    """Scenes of the shipped recordings, references from two of them, and a configuration that intervenes often."""
    import jax.numpy as jnp

    from rearl_jax.config import EvaluateTask
    from rearl_jax.config.evaluation import Method
    from rearl_jax.detection.references import References
    from rearl_jax.evaluation.inputs import read_inputs
    from rearl_jax.progress import progress_bar
    from rearl_jax.results import Study

    config = EvaluateTask(method=Method.rearl)
    config = replace(config, core=replace(config.core, collisions=False), eval=replace(config.eval, n_runs=2))
    with progress_bar() as bar:
        study = Study(tmp_path_factory.mktemp("results"), "witness", config, "evaluate")
        scenes = read_inputs(config, study, bar, with_references=False).scenes
    chosen = [0, 3]
    speed, spacing, mean = (
        jnp.asarray(values[chosen], jnp.float32)
        for values in (scenes.scaled_speed, scenes.spacing, scenes.mean_spacing)
    )
    action = jnp.asarray(scenes.action[chosen], jnp.int32)
    return config, scenes, References(speed, spacing, mean, action, jnp.asarray([0.25, 0.75], jnp.float32))


@pytest.mark.slow
def test_a_witnessed_policy_gives_the_same_traffic_and_counts(intervening):
    """With the policy that draws: it needs the random keys of the rollouts too."""
    from rearl_jax.config.decision import PolicyName
    from rearl_jax.evaluation.rollouts import Rollouts
    from rearl_jax.evaluation.rows import Row
    from rearl_jax.evaluation.simulators import interventions
    from rearl_jax.report.witness import Witness, policy_of

    config, scenes, references = intervening
    config = replace(config, decision=replace(config.decision, policy=PolicyName.random_admissible))
    acts = interventions(config)
    arguments = ([Row(config, thresholds=(0.3, 0.1))], scenes, np.array([1, 4, 6]), references)
    inside = Rollouts(*arguments)[3:6]
    witness = Witness(policy_of(acts, inside.decision_keys))
    outside = Rollouts(*arguments, witness)[3:6]
    (before,), (after,) = list(inside.chunks()), list(outside.chunks())
    for one, other in zip(jax.tree.leaves(before.frames), jax.tree.leaves(after.frames), strict=True):
        np.testing.assert_array_equal(np.asarray(one), np.asarray(other))

    counted = np.zeros_like(before.decisions.n_asked)
    followed = np.zeros_like(before.decisions.n_accepted)
    for one in witness.decisions:
        counted[one.second + 1, one.rollout] += 1  # counted in the second in which it is followed
        if one.action >= 0:
            followed[one.second + 1, one.action, one.rollout] += 1
    assert counted.sum() > 100
    assert len({one.action for one in witness.decisions}) > 2
    np.testing.assert_array_equal(counted, before.decisions.n_asked)
    np.testing.assert_array_equal(followed, before.decisions.n_accepted)
    assert len({(one.rollout, one.second, one.vehicle) for one in witness.decisions}) == len(witness.decisions)
