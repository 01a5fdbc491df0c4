"""Simulation of the rollouts of every method.

Initial states depend on the seed, the run and the scene alone, so they are the same for every method and batch size
(common random numbers), and differences between methods do not come from different starts.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.boundary import Boundary
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel, traffic_model
from rearl_jax.core.rollout import Frames, frame_of, rollout
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

POLICY_STREAM = 1
"""Separates the random numbers of a policy from those of the initial state."""

NEVER_EXCEEDED = (float("inf"), float("inf"))
"""Thresholds of Hellinger distance and spacing error that are never exceeded."""

FIXED_SPEED = 25.0
"""Speed of init.speed=fixed_25 [m/s]. Source: highway-env 1.12.1, `HighwayEnv._create_vehicles`."""


def simulate_base(state: TrafficState, drivers: Drivers, model: TrafficModel, n_seconds: int) -> Frames:
    """Frames of IDM and MOBIL traffic without interventions."""
    return rollout(state, drivers, model, n_seconds=n_seconds)[1]


class Simulated(eqx.Module):
    """Simulated rollouts.

    Attributes:
        frames: The traffic.
        length: Lengths of the vehicles [m].
        decisions: Detections and decisions; None if nothing is detected.
        actions: The action every vehicle followed in every second; None if no policy drives all vehicles.
    """

    frames: Frames
    length: Float[Array | np.ndarray, "vehicles scenarios"]
    decisions: Decisions | None = None
    actions: Int[Array | np.ndarray, "seconds vehicles scenarios"] | None = None


@dataclass(frozen=True)
class Interventions:
    """Options of the interventions that change the program: policy, detection, execution."""

    policy: PolicyName
    matcher: MatcherConfig
    loop: LoopOptions


def interventions(config: EvaluateTask) -> Interventions | None:
    """The interventions of the configured method; None if it does not intervene."""
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
    """Input from which a chunk of rollouts is computed; None for input that the method does not need.

    Attributes:
        starts: `seed`, `run` and `scene_id` of each rollout.
        measured: Initial states that are not drawn.
        references: Representative scenes; a last axis of length 1 means the same for all rollouts.
        thresholds: Thresholds of the Hellinger distance and of the spacing error.
        actor: The network that drives all vehicles; last axis as for the references.
        shares: Shares of aggressive and defensive drivers and of trucks.
        traffic: Drivers and effects that are not highway-env's; last axis as for the references.
        boundary: Recorded traffic around the vehicles of scenes; last axis as for the references, except of `scene`.
    """

    starts: Mapping[str, Array | np.ndarray]
    measured: TrafficState | None = None
    references: References | None = None
    thresholds: tuple[Array, Array] | None = None
    actor: Perceptron | None = None
    shares: Float[Array | np.ndarray, "classes rollouts"] | None = None
    traffic: Population | None = None
    boundary: Boundary | None = None

    def surroundings(self) -> Boundary | None:
        """Recorded traffic around the rollouts; the last axis of all fields except `scene` is that of the scenes."""
        if self.boundary is None:
            return None
        boundary = self.boundary
        motion, identity, entrants = _without_scenario_axis((boundary.motion, boundary.identity, boundary.entrants))
        return Boundary(motion, identity, entrants, jnp.asarray(boundary.scene))


def begin(
    batch: Batch, core: CoreConfig, speed: InitialSpeed, model: TrafficModel
) -> tuple[TrafficState, Drivers, Key[Array, " scenarios"]]:
    """Initial states, drivers and random keys of a chunk of rollouts."""
    keys = rollout_keys(batch.starts)
    state, drivers = spawn(
        keys,
        model,
        n_vehicles=core.n_vehicles,
        density=core.density,
        initial_speed=FIXED_SPEED if speed is InitialSpeed.fixed_25 else None,
        dtype=jnp.dtype(core.dtype.name),
    )
    if batch.measured is not None:
        state = batch.measured
    around = batch.surroundings()
    if around is not None:
        state = replace(state, n_crashed_replaced=jnp.zeros(state.x.shape, jnp.int32))
    if batch.traffic is not None:
        replayed = None if around is None else around.at_start()
        # The state of recorded vehicles holds their highest recorded speed as desired speed.
        highest = None if batch.measured is None else batch.measured.desired_speed
        population = _without_scenario_axis(batch.traffic)
        state, drivers = populate_by_model(state, drivers, keys, population, model, replayed, highest)
    if batch.shares is not None:
        state, drivers = populate(state, drivers, keys, jnp.asarray(batch.shares), model)
        if batch.measured is not None:
            wanted = jnp.minimum(state.desired_speed, batch.measured.desired_speed)
            state = replace(state, speed=batch.measured.speed, desired_speed=wanted)
    return state, drivers, keys


def _without_scenario_axis(values: Any) -> Any:
    """Values without their last axis of length 1, which means that they are the same for all scenarios."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf)[..., 0], values)


@functools.cache
def program(
    control: Interventions | DrivingOptions | None,
    core: CoreConfig,
    speed: InitialSpeed,
    n_seconds: int,
    cooperative: bool,
) -> ScenarioMap:
    """Program from seeds (and measured states) to rollouts; compiled once for all studies of a process."""
    # With cooperative=False, polite drivers would ignore what a lane change costs others.
    model = traffic_model(core, cooperative=cooperative)

    def simulate(batch: Batch) -> Simulated:
        state, drivers, keys = begin(batch, core, speed, model)
        length, around = lengths_of(state, drivers), batch.surroundings()
        if control is None and around is not None:
            frames = rollout(state, drivers, model, n_seconds=n_seconds - 1, boundary=around)[1]
            return Simulated(_from_start(state, frames, model), length)
        if control is None:
            return Simulated(simulate_base(state, drivers, model, n_seconds), length)
        if isinstance(control, DrivingOptions):
            actor = _without_scenario_axis(batch.actor)
            frames, actions = rollout_with_actor(state, drivers, actor, model, control, n_seconds=n_seconds)
            return Simulated(frames, length, actions=actions)
        assert batch.thresholds is not None  # given with the references
        acting = model_under_decisions(model, control.loop.execution.longitudinal)
        table = tabulate(_without_scenario_axis(batch.references), control.loop.detection.hist, state.x.dtype)
        policy, limits = make_policy(control.policy, control.matcher, acting), Thresholds(*batch.thresholds)
        arguments = state, drivers, decision_keys(keys), table, limits, policy, acting, control.loop
        if around is not None:
            _, frames, decisions = rollout_with_policy(*arguments, n_seconds=n_seconds - 1, boundary=around)
            return Simulated(_from_start(state, frames, acting), length, decisions)
        _, frames, decisions = rollout_with_policy(*arguments, n_seconds=n_seconds)
        return Simulated(frames, length, decisions)

    return ScenarioMap(simulate, chunk=core.chunk)


def _from_start(state: TrafficState, frames: Frames, model: TrafficModel) -> Frames:
    """Frames at the times of the recorded snapshots, at which vehicles enter: that of the start, then the others."""
    return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), frame_of(state, model), frames)


def lengths_of(state: TrafficState, drivers: Drivers) -> Float[Array, "vehicles scenarios"]:
    """Lengths of the vehicles [m]; `drivers` may hold one length for all vehicles."""
    return jnp.broadcast_to(drivers.body.length, state.x.shape)


def decision_keys(keys: Key[Array, " scenarios"]) -> Key[Array, " scenarios"]:
    """Random keys of the decisions, from those of the rollouts."""
    return jax.vmap(lambda key: jax.random.fold_in(key, POLICY_STREAM))(keys)


@functools.cache
def start_program(core: CoreConfig, speed: InitialSpeed, detection: DetectionOptions) -> Callable[[Batch], tuple]:
    """Program with which rollouts decided on the host begin; compiled once for all studies of a process.

    From a batch it computes initial states, drivers, random keys of the decisions and the table of the references.
    """

    def start(batch: Batch) -> tuple:
        state, drivers, keys = begin(batch, core, speed, traffic_model(core))
        table = tabulate(_without_scenario_axis(batch.references), detection.hist, state.x.dtype)
        return state, drivers, decision_keys(keys), table

    return jax.jit(start)
