"""Consecutive decision steps as subjects of a measurement: Base, PPO, the closed loop, and parts of the loop alone.

References are synthetic, so that no data are read.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Key

from rearl_jax.baselines.driving import rollout_with_actor
from rearl_jax.baselines.weights import load_policy
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.decision import ExecConfig, MatcherConfig, MatchSpace, PolicyName
from rearl_jax.config.detection import Cues
from rearl_jax.config.study import StepsConfig
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, frame_of, rollout, simulate_second
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.admissible import admissible_actions
from rearl_jax.decision.execution import Orders, accept, count, model_under_decisions, no_orders
from rearl_jax.decision.loop import (
    Decisions,
    LoopOptions,
    LoopState,
    assess,
    decisions_of,
    initial_loop_state,
    rollout_with_policy,
)
from rearl_jax.decision.policies import make_policy
from rearl_jax.decision.situation import Policy, Situation
from rearl_jax.detection.detector import DetectionOptions, DetectorMemory, Thresholds, detect, initial_memory
from rearl_jax.detection.table import ReferenceTable, tabulate
from rearl_jax.timing.batches import Batches, Subject
from rearl_jax.timing.measurement import TICKS_PER_SECOND, Series
from rearl_jax.timing.process import open_sessions
from rearl_jax.timing.synthetic_references import synthetic_references
from rearl_jax.timing.turns import Report, take_turns, warm_up

BASE = "base"
"""IDM and MOBIL alone."""

PPO = "ppo"
"""All vehicles controlled by the shipped trained policy."""

LOOP, DETECTION, DECISION = "loop", "detection", "decision"
"""Whole steps of the closed loop with the matcher by rank; only the detection, on recorded traffic; only the part after
the detection (admissible actions, policy, orders), on recorded traffic.
"""

PARTS = (BASE, PPO, LOOP, DETECTION, DECISION)
"""Programs of the decision steps."""

PAPER_MS = {"idm_mobil": 0.461, "ppo": 15.898, "rearl": 86_241.0}
"""Inference time of 10 consecutive decisions [ms]. Source: REARL (Bi et al.), which does not state whether that is the
time of one decision or of all ten, and for how many vehicles.
"""

WARM_UP_SECONDS = 20
"""Simulated time before decision steps are measured [s], so that vehicles interact."""

BASE_MODEL = TrafficModel(ticks_per_second=TICKS_PER_SECOND)
"""The road with highway-env's traffic model."""

LOOP_MODEL = model_under_decisions(BASE_MODEL, ExecConfig().longitudinal)
"""The road of `BASE_MODEL` with the additional stages of a closed loop with default options."""

TRIGGER_ALWAYS = LoopOptions(DetectionOptions(cues=Cues.always))
"""The closed loop with default options, except that decisions are triggered every second."""


class Batch(eqx.Module):
    """Input of a program.

    Attributes:
        state: Initial traffic.
        drivers: Drivers of the traffic.
        keys: Random keys of the policy.
        table: The references.
        thresholds: Infinite thresholds, which no value exceeds.
        recorded: Traffic at the end of successive seconds, for programs that only evaluate it; else None.
        situations: Situations of that traffic as a policy sees them, for programs that only decide; else None.
    """

    state: TrafficState
    drivers: Drivers
    keys: Key[Array, " scenarios"]
    table: ReferenceTable
    thresholds: Thresholds
    recorded: TrafficState | None = None
    situations: Situation | None = None


@dataclasses.dataclass(frozen=True)
class Scenes:
    """Recipe of the batches: vehicles per scenario, highway-env's `vehicles_density` [-], references."""

    n_vehicles: int
    density: float
    table: ReferenceTable

    def draw(self, keys: Key[Array, " scenarios"]) -> Batch:
        """Traffic as highway-env places it, one scenario per key."""
        state, drivers = spawn(keys, BASE_MODEL, n_vehicles=self.n_vehicles, density=self.density)
        infinite = jnp.full(keys.shape, jnp.inf, state.x.dtype)
        return Batch(state, drivers, keys, self.table, Thresholds(infinite, infinite))

    def draw_recorded(self, keys: Key[Array, " scenarios"], n_seconds: int) -> Batch:
        """Batch of traffic after a warm-up and `n_seconds` recorded seconds; `state` is the traffic at their end."""
        batch = self.draw(keys)

        def second(state: TrafficState, _: None) -> tuple[TrafficState, TrafficState]:
            state = simulate_second(state, batch.drivers, BASE_MODEL)
            return state, state

        state, seconds = lax.scan(second, batch.state, None, length=WARM_UP_SECONDS + n_seconds)
        recorded = jax.tree.map(lambda leaf: leaf[WARM_UP_SECONDS:], seconds)
        return dataclasses.replace(batch, state=state, recorded=recorded)

    def draw_situations(self, keys: Key[Array, " scenarios"], n_seconds: int) -> Batch:
        """Batch as from `draw_recorded`, with the situations of a policy that decides every second."""
        batch = self.draw_recorded(keys, n_seconds)

        def second(loop: LoopState, state: TrafficState) -> tuple[LoopState, tuple[TrafficState, Situation]]:
            loop = dataclasses.replace(loop, state=state)
            loop, situation = assess(loop, batch.drivers, batch.table, batch.thresholds, LOOP_MODEL, TRIGGER_ALWAYS)
            return loop, (state, situation)

        start = initial_loop_state(batch.state, batch.keys, batch.table, LOOP_MODEL, TRIGGER_ALWAYS)
        recorded, situations = lax.scan(second, start, batch.recorded)[1]
        return dataclasses.replace(batch, recorded=recorded, situations=situations)


def synthetic_table(references: Mapping[str, int]) -> ReferenceTable:
    """The references of `synthetic_references` with these arguments, as the detection reads them."""
    return tabulate(synthetic_references(**references), DetectionOptions().hist)


def program_arguments(loop: StepsConfig, n_vehicles: int, seconds: int, batch: int) -> dict[str, Any]:
    """Arguments of a program for its process, except the name."""
    references = {
        "seed": loop.seed,
        "n_references": loop.n_references,
        "n_seconds": loop.reference_seconds,
        "n_vehicles": loop.reference_vehicles,
    }
    size = {"n_vehicles": n_vehicles, "seconds": seconds, "batch": batch}
    return {**size, "density": loop.density, "references": references}


def measure_steps(loop: StepsConfig, batch: int, report: Report) -> dict[str, Series]:
    """Series of consecutive decision steps, whole and in parts, measured in turn; each measurement is one call."""
    label = f"{loop.steps} decision steps, {batch} at a time"
    scene = program_arguments(loop, loop.steps_vehicles, loop.steps, batch)
    with open_sessions(f"{__name__}:decision_steps", PARTS, scene, label, report) as sessions:
        warm_up(sessions, loop.seed, label, report)
        n_scenarios = dict.fromkeys(sessions, batch)
        repetitions = loop.steps_repetitions
        return take_turns(sessions, loop.steps_vehicles, n_scenarios, repetitions, loop.seed, label, report)


def count_reports(loop: StepsConfig) -> int:
    """Number of steps of the progress bar: for every batch size all programs are compiled, warmed up and measured."""
    return len(loop.steps_batches) * len(PARTS) * (loop.steps_repetitions + 2)


def decision_steps(
    name: str, *, n_vehicles: int, density: float, seconds: int, batch: int, references: dict[str, int]
) -> Batches:
    """Some consecutive decision steps or a part of them, ready to be measured.

    Args:
        name: One of `PARTS`.
        n_vehicles: Vehicles per scenario.
        density: highway-env's `vehicles_density` [-].
        seconds: Number of steps of one second.
        batch: Scenarios at a time.
        references: Arguments of `synthetic_references`.

    Raises:
        ValueError: There is no such part.
    """
    if name not in PARTS:
        raise ValueError(f"there is no part {name!r} of a decision step: {', '.join(PARTS)}")
    scenes = Scenes(n_vehicles, density, synthetic_table(references))

    def prepare(keys: Key[Array, " scenarios"]) -> Batch:
        if name == DECISION:
            return scenes.draw_situations(keys, seconds)
        batch = scenes.draw_recorded(keys, seconds)
        return batch if name == DETECTION else dataclasses.replace(batch, recorded=None)

    if name == BASE:
        subject = rollout_subject(prepare, seconds)
    elif name == LOOP:
        subject = loop_subject(matcher(MatchSpace.rank), prepare, seconds)
    elif name == PPO:
        subject = _ppo_subject(prepare, seconds)
    else:
        run = run_detection if name == DETECTION else decide_in_situations
        observe = jax.vmap(partial(frame_of, model=BASE_MODEL))
        subject = Subject(prepare, run, lambda batch, _: observe(batch.recorded), lambda _: None)
    return Batches(subject, batch=batch, n_vehicles=n_vehicles, seconds=seconds)


def rollout_subject(prepare: Any, seconds: int) -> Subject:
    """Rollouts from prepared traffic without interventions."""

    def run_base(batch: Batch) -> Frames:
        return rollout(batch.state, batch.drivers, BASE_MODEL, n_seconds=seconds)[1]

    return Subject(prepare, run_base, lambda _, frames: frames, lambda _: None)


def loop_subject(policy: Policy, prepare: Any, seconds: int, cues: Cues = Cues.always) -> Subject:
    """Rollouts of the closed loop from prepared traffic."""
    options = LoopOptions(DetectionOptions(cues=cues))

    def run_loop(batch: Batch) -> tuple[Frames, Decisions]:
        _, frames, decisions = rollout_with_policy(
            batch.state,
            batch.drivers,
            batch.keys,
            batch.table,
            batch.thresholds,
            policy,
            LOOP_MODEL,
            options,
            n_seconds=seconds,
        )
        return frames, decisions

    return Subject(prepare, run_loop, lambda _, result: result[0], lambda result: result[1])


def _ppo_subject(prepare: Any, seconds: int) -> Subject:
    """Rollouts from prepared traffic in which the trained policy of the package drives all vehicles.

    Raises:
        FileNotFoundError: The installation lacks the weights.
    """
    policy = load_policy(None, CoreConfig())

    def run_ppo(batch: Batch) -> tuple[Frames, Array]:
        actor = jax.tree.map(jnp.asarray, policy.network.actor)
        return rollout_with_actor(batch.state, batch.drivers, actor, BASE_MODEL, policy.options, n_seconds=seconds)

    return Subject(prepare, run_ppo, lambda _, result: result[0], lambda _: None)


def matcher(space: MatchSpace) -> Policy:
    """The matcher with default options except the given space."""
    return make_policy(PolicyName.matcher, MatcherConfig(space=space), LOOP_MODEL)


def run_detection(batch: Batch) -> tuple[Array, ...]:
    """Results of the detection that a rollout uses, in each second of the recorded traffic."""

    def second(memory: DetectorMemory, state: TrafficState) -> tuple[DetectorMemory, tuple[Array, ...]]:
        # In a rollout the state is an array. Here it is a slice, which XLA would compute again for every use.
        frame = frame_of(lax.optimization_barrier(state), LOOP_MODEL)
        memory, detection = detect(memory, frame, batch.table, batch.thresholds, TRIGGER_ALWAYS.detection)
        return memory, (
            detection.reference,
            detection.hellinger,
            detection.mape,
            detection.triggered,
            count(detection.mask),
        )

    return lax.scan(second, initial_memory(batch.table, batch.keys, TRIGGER_ALWAYS.detection), batch.recorded)[1]


def decide_in_situations(batch: Batch) -> tuple[Orders, Decisions]:
    """Decisions in each second of the recorded traffic: admissible actions, policy, orders.

    As in a rollout, the orders of a second are carried to the next one. If they were used in the same second, XLA
    would compile another program, which takes 1.7 times as long on a CPU.
    """
    policy = matcher(MatchSpace.rank)
    # Prepared by `draw_situations`.
    assert batch.recorded is not None
    assert batch.situations is not None

    def second(orders: Orders, recorded: tuple[TrafficState, Situation]) -> tuple[Orders, Decisions]:
        state, situation = lax.optimization_barrier(recorded)
        admissible = admissible_actions(state, batch.drivers, LOOP_MODEL, TRIGGER_ALWAYS.admissible)
        situation = dataclasses.replace(situation, admissible=admissible)
        next_orders = accept(policy(situation, batch.table, batch.keys), situation.is_asked, admissible)
        return next_orders, decisions_of(orders, situation)

    return lax.scan(second, no_orders(batch.state), (batch.recorded, batch.situations))
