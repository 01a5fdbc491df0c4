"""Measured scenes as initial states of simulations: the vehicles of each scene's first snapshot."""

import numpy as np
from jaxtyping import Int

from rearl_jax.config.core import CoreConfig
from rearl_jax.core.road import traffic_model
from rearl_jax.core.state import TrafficState, make_state
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def first_lanes(scenes: SceneSet) -> Int[np.ndarray, "scenes slots"]:
    """Lane of every vehicle in the first snapshot, the carriageways side by side.

    Lane within the carriageway plus, on carriageway 2, the number of lanes of carriageway 1.

    Raises:
        ValueError: A lane is unknown.
    """
    if (scenes.lane[:, 0] < 0).any():
        message = "is scene, which needs the lane of every vehicle; these recordings lack some"
        raise InvalidInputError(Problem("lane-missing", message, key="init.source"))
    lanes = {info.id: info.lane_count for info in scenes.infos}
    first = np.array([lanes[name].get(1, 0) for name in scenes.recording.tolist()])
    return scenes.lane[:, 0] + np.where(scenes.direction[:, 0] == 2, first[:, None], 0)


def measured_state(scenes: SceneSet, core: CoreConfig) -> TrafficState:
    """States with the vehicles of every scene's first snapshot, `[n_vehicles, n_scenes]`.

    x = position along the own driving direction less the least one of the scene, so the carriageways lie side by side
    and all vehicles drive towards larger x; lane as in `first_lanes`; speed = rescaled speed, which is the desired
    speed too, as highway-env sets it.

    Raises:
        ValueError: The simulated road has too few lanes or another number of vehicles, or a lane is unknown.
    """
    if core.n_vehicles != scenes.n_slots:
        message = f"must be the {scenes.n_slots} vehicles of a snapshot, scenes.slots, for init.source=scene"
        raise out_of_range("core.n_vehicles", message, core.n_vehicles)
    lane = first_lanes(scenes)
    n_lanes = int(lane.max()) + 1
    if n_lanes > core.n_lanes:
        message = f"must be {n_lanes}, the lanes of these recordings, for init.source=scene"
        raise out_of_range("core.n_lanes", message, core.n_lanes)
    position = scenes.position[:, 0]
    model = traffic_model(core)
    return make_state(
        (position - position.min(axis=1, keepdims=True)).T,
        lane.T * model.lane_width,
        scenes.scaled_speed[:, 0].T,
        model,
        dtype=np.dtype(core.dtype.name).type,
    )
