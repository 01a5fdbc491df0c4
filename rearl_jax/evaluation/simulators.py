"""How rollouts are simulated; what a method is.

Initial states depend on the seed, the run and the scene alone: every method and every batch size sees the
same ones (common random numbers), so that differences between methods are not differences of luck.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.critical.classes import populate
from rearl_jax.baselines.driving import DrivingOptions, rollout_with_actor
from rearl_jax.baselines.network import Perceptron
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import CoreConfig, InitialSpeed
from rearl_jax.config.decision import MatcherConfig, PolicyName
from rearl_jax.config.evaluation import Method
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.road import traffic_model
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import TrafficState
from rearl_jax.decision.execution import model_under_decisions
from rearl_jax.decision.loop import Decisions, LoopOptions, rollout_with_policy
from rearl_jax.decision.policies import make_policy
from rearl_jax.detection.detector import DetectionOptions, Thresholds, detection_options
from rearl_jax.detection.references import References
from rearl_jax.detection.table import tabulate
from rearl_jax.models.population import Population
from rearl_jax.models.traffic import populate as populate_by_model

Simulator: TypeAlias = Callable[[TrafficState, Drivers, TrafficModel, int], Frames]
"""From initial states, drivers, the road and a number of seconds to the frame after each second."""

POLICY_STREAM = 1
"""Separates the random numbers of a policy from those of the initial state."""

NEVER = (float("inf"), float("inf"))
"""Thresholds that nothing passes."""

FIXED_SPEED = 25.0
"""Speed of init.speed=fixed_25 [m/s]. Source: highway-env 1.12.1, `HighwayEnv._create_vehicles`."""


def simulate_base(state: TrafficState, drivers: Drivers, model: TrafficModel, n_seconds: int) -> Frames:
    """Frames of IDM and MOBIL traffic that nobody interferes with."""
    return rollout(state, drivers, model, n_seconds=n_seconds)[1]


SIMULATORS: dict[Method, Simulator] = {Method.base: simulate_base, Method.critical: simulate_base}
"""How each method without interventions simulates a batch of scenarios."""


class Simulated(eqx.Module):
    """Rollouts.

    Attributes:
        frames: The traffic.
        length: Lengths of the vehicles [m].
        decisions: What was decided about it; None where nothing is detected.
        actions: The action every vehicle followed in every second; None where no policy drives them all.
    """

    frames: Frames
    length: Float[Array | np.ndarray, "vehicles scenarios"]
    decisions: Decisions | None = None
    actions: Int[Array | np.ndarray, "seconds vehicles scenarios"] | None = None


@dataclass(frozen=True)
class Interventions:
    """What of the interventions changes the program: policy, detection, execution."""

    policy: PolicyName
    matcher: MatcherConfig
    loop: LoopOptions


def interventions(config: EvaluateTask) -> Interventions | None:
    """The interventions of the configured method, None for none."""
    if not config.method.needs_references:
        return None
    detection = detection_options(config.detection, config.reference, config.hist, config.mape, config.spacing)
    loop = LoopOptions(detection, config.admissible, config.exec)
    return Interventions(config.decision.policy, config.matcher, loop)


def rollout_keys(starts: Mapping[str, Array | np.ndarray]) -> Key[Array, " scenarios"]:
    """Random keys of rollouts with the given `seed`, `run` and `scene_id`."""
    seed, run, scene_id = (jnp.asarray(starts[name]) for name in ("seed", "run", "scene_id"))
    return jax.vmap(rollout_key)(seed, run, scene_id)


def rollout_key(seed: Int[Array, ""], run: Int[Array, ""], scene_id: Int[Array, ""]) -> PRNGKey:
    """Random key of a rollout: seed, run and scene folded into one."""
    return jax.random.fold_in(jax.random.fold_in(jax.random.key(seed), run), scene_id)


class Batch(NamedTuple):
    """What a chunk of rollouts is computed from; None what the method does without.

    Attributes:
        starts: `seed`, `run` and `scene_id` of each.
        measured: Initial states that are not drawn.
        references: Representative scenes; a last axis of length 1 means the same for all rollouts.
        thresholds: Of the Hellinger distance and of the spacing error.
        actor: The network that drives everybody; last axis as of the references.
        shares: Of aggressive and defensive drivers and of trucks.
        traffic: Drivers and effects that are not highway-env's; last axis as of the references.
    """

    starts: Mapping[str, Array | np.ndarray]
    measured: TrafficState | None = None
    references: References | None = None
    thresholds: tuple[Array, Array] | None = None
    actor: Perceptron | None = None
    shares: Float[Array | np.ndarray, "classes rollouts"] | None = None
    traffic: Population | None = None


def begin(
    starts: Mapping[str, Array | np.ndarray],
    measured: TrafficState | None,
    core: CoreConfig,
    speed: InitialSpeed,
    traffic: Population | None = None,
) -> tuple[TrafficState, Drivers, Key[Array, " scenarios"]]:
    """Initial states, drivers and random keys of rollouts.

    Args:
        starts: `seed`, `run` and `scene_id` of each.
        measured: Initial states that are not drawn.
        core: The road and its vehicles.
        speed: How initial speeds are drawn.
        traffic: Drivers and effects, its leaves with a last axis of length 1; None for highway-env's.
    """
    keys = rollout_keys(starts)
    state, drivers = spawn(
        keys,
        traffic_model(core),
        n_vehicles=core.n_vehicles,
        density=core.density,
        initial_speed=FIXED_SPEED if speed is InitialSpeed.fixed_25 else None,
        dtype=jnp.dtype(core.dtype.name),
    )
    state = state if measured is None else measured
    if traffic is not None:
        numbers = jax.tree.map(lambda leaf: jnp.asarray(leaf)[..., 0], traffic)
        state, drivers = populate_by_model(state, drivers, keys, numbers, traffic_model(core))
    return state, drivers, keys


def populated(
    batch: Batch, core: CoreConfig, speed: InitialSpeed, model: TrafficModel
) -> tuple[TrafficState, Drivers, Key[Array, " scenarios"]]:
    """Initial states, drivers and random keys of a chunk, with the classes of drivers where there are any.

    Args:
        batch: What the chunk is computed from.
        core: The road and its vehicles.
        speed: How initial speeds are drawn.
        model: The road.
    """
    state, drivers, keys = begin(batch.starts, batch.measured, core, speed, batch.traffic)
    if batch.shares is None:
        return state, drivers, keys
    measured_speed = state.speed
    state, drivers = populate(state, drivers, keys, jnp.asarray(batch.shares), model)
    if batch.measured is not None:
        state = replace(state, speed=measured_speed)
    return state, drivers, keys


@functools.cache
def program(
    method: Method,
    acts: Interventions | DrivingOptions | None,
    core: CoreConfig,
    speed: InitialSpeed,
    n_seconds: int,
    width: int,
    cooperative: bool,
) -> ScenarioMap:
    """Compiled once for all studies of a process: from seeds (and measured states) to rollouts."""
    # Without it, what a lane change costs others would be nothing to polite drivers.
    model = traffic_model(core, cooperative=cooperative)

    def simulate(batch: Batch) -> Simulated:
        references, thresholds = batch.references, batch.thresholds
        state, drivers, keys = populated(batch, core, speed, model)
        length = lengths_of(state, drivers)
        if isinstance(acts, DrivingOptions):
            assert batch.actor is not None  # loaded with its options
            actor = jax.tree.map(lambda leaf: leaf[..., 0], batch.actor)
            frames, actions = rollout_with_actor(state, drivers, actor, model, acts, n_seconds=n_seconds)
            return Simulated(frames, length, actions=actions)
        if acts is None or references is None or thresholds is None:
            return Simulated(SIMULATORS[method](state, drivers, model, n_seconds), length)
        references = jax.tree.map(lambda leaf: leaf[..., 0], references)
        limits = Thresholds(*thresholds)
        frames, decisions = simulate_rearl(state, drivers, keys, references, limits, acts, model, n_seconds)
        return Simulated(frames, length, decisions)

    return ScenarioMap(simulate, chunk=width)


def simulate_rearl(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    references: References,
    thresholds: Thresholds,
    acts: Interventions,
    model: TrafficModel,
    n_seconds: int,
) -> tuple[Frames, Decisions]:
    """Frames of IDM and MOBIL traffic with interventions, and what was decided about it.

    Args:
        state: Initial states.
        drivers: Parameters of all vehicles.
        keys: Random keys of the rollouts.
        references: Representative scenes.
        thresholds: Of every scenario.
        acts: Policy, detection, execution.
        model: Road, clock and stages of the same traffic without interventions.
        n_seconds: Seconds to simulate [s].
    """
    model = model_under_decisions(model, acts.loop.execution.longitudinal)
    table = tabulate(references, acts.loop.detection.hist, state.x.dtype)
    policy = make_policy(acts.policy, acts.matcher, model)
    _, frames, decisions = rollout_with_policy(
        state, drivers, decision_keys(keys), table, thresholds, policy, model, acts.loop, n_seconds=n_seconds
    )
    return frames, decisions


def lengths_of(state: TrafficState, drivers: Drivers) -> Float[Array, "vehicles scenarios"]:
    """Lengths of the vehicles [m], which drivers may share."""
    return jnp.broadcast_to(drivers.body.length, state.x.shape)


def decision_keys(keys: Key[Array, " scenarios"]) -> Key[Array, " scenarios"]:
    """Random keys of the decisions, from those of the rollouts."""
    return jax.vmap(lambda key: jax.random.fold_in(key, POLICY_STREAM))(keys)


@functools.cache
def beginnings(core: CoreConfig, speed: InitialSpeed, detection: DetectionOptions) -> Callable[..., tuple]:
    """Compiled once for all studies of a process: what rollouts need that are decided about outside the program.

    From seeds, measured states, references and the traffic model to initial states, drivers, keys of the decisions and
    the references' table.
    """

    def start(
        starts: dict[str, Array],
        measured: TrafficState | None,
        references: References,
        traffic: Population | None,
    ) -> tuple:
        state, drivers, keys = begin(starts, measured, core, speed, traffic)
        return state, drivers, decision_keys(keys), tabulate(references, detection.hist, state.x.dtype)

    return jax.jit(start)
