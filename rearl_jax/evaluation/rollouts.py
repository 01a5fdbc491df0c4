"""Where rollouts begin and how they are simulated; what a method is.

Initial states depend on the seed, the run and the scene alone: every method and every batch size sees the
same ones (common random numbers), so that differences between methods are not differences of luck.
"""

import functools
from collections.abc import Callable, Iterator
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from rearl_jax._typing import PRNGKey
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import CoreConfig, InitialSource, InitialSpeed
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.core.batch import ScenarioMap
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import TrafficState, make_state
from rearl_jax.data.scene_set import SceneSet

Simulator: TypeAlias = Callable[[TrafficState, Drivers, TrafficModel, int], Frames]
"""From initial states, drivers, the road and a number of seconds to the frame after each second."""

FIXED_SPEED = 25.0
"""Speed of init.speed=fixed_25 [m/s]. Source: highway-env 1.12.1, `HighwayEnv._create_vehicles`."""


def simulate_base(state: TrafficState, drivers: Drivers, model: TrafficModel, n_seconds: int) -> Frames:
    """Frames of IDM and MOBIL traffic that nobody interferes with."""
    return rollout(state, drivers, model, n_seconds=n_seconds)[1]


SIMULATORS: dict[Method, Simulator] = {Method.base: simulate_base}
"""How each method simulates a batch of scenarios."""


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
    """

    def __init__(self, config: EvaluateTask, scenes: SceneSet, held_out: np.ndarray) -> None:
        """Lists the rollouts; nothing is simulated yet.

        Args:
            config: Method, road, initial states, runs and seeds.
            scenes: All scenes.
            held_out: Indices of those to be simulated.
        """
        self._config, self._n_seconds = config, scenes.seconds
        runs = np.arange(config.eval.n_runs, dtype=np.int32)
        is_shared = config.eval.seed_scope is SeedScope.run
        served = held_out[:1] if is_shared else held_out
        self.run, self.scene = np.repeat(runs, len(served)), np.tile(served, len(runs))
        scene_id = np.zeros_like(self.scene) if is_shared else scenes.scene_id[self.scene]
        self._starts = {
            "seed": np.full(len(self.run), config.eval.seed, np.int32),
            "run": self.run,
            "scene_id": scene_id.astype(np.int32),
        }
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

    def chunks(self, width: int) -> Iterator[Frames]:
        """Frames chunk by chunk, scenarios in the order of `run` and `scene`.

        Args:
            width: Scenarios a device takes at a time.
        """
        config = self._config
        simulate = _program(config.method, config.core, config.init.speed, self._n_seconds, width)
        return simulate.chunks((self._starts, self._state))


@functools.cache
def _program(method: Method, core: CoreConfig, speed: InitialSpeed, n_seconds: int, width: int) -> ScenarioMap:
    """Compiled once for all studies of a process: from seeds (and measured states) to frames."""
    model = traffic_model(core)

    def simulate(batch: tuple[dict[str, Array], TrafficState | None]) -> Frames:
        starts, measured = batch
        keys = jax.vmap(rollout_key)(starts["seed"], starts["run"], starts["scene_id"])
        state, drivers = spawn(
            keys,
            model,
            n_vehicles=core.n_vehicles,
            density=core.density,
            initial_speed=FIXED_SPEED if speed is InitialSpeed.fixed_25 else None,
            dtype=jnp.dtype(core.dtype.name),
        )
        return SIMULATORS[method](state if measured is None else measured, drivers, model, n_seconds)

    return ScenarioMap(simulate, chunk=width)
