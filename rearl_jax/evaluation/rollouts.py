"""Where rollouts begin and how they are simulated; what a method is.

Initial states depend on the seed, the run and the scene alone: every method and every batch size sees the
same ones (common random numbers), so that differences between methods are not differences of luck.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, Key

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.driving import DrivingOptions, rollout_with_actor
from rearl_jax.baselines.network import Perceptron
from rearl_jax.baselines.weights import TrainedPolicy, load_policy
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import CoreConfig, InitialSource, InitialSpeed
from rearl_jax.config.decision import Longitudinal, MatcherConfig, PolicyName
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.road import traffic_model
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import TrafficState, make_state
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.decision.loop import Decisions, LoopOptions, rollout_with_policy
from rearl_jax.decision.policies import make_policy
from rearl_jax.detection.detector import Thresholds, detection_options
from rearl_jax.detection.references import References
from rearl_jax.detection.table import tabulate

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


SIMULATORS: dict[Method, Simulator] = {Method.base: simulate_base}
"""How each method without interventions simulates a batch of scenarios."""


class Simulated(eqx.Module):
    """Rollouts: the traffic, what was decided about it (None where nothing is detected), and the action every vehicle
    followed in every second (None where no policy drives them all).
    """

    frames: Frames
    decisions: Decisions | None
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


def rollout_key(seed: Int[Array, ""], run: Int[Array, ""], scene_id: Int[Array, ""]) -> PRNGKey:
    """Random key of a rollout: seed, run and scene folded into one."""
    return jax.random.fold_in(jax.random.fold_in(jax.random.key(seed), run), scene_id)


def measured_state(scenes: SceneSet, core: CoreConfig) -> TrafficState:
    """States with the vehicles of every scene's first snapshot, `[n_vehicles, n_scenes]`.

    x = position along the own driving direction less the least one of the scene, so the carriageways lie side
    by side and everybody drives towards larger x; lane = lane within the carriageway plus, on carriageway 2,
    the number of lanes of carriageway 1; speed = rescaled speed, which is the desired speed too, as
    highway-env sets it.

    Raises:
        ValueError: The simulated road has too few lanes or another number of vehicles, or a lane is unknown.
    """
    if core.n_vehicles != scenes.n_slots:
        raise ValueError(
            f"init.source=scene starts from the {scenes.n_slots} vehicles of a snapshot, but core.n_vehicles "
            f"is {core.n_vehicles}: set core.n_vehicles={scenes.n_slots} (or scenes.slots)"
        )
    if (scenes.lane[:, 0] < 0).any():
        raise ValueError("init.source=scene needs the lane of every vehicle; these recordings lack some")
    lanes = {info.id: info.lane_count for info in scenes.infos}
    first = np.array([lanes[name].get(1, 0) for name in scenes.recording.tolist()])
    lane = scenes.lane[:, 0] + np.where(scenes.direction[:, 0] == 2, first[:, None], 0)
    n_lanes = int(lane.max()) + 1
    if n_lanes > core.n_lanes:
        raise ValueError(
            f"init.source=scene needs a road of {n_lanes} lanes for these recordings, but core.n_lanes is "
            f"{core.n_lanes}: set core.n_lanes={n_lanes}"
        )
    position = scenes.position[:, 0]
    model = traffic_model(core)
    return make_state(
        (position - position.min(axis=1, keepdims=True)).T,
        lane.T * model.lane_width,
        scenes.scaled_speed[:, 0].T,
        model,
        dtype=np.dtype(core.dtype.name).type,
    )


class Rollouts:
    """The rollouts of an evaluation: numbers, so that a million of them take no memory; all else follows from them.

    They are ordered by thresholds, then by run, then by scene.
    """

    def __init__(
        self,
        config: EvaluateTask,
        scenes: SceneSet,
        held_out: np.ndarray,
        references: References | None = None,
        thresholds: Sequence[tuple[float, float]] = (NEVER,),
    ) -> None:
        """Counts the rollouts; nothing is simulated yet.

        Args:
            config: Method, road, initial states, runs and seeds.
            scenes: All scenes.
            held_out: Indices of those to be simulated.
            references: Representative scenes, for methods that intervene.
            thresholds: Of the Hellinger distance and of the spacing error, for methods that intervene; every pair gets
                the same rollouts.
        """
        self._config, self._n_seconds = config, scenes.seconds
        is_shared = config.eval.seed_scope is SeedScope.run
        self._served = held_out[:1] if is_shared else held_out
        self._scene_id = np.zeros(1, np.int32) if is_shared else scenes.scene_id[held_out].astype(np.int32)
        self._n_runs = config.eval.n_runs
        self._numbers = range(len(thresholds) * self._n_runs * len(self._served))
        self._references = self._thresholds = None
        self._policy: TrainedPolicy | None = None
        if config.method is Method.ppo:
            self._policy = load_policy(config.ppo.weights, config.core)
        if config.method.needs_references:
            if references is None:
                raise ValueError(f"method={config.method.name} needs references to hold the traffic against")
            # A last axis of length 1: the same for all scenarios.
            self._references = jax.tree.map(lambda leaf: np.asarray(leaf)[..., None], references)
            self._thresholds = np.array(thresholds, config.core.dtype.name).T
        self._state = None
        if config.init.source is InitialSource.scene:
            if is_shared:
                raise ValueError(
                    "init.source=scene starts every rollout from its own scene: set eval.seed_scope=run_x_scene"
                )
            self._state = jax.tree.map(np.asarray, measured_state(scenes.select(held_out), config.core))

    @property
    def policy(self) -> TrainedPolicy | None:
        """Who drives all vehicles, None for nobody."""
        return self._policy

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, part: slice) -> "Rollouts":
        """Some of them."""
        some = copy(self)
        some._numbers = self._numbers[part]
        return some

    @property
    def cell(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the thresholds of each rollout."""
        return self._index // (self._n_runs * len(self._served))

    @property
    def run(self) -> Int[np.ndarray, " rollouts"]:
        """Run of each rollout."""
        return (self._index // len(self._served) % self._n_runs).astype(np.int32)

    @property
    def scene(self) -> Int[np.ndarray, " rollouts"]:
        """Index of the scene of each rollout; with eval.seed_scope=run every rollout serves all scenes."""
        return self._served[self._column]

    @property
    def _column(self) -> Int[np.ndarray, " rollouts"]:
        """Place of each rollout's scene among those served."""
        return self._index % len(self._served)

    @property
    def _index(self) -> Int[np.ndarray, " rollouts"]:
        return np.arange(self._numbers.start, self._numbers.stop, self._numbers.step)

    def chunks(self, width: int) -> Iterator[Simulated]:
        """Rollouts chunk by chunk, scenarios in the order of `run` and `scene`.

        Args:
            width: Scenarios a device takes at a time.
        """
        config = self._config
        policy = self._policy
        acts = interventions(config) if policy is None else policy.options
        simulate = _program(config.method, acts, config.core, config.init.speed, self._n_seconds, width)
        column = self._column
        starts = {
            "seed": np.full(len(self), config.eval.seed, np.int32),
            "run": self.run,
            "scene_id": self._scene_id[column],
        }
        state = jax.tree.map(lambda leaf: leaf[..., column], self._state)
        thresholds = None if self._thresholds is None else tuple(self._thresholds[:, self.cell])
        # A last axis of length 1: the same for all scenarios.
        actor = None if policy is None else jax.tree.map(lambda leaf: leaf[..., None], policy.network.actor)
        return simulate.chunks((starts, state, self._references, thresholds, actor))


_Batch: TypeAlias = tuple[
    dict[str, Array], TrafficState | None, References | None, tuple[Array, Array] | None, Perceptron | None
]
"""What a chunk of rollouts is computed from, as far as used: seeds, measured states, references, thresholds, and the
network that drives.
"""


@functools.cache
def _program(
    method: Method,
    acts: Interventions | DrivingOptions | None,
    core: CoreConfig,
    speed: InitialSpeed,
    n_seconds: int,
    width: int,
) -> ScenarioMap:
    """Compiled once for all studies of a process: from seeds (and measured states) to rollouts."""
    model = traffic_model(core)

    def simulate(batch: _Batch) -> Simulated:
        starts, measured, references, thresholds, actor = batch
        keys = jax.vmap(rollout_key)(starts["seed"], starts["run"], starts["scene_id"])
        state, drivers = spawn(
            keys,
            model,
            n_vehicles=core.n_vehicles,
            density=core.density,
            initial_speed=FIXED_SPEED if speed is InitialSpeed.fixed_25 else None,
            dtype=jnp.dtype(core.dtype.name),
        )
        state = state if measured is None else measured
        if isinstance(acts, DrivingOptions):
            assert actor is not None  # loaded with its options
            actor = jax.tree.map(lambda leaf: leaf[..., 0], actor)
            frames, actions = rollout_with_actor(state, drivers, actor, model, acts, n_seconds=n_seconds)
            return Simulated(frames, None, actions)
        if acts is None or references is None or thresholds is None:
            return Simulated(SIMULATORS[method](state, drivers, model, n_seconds), None)
        references = jax.tree.map(lambda leaf: leaf[..., 0], references)
        return simulate_rearl(state, drivers, keys, references, Thresholds(*thresholds), acts, model, n_seconds)

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
) -> Simulated:
    """Rollouts of IDM and MOBIL traffic with interventions.

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
    model = replace(model, meta_follows=acts.loop.execution.longitudinal is Longitudinal.idm_capped)
    policy_keys = jax.vmap(lambda key: jax.random.fold_in(key, POLICY_STREAM))(keys)
    table = tabulate(references, acts.loop.detection.hist, state.x.dtype)
    policy = make_policy(acts.policy, acts.matcher, model)
    _, frames, decisions = rollout_with_policy(
        state, drivers, policy_keys, table, thresholds, policy, model, acts.loop, n_seconds=n_seconds
    )
    return Simulated(frames, decisions)
