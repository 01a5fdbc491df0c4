"""The closed loop: simulates a second, compares the traffic with the reference, decides, and continues.

`assess` and `advance` are the two halves around a decision. `rollout_with_policy` runs them with a policy inside one
compiled scan; a policy outside the program (a language model) is called by the host between the same two.
"""

import dataclasses
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.config.decision import AdmissibleConfig, ExecConfig
from rearl_jax.core.boundary import Boundary, BoundarySecond
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, frame_of, simulate_second
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.admissible import admissible_actions
from rearl_jax.decision.execution import (
    DecisionMemory,
    Orders,
    accept,
    count,
    execute,
    forget,
    initial_decision_memory,
    no_orders,
    record_lane_changes,
)
from rearl_jax.decision.situation import N_ACTIONS, Policy, Situation
from rearl_jax.detection.detector import DetectionOptions, DetectorMemory, Thresholds, detect, initial_memory
from rearl_jax.detection.table import ReferenceTable


@dataclasses.dataclass(frozen=True)
class LoopOptions:
    """Static options of the closed loop: a changed value compiles the loop again."""

    detection: DetectionOptions = dataclasses.field(default_factory=DetectionOptions)
    admissible: AdmissibleConfig = dataclasses.field(default_factory=AdmissibleConfig)
    execution: ExecConfig = dataclasses.field(default_factory=ExecConfig)


class LoopState(eqx.Module):
    """State of the closed loop between two seconds.

    Attributes:
        state: The vehicles.
        detector: Memory of the detection about earlier seconds.
        memory: Memory of the execution of decisions about earlier seconds.
    """

    state: TrafficState
    detector: DetectorMemory
    memory: DecisionMemory


class Decisions(eqx.Module):
    """Detection results and counts of decisions of each second; the record of one second has no axis of seconds.

    Detection results are those at the end of the second, counts are of the decisions executed during it. Hence the
    first second has no decisions, and the last detection has no consequences.

    Attributes:
        reference: Index of the reference that the scenario is compared with.
        hellinger: Hellinger distance of the speeds of the window and those of the reference [-]; 0 before the first
            full window.
        mape: Relative difference of the mean spacing from that of the reference [-].
        triggered: Whether the scenario needs decisions.
        n_asked: Vehicles that needed a decision.
        n_accepted: Vehicles that follow each action, in the order of `MetaAction`.
        n_inadmissible: Vehicles whose answer was not admissible.
        n_invalid: Vehicles without a valid answer.
    """

    reference: Int[Array, "*seconds scenarios"]
    hellinger: Float[Array, "*seconds scenarios"]
    mape: Float[Array, "*seconds scenarios"]
    triggered: Bool[Array, "*seconds scenarios"]
    n_asked: Int[Array, "*seconds scenarios"]
    n_accepted: Int[Array, "*seconds actions scenarios"]
    n_inadmissible: Int[Array, "*seconds scenarios"]
    n_invalid: Int[Array, "*seconds scenarios"]


def initial_loop_state(
    state: TrafficState,
    keys: Key[Array, " scenarios"],
    table: ReferenceTable,
    model: TrafficModel,
    options: LoopOptions,
) -> LoopState:
    """The loop before the first second.

    Args:
        state: Initial state.
        keys: Random keys of the rollouts, from which references are drawn in `ReferenceMode.drawn`.
        table: References to compare with.
        model: Road, clock and stages.
        options: Static options.
    """
    return LoopState(
        state=state,
        detector=initial_memory(table, keys, options.detection),
        memory=initial_decision_memory(state, model),
    )


def advance(
    loop: LoopState,
    orders: Orders,
    drivers: Drivers,
    model: TrafficModel,
    options: LoopOptions,
    boundary_second: BoundarySecond | None = None,
) -> LoopState:
    """State of the loop after the orders were executed and one second was simulated: the step after a decision.

    Arguments as in `simulate_second`. The memory of decisions is reset for vehicles that have entered.
    """
    state, memory = execute(loop.state, loop.memory, orders, model, options.execution)
    state = simulate_second(state, drivers, model, boundary_second)
    memory = record_lane_changes(memory, state, model)
    if boundary_second is not None:
        memory = forget(memory, boundary_second.entrants.is_new, state, model)
    return LoopState(state, loop.detector, memory)


def assess(
    loop: LoopState,
    drivers: Drivers,
    table: ReferenceTable,
    thresholds: Thresholds,
    model: TrafficModel,
    options: LoopOptions,
    boundary_second: BoundarySecond | None = None,
) -> tuple[LoopState, Situation]:
    """State of the loop after the detection, and the situation for a policy: the step before a decision.

    Call it once for every simulated second. Replayed vehicles limit the admissible actions; the detection ignores them.
    """
    state, frame = loop.state, frame_of(loop.state, model)
    detector, detection = detect(loop.detector, frame, table, thresholds, options.detection)
    situation = Situation(
        second=loop.detector.second,  # the second just detected; `detector` has the next
        frame=frame,
        target_lane=state.target_lane,
        detection=detection,
        admissible=admissible_actions(
            state, drivers, model, options.admissible, None if boundary_second is None else boundary_second.after
        ),
        since_lane_change=loop.memory.since_lane_change,
        last_action=loop.memory.last_action,
    )
    return eqx.tree_at(lambda loop: loop.detector, loop, detector), situation


def decisions_of(orders: Orders, situation: Situation) -> Decisions:
    """Record of a second in which orders were followed, with the situation at its end."""
    detection = situation.detection
    return Decisions(
        reference=detection.reference,
        hellinger=detection.hellinger,
        mape=detection.mape,
        triggered=detection.triggered,
        n_asked=count(orders.is_asked),
        n_accepted=jnp.stack([count(orders.action == action) for action in range(N_ACTIONS)]),
        n_inadmissible=orders.n_inadmissible,
        n_invalid=orders.n_invalid,
    )


_Carry: TypeAlias = tuple[LoopState, Orders]


def rollout_with_policy(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    table: ReferenceTable,
    thresholds: Thresholds,
    policy: Policy,
    model: TrafficModel,
    options: LoopOptions,
    *,
    n_seconds: int,
    boundary: Boundary | None = None,
) -> tuple[TrafficState, Frames, Decisions]:
    """State after some seconds, a frame after each of them, and what was detected and decided.

    If no vehicle ever needs a decision, the frames are those of `core.rollout.rollout`, bit for bit.

    Args:
        state: Initial state.
        drivers: Parameters of all vehicles.
        keys: Random keys, one per scenario. A key for the policy is derived from each of them every second, and
            another one for drawing references.
        table: References to compare with.
        thresholds: Detection thresholds of every scenario.
        policy: Policy that decides.
        model: Road, clock and stages.
        options: Static options.
        n_seconds: Seconds to simulate [s].
        boundary: Recorded traffic around the simulated vehicles; None for a free road.

    Raises:
        ValueError: The references or the boundary are shorter than the rollout.
    """
    require_references_for(table, n_seconds)
    if boundary is not None:
        boundary.require_seconds(n_seconds)
    # As in `core.rollout.rollout`: constants of a new state, folded into the loop, would change the last bits.
    state, drivers = lax.optimization_barrier((state, drivers))

    def simulate_and_decide(carry: _Carry, second: Int[Array, ""]) -> tuple[_Carry, tuple[Frames, Decisions]]:
        loop, orders = carry
        boundary_second = None if boundary is None else boundary.second(second)
        loop = advance(loop, orders, drivers, model, options, boundary_second)
        loop, situation = assess(loop, drivers, table, thresholds, model, options, boundary_second)
        second_keys = jax.vmap(lambda key: jax.random.fold_in(key, second))(keys)
        answers = policy(situation, table, second_keys)
        next_orders = accept(answers, situation.is_asked, situation.admissible)
        return (loop, next_orders), (situation.frame, decisions_of(orders, situation))

    start = initial_loop_state(state, keys, table, model, options), no_orders(state)
    (loop, _), (frames, decisions) = lax.scan(simulate_and_decide, start, jnp.arange(n_seconds, dtype=jnp.int32))
    return loop.state, frames, decisions


def require_references_for(table: ReferenceTable, n_seconds: int) -> None:
    """Raise ValueError if a rollout is longer than the references."""
    if n_seconds > table.n_seconds:
        raise ValueError(
            f"n_seconds = {n_seconds} exceeds the {table.n_seconds} s of the references: there is nothing to compare "
            "the later seconds with. Simulate fewer, or build references from longer scenes"
        )
