"""Rollouts with a policy outside the program: every policy is told of its own scenarios, and of no others."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np


def test_every_policy_is_told_its_own_scenarios(monkeypatch):
    from rearl_jax.config.metrics import HistConfig
    from rearl_jax.core.model import TrafficModel
    from rearl_jax.core.spawn import spawn
    from rearl_jax.decision.loop import LoopOptions
    from rearl_jax.detection.detector import Thresholds
    from rearl_jax.detection.references import References
    from rearl_jax.detection.table import tabulate
    from rearl_jax.evaluation import outside

    n = 7
    model = TrafficModel(n_lanes=2)
    keys = jax.random.split(jax.random.key(0), n)
    state, drivers = spawn(keys, model, n_vehicles=3, density=1.0)
    length = jnp.arange(3.0 * n, dtype=jnp.float32).reshape(3, n) + 4
    drivers = replace(drivers, body=replace(drivers.body, length=length))
    thresholds = Thresholds(jnp.arange(n, dtype=jnp.float32), -jnp.arange(n, dtype=jnp.float32))
    seconds = jnp.full((1, 2, 3), 20.0, jnp.float32)
    references = References(seconds, seconds, seconds[..., 0], jnp.ones((1, 2, 3), jnp.int32), jnp.ones(1, jnp.float32))
    table = tabulate(references, HistConfig(), np.dtype("float32"))

    lots = []
    monkeypatch.setattr(outside, "BURST", 4)
    monkeypatch.setattr(outside, "rollout_in_lockstep", lambda *_, n_seconds: (None, None))
    monkeypatch.setattr(outside, "Simulated", lambda frames, length, decisions: length)
    bursts = outside.simulate_outside(
        *(state, drivers, keys, table, thresholds, lots.append, model, LoopOptions()), n_seconds=1
    )
    lengths = list(bursts)
    assert len(lengths) == 2
    np.testing.assert_array_equal(np.concatenate(lengths, axis=1), length)
    assert [lot.first for lot in lots] == [0, 2, 4, 6]
    assert [lot.length.shape[1] for lot in lots] == [2, 2, 2, 1]
    np.testing.assert_array_equal(np.concatenate([lot.length for lot in lots], axis=1), length)
    for lot in lots:
        np.testing.assert_array_equal(lot.thresholds.hellinger, lot.first + np.arange(lot.length.shape[1]))
        np.testing.assert_array_equal(lot.thresholds.mape, -lot.thresholds.hellinger)
