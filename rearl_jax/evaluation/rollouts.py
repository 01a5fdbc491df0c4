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
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import CoreConfig, InitialSource, InitialSpeed
from rearl_jax.config.decision import Longitudinal, MatcherConfig, PolicyName
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
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
    """Rollouts: the traffic, and what was decided about it (None where nobody decides)."""

    frames: Frames
    decisions: Decisions | None


@dataclass(frozen=True)
class Interventions:
    """What of the interventions changes the program: policy, detection, execution."""

    policy: PolicyName
    matcher: MatcherConfig
    loop: LoopOptions


def interventions(config: EvaluateTask) -> Interventions | None:
    """The interventions of the configured method, None for none."""
    if config.method is Method.base:
        return None
    detection = detection_options(config.detection, config.reference, config.hist, config.mape, config.spacing)
    loop = LoopOptions(detection, config.admissible, config.exec)
    return Interventions(config.decision.policy, config.matcher, loop)


def traffic_model(core: CoreConfig) -> TrafficModel:
    """The simulated road."""
    return TrafficModel(
        n_lanes=core.n_lanes,
        speed_limit=core.speed_limit,
        ticks_per_second=core.ticks_per_second,
        lane_changes=core.lane_changes,
        collisions=core.collisions,
    )


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
    """The rollouts of an evaluation.

    Attributes:
        scene: Index of the scene of each rollout; with eval.seed_scope=run every rollout serves all scenes.
        run: Run of each rollout.
        cell: Index of the thresholds of each rollout.
    """

    def __init__(
        self,
        config: EvaluateTask,
        scenes: SceneSet,
        held_out: np.ndarray,
        references: References | None = None,
        thresholds: Sequence[tuple[float, float]] = (NEVER,),
    ) -> None:
        """Lists the rollouts; nothing is simulated yet.

        Args:
            config: Method, road, initial states, runs and seeds.
            scenes: All scenes.
            held_out: Indices of those to be simulated.
            references: Representative scenes, for methods that intervene.
            thresholds: Of the Hellinger distance and of the spacing error, for methods that intervene; every pair gets
                the same rollouts.
        """
        self._config, self._n_seconds = config, scenes.seconds
        runs = np.arange(config.eval.n_runs, dtype=np.int32)
        is_shared = config.eval.seed_scope is SeedScope.run
        served = held_out[:1] if is_shared else held_out
        n = len(runs) * len(served)
        self.cell = np.repeat(np.arange(len(thresholds)), n)
        self.run = np.tile(np.repeat(runs, len(served)), len(thresholds))
        self.scene = np.tile(served, len(runs) * len(thresholds))
        scene_id = np.zeros_like(self.scene) if is_shared else scenes.scene_id[self.scene]
        self._starts = {
            "seed": np.full(len(self.run), config.eval.seed, np.int32),
            "run": self.run,
            "scene_id": scene_id.astype(np.int32),
        }
        self._references = self._thresholds = None
        if config.method is not Method.base:
            if references is None:
                raise ValueError(f"method={config.method.name} needs references to hold the traffic against")
            # A last axis of length 1: the same for all scenarios.
            self._references = jax.tree.map(lambda leaf: np.asarray(leaf)[..., None], references)
            kind = np.dtype(config.core.dtype.name)
            self._thresholds = tuple(np.array(values, kind)[self.cell] for values in zip(*thresholds, strict=True))
        self._state = None
        if config.init.source is InitialSource.scene:
            if is_shared:
                raise ValueError(
                    "init.source=scene starts every rollout from its own scene: set eval.seed_scope=run_x_scene"
                )
            state = measured_state(scenes.select(held_out), config.core)
            columns = np.searchsorted(held_out, self.scene)
            self._state = jax.tree.map(lambda leaf: np.asarray(leaf)[..., columns], state)

    def __len__(self) -> int:
        return len(self.run)

    def __getitem__(self, part: slice) -> "Rollouts":
        """Some of them."""
        some = copy(self)
        some.run, some.scene, some.cell = self.run[part], self.scene[part], self.cell[part]
        some._starts, some._state, some._thresholds = jax.tree.map(
            lambda leaf: leaf[..., part], (self._starts, self._state, self._thresholds)
        )
        return some

    def chunks(self, width: int) -> Iterator[Simulated]:
        """Rollouts chunk by chunk, scenarios in the order of `run` and `scene`.

        Args:
            width: Scenarios a device takes at a time.
        """
        config = self._config
        simulate = _program(
            config.method, interventions(config), config.core, config.init.speed, self._n_seconds, width
        )
        return simulate.chunks((self._starts, self._state, self._references, self._thresholds))


_Batch: TypeAlias = tuple[dict[str, Array], TrafficState | None, References | None, tuple[Array, Array] | None]
"""What a chunk of rollouts is computed from: seeds, measured states, references and thresholds, as far as used."""


@functools.cache
def _program(
    method: Method, acts: Interventions | None, core: CoreConfig, speed: InitialSpeed, n_seconds: int, width: int
) -> ScenarioMap:
    """Compiled once for all studies of a process: from seeds (and measured states) to rollouts."""
    model = traffic_model(core)

    def simulate(batch: _Batch) -> Simulated:
        starts, measured, references, thresholds = batch
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
