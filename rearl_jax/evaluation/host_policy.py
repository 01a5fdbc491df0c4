"""Rollouts whose decisions are made outside the compiled program, on the host.

A burst is a number of scenarios simulated in lockstep. It consists of two blocks, each with a policy of its own: while
one block waits for answers, the other is simulated.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import jax
import numpy as np
from jaxtyping import Float, Key

from rearl_jax.core.batch import select_scenarios
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.lockstep import HostPolicy, rollout_in_lockstep
from rearl_jax.decision.loop import LoopOptions
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.table import ReferenceTable
from rearl_jax.evaluation.simulators import Simulated, lengths_of

MAX_BURST = 2_048
"""Largest number of scenarios in a burst."""


@dataclass(frozen=True)
class Block:
    """Scenarios that one policy decides for, as they are before the first second.

    Attributes:
        table: References.
        model: Road, clock and stages.
        options: Choices of the loop.
        thresholds: Thresholds of every scenario.
        length: Lengths of the vehicles [m].
        first_scenario: Number of the first of these scenarios among all rollouts.
    """

    table: ReferenceTable
    model: TrafficModel
    options: LoopOptions
    thresholds: Thresholds
    length: Float[np.ndarray, "vehicles scenarios"]
    first_scenario: int


MakePolicy: TypeAlias = Callable[[Block], HostPolicy]
"""Makes the policy that decides for a block during a rollout."""


def simulate_with_host_policy(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[jax.Array, " scenarios"],
    table: ReferenceTable,
    thresholds: Thresholds,
    make_policy: MakePolicy,
    model: TrafficModel,
    options: LoopOptions,
    *,
    n_seconds: int,
) -> Iterator[Simulated]:
    """Rollouts and their decisions, burst by burst."""
    n_scenarios = state.x.shape[-1]
    for start in range(0, n_scenarios, MAX_BURST):
        size = min(MAX_BURST, n_scenarios - start)
        columns = np.arange(start, start + size)
        burst_state, burst_drivers = select_scenarios((state, drivers), columns, n_scenarios, least_ndim=2)
        limits = select_scenarios(thresholds, columns, n_scenarios)
        length = np.asarray(lengths_of(burst_state, burst_drivers))
        half = math.ceil(size / 2)
        first_policy, second_policy = (
            make_policy(
                Block(
                    table,
                    model,
                    options,
                    Thresholds(limits.hellinger[part], limits.mape[part]),
                    length[:, part],
                    start + part.start,
                )
            )
            for part in (slice(0, half), slice(half, size))
        )
        frames, decisions = rollout_in_lockstep(
            burst_state,
            burst_drivers,
            keys[columns],
            table,
            limits,
            (first_policy, second_policy),
            model,
            options,
            n_seconds=n_seconds,
        )
        yield Simulated(frames, length, decisions)
