"""Rollouts with a policy on the host: every policy is told of its own scenarios, and of no others."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.config.metrics import HistConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.decision.loop import LoopOptions
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.references import References
from rearl_jax.detection.table import tabulate
from rearl_jax.evaluation import host_policy


def test_every_policy_is_told_its_own_scenarios(monkeypatch):
    n = 7
    model = TrafficModel(n_lanes=2)
    keys = jax.random.split(jax.random.key(0), n)
    state, drivers = jax.jit(partial(spawn, model=model, n_vehicles=3, density=1.0))(keys)
    length = jnp.arange(3.0 * n, dtype=jnp.float32).reshape(3, n) + 4
    drivers = replace(drivers, body=replace(drivers.body, length=length))
    thresholds = Thresholds(jnp.arange(n, dtype=jnp.float32), -jnp.arange(n, dtype=jnp.float32))
    seconds = jnp.full((1, 2, 3), 20.0, jnp.float32)
    references = References(seconds, seconds, seconds[..., 0], jnp.ones((1, 2, 3), jnp.int32), jnp.ones(1, jnp.float32))
    table = jax.jit(lambda: tabulate(references, HistConfig(), np.dtype("float32")))()

    blocks = []
    monkeypatch.setattr(host_policy, "MAX_BURST", 4)
    monkeypatch.setattr(host_policy, "rollout_in_lockstep", lambda *_, n_seconds: (None, None))
    monkeypatch.setattr(host_policy, "Simulated", lambda frames, length, decisions: length)
    bursts = host_policy.simulate_with_host_policy(
        *(state, drivers, keys, table, thresholds, blocks.append, model, LoopOptions()), n_seconds=1
    )
    lengths = list(bursts)
    assert len(lengths) == 2
    np.testing.assert_array_equal(np.concatenate(lengths, axis=1), length)
    assert [block.first_scenario for block in blocks] == [0, 2, 4, 6]
    assert [block.length.shape[1] for block in blocks] == [2, 2, 2, 1]
    np.testing.assert_array_equal(np.concatenate([block.length for block in blocks], axis=1), length)
    for block in blocks:
        expected = block.first_scenario + np.arange(block.length.shape[1])
        np.testing.assert_array_equal(block.thresholds.hellinger, expected)
        np.testing.assert_array_equal(block.thresholds.mape, -block.thresholds.hellinger)
