"""The closed loop with a host policy, one that decides outside the compiled program, in all scenarios at once.

The scenarios are simulated second by second in two interleaved halves: while the answers for one half are awaited, the
other half simulates its second and submits its situation. With an equal policy the result is that of
`loop.rollout_with_policy`, bit for bit: both call the same `advance`, `assess` and `accept`.
"""

import functools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, Key

from rearl_jax.core.batch import select_scenarios
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.execution import accept
from rearl_jax.decision.loop import (
    Decisions,
    LoopOptions,
    LoopState,
    advance,
    assess,
    decisions_of,
    initial_loop_state,
    require_references_for,
)
from rearl_jax.decision.situation import N_ACTIONS, NO_ACTION, Situation
from rearl_jax.detection.detector import Thresholds
from rearl_jax.detection.table import ReferenceTable


@runtime_checkable
class HostPolicy(Protocol):
    """A policy on the host that answers asynchronously.

    Each instance serves one half of the scenarios for a whole rollout and is called once per second, except after the
    last.
    """

    def ask(self, situation: Situation) -> Future[Int[np.ndarray, "vehicles scenarios"]]:
        """Future of an action for every vehicle, as from a `Policy`.

        Args:
            situation: The traffic at the end of a second; all leaves are NumPy arrays.
        """
        ...


def rollout_in_lockstep(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    table: ReferenceTable,
    thresholds: Thresholds,
    policies: tuple[HostPolicy, HostPolicy],
    model: TrafficModel,
    options: LoopOptions,
    *,
    n_seconds: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Frames, Decisions]:
    """A frame after each second, and the record of detection and decisions.

    Args:
        state: Initial state.
        drivers: Parameters of all vehicles.
        keys: Random keys, one per scenario, from which references are drawn in `ReferenceMode.drawn`.
        table: References.
        thresholds: Thresholds of every scenario.
        policies: Policies of the first and of the second half of the scenarios.
        model: Road, clock and stages.
        options: Static options of the loop.
        n_seconds: Seconds to simulate [s].
        progress: Called with the seconds done, both halves counted, and their total.

    Raises:
        ValueError: The references are shorter than the rollout.
    """
    require_references_for(table, n_seconds)
    n_scenarios = state.x.shape[-1]
    size = math.ceil(n_scenarios / 2)
    halves = []
    for half_number, policy in enumerate(policies):
        # For an odd number the second half is padded with the last scenario, so that one program serves both.
        columns = np.minimum(np.arange(half_number * size, (half_number + 1) * size), n_scenarios - 1)
        half_state, half_drivers = select_scenarios((state, drivers), columns, n_scenarios, least_ndim=2)
        limits = select_scenarios(thresholds, columns, n_scenarios)
        n_unpadded = min(size, n_scenarios - half_number * size)
        halves.append(_Half(half_state, half_drivers, limits, keys[columns], table, policy, model, options, n_unpadded))
    for second in range(n_seconds):
        for half_number, half in enumerate(halves):
            half.advance()
            if second < n_seconds - 1 and half.n_unpadded:
                half.ask()
            progress(2 * second + half_number + 1, 2 * n_seconds)
    return _joined([half.frames for half in halves]), _joined([half.decisions for half in halves])


@dataclass
class _Half:
    """Half of the scenarios, during the rollout.

    Attributes:
        n_unpadded: Number of scenarios without those that pad the half.
        pending: Future of the policy's answers about the last second; None before the first request.
        frames: The traffic after each second so far.
        decisions: Record of detection and decisions of each second so far.
    """

    state: TrafficState
    drivers: Drivers
    thresholds: Thresholds
    keys: Key[Array, " scenarios"]
    table: ReferenceTable
    policy: HostPolicy
    model: TrafficModel
    options: LoopOptions
    n_unpadded: int
    pending: "Future[np.ndarray] | None" = None
    frames: list[Frames] = field(default_factory=list)
    decisions: list[Decisions] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._begin, self._second = _programs(self.model, self.options)
        self._loop = self._begin(self.state, self.keys, self.table)
        shape = self.state.x.shape
        no_vehicle = jnp.zeros(shape, bool)
        self._asked, self._admissible = no_vehicle, jnp.broadcast_to(no_vehicle, (N_ACTIONS, *shape))
        self._nothing = np.full(shape, NO_ACTION, np.int32)

    def advance(self) -> None:
        """Waits for the answers and simulates the second in which they are followed."""
        answers = self._nothing.copy()
        if self.pending is not None:
            answers[:, : self.n_unpadded] = self.pending.result()
        self._loop, self._situation, decisions = self._second(
            self._loop, answers, self._asked, self._admissible, self.drivers, self.table, self.thresholds
        )
        self._asked, self._admissible = self._situation.detection.mask, self._situation.admissible
        self.frames.append(self._unpadded(self._situation.frame))
        self.decisions.append(self._unpadded(decisions))

    def ask(self) -> None:
        """Submits the situation at the end of the second to the policy."""
        self.pending = self.policy.ask(self._unpadded(self._situation))

    def _unpadded(self, values):
        """The scenarios without padding, as NumPy arrays; values without a scenario axis are unchanged."""
        return jax.tree.map(
            lambda leaf: np.asarray(leaf)[..., : self.n_unpadded] if leaf.ndim else np.asarray(leaf), values
        )


@functools.cache
def _programs(model: TrafficModel, options: LoopOptions) -> tuple[Callable[..., LoopState], Callable[..., tuple]]:
    """Functions for the initial state and for one second, compiled once for all rollouts of a process."""

    def second(
        loop: LoopState,
        answers: Int[Array, "vehicles scenarios"],
        is_asked: Bool[Array, "vehicles scenarios"],
        admissible: Bool[Array, "actions vehicles scenarios"],
        drivers: Drivers,
        table: ReferenceTable,
        thresholds: Thresholds,
    ) -> tuple[LoopState, Situation, Decisions]:
        orders = accept(answers, is_asked, admissible)
        loop = advance(loop, orders, drivers, model, options)
        loop, situation = assess(loop, drivers, table, thresholds, model, options)
        return loop, situation, decisions_of(orders, situation)

    begin = functools.partial(initial_loop_state, model=model, options=options)
    return jax.jit(begin), jax.jit(second)


def _joined(halves: Sequence[list]):
    """Records of each second of both halves as one record with the seconds first."""
    whole = [jax.tree.map(lambda *leaves: np.stack(leaves), *half) for half in halves]
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *whole)
