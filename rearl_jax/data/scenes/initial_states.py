"""Measured scenes as initial states of simulations: the vehicles of each scene's first snapshot."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from rearl_jax.config.core import MOST_LANES, CoreConfig
from rearl_jax.core.boundary import Boundary, Entrants, Identity, Motion
from rearl_jax.core.model import traffic_model
from rearl_jax.core.state import TrafficState, make_state
from rearl_jax.data.scenes.boundary import SceneBoundary, lanes_side_by_side
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def first_lanes(scenes: SceneSet) -> Int[np.ndarray, "scenes slots"]:
    """Lane of every vehicle in the first snapshot, as `lanes_side_by_side` numbers them.

    Raises:
        ValueError: A lane is unknown.
    """
    if (scenes.lane[:, 0] < 0).any():
        message = "is scene, which needs the lane of every vehicle; these recordings lack some"
        remedy = "set init.source=seed speed.norm=minmax, which draws the start"
        raise InvalidInputError(Problem("lane-missing", message, remedy, key="init.source"))
    return lanes_side_by_side(scenes, scenes.lane[:, 0], scenes.direction[:, 0])


def recorded_road(core: CoreConfig, scenes: SceneSet) -> CoreConfig:
    """The road of recorded scenes: with their lanes, unless `core` states their number, and without a speed limit that
    recorded vehicles exceed.

    Raises:
        InvalidInputError: The recordings have more lanes than a simulated road can have.
    """
    if core.n_lanes is None:
        of_roads = max if scenes.is_one_way else sum
        beside = lanes_side_by_side(scenes, scenes.lane.astype(np.int64), scenes.direction)
        n_lanes = max(int(beside.max()) + 1, *(of_roads(info.lane_count.values()) for info in scenes.infos))
        if n_lanes > MOST_LANES:
            message = f"must leave recordings of at most {MOST_LANES} lanes, not {n_lanes}"
            remedy = "leave out the others" if scenes.is_one_way else "set scenes.direction=per_direction"
            raise InvalidInputError(Problem("lanes-too-many", message, remedy, key="data.recordings"))
        core = replace(core, n_lanes=n_lanes)
    if core.speed_limit is None:
        return core
    return replace(core, speed_limit=max(core.speed_limit, float(scenes.scaled_speed.max())))


def measured_state(scenes: SceneSet, core: CoreConfig) -> TrafficState:
    """States with the vehicles of every scene's first snapshot, `[n_vehicles, n_scenes]`.

    x is the position along the driving direction minus the smallest one of the scene, so carriageways are side by
    side and all vehicles drive towards larger x; lanes as in `first_lanes`. `desired_speed` is the highest recorded
    speed of the vehicle, by which `core.boundary.limited_desired_speed` limits that of its driver. Speeds are rescaled
    by `scenes.speed_norm`.

    Raises:
        ValueError: The simulated road has too few lanes or another number of vehicles, or a lane is unknown.
    """
    lane, position = first_lanes(scenes), scenes.position[:, 0]
    x = position - position.min(axis=1, keepdims=True)
    return _state(core, x, lane, scenes.scaled_speed[:, 0], highest_speeds(scenes), int(lane.max()) + 1)


def highest_speeds(scenes: SceneSet) -> Float[np.ndarray, "scenes slots"]:
    """Highest speed at which each vehicle of the first snapshot is recorded in its scene, rescaled [m/s]."""
    is_same = scenes.track_id[:, :, :, None] == scenes.track_id[:, :1, None, :]  # [scenes, frames, slots, vehicles]
    return np.where(is_same, scenes.scaled_speed[..., None], -np.inf).max(axis=(1, 2))


def bounded_state(boundary: SceneBoundary, core: CoreConfig) -> TrafficState:
    """States with the simulated vehicles of every scene's first second, `[n_vehicles, n_scenes]`.

    As in `measured_state`, but on the road of the replayed vehicles.

    Raises:
        ValueError: The simulated road has too few lanes or another number of vehicles.
    """
    x, lane, speed, highest = (getattr(boundary, name)[:, 0] for name in ("x", "lane", "speed", "highest_speed"))
    return _state(core, x, lane, speed, highest, boundary.n_lanes)


def recorded_surroundings(boundary: SceneBoundary, core: CoreConfig) -> Boundary:
    """The boundary as an input of the simulation; each scene is one scenario.

    The time of the next lane-change decision of an entering vehicle depends on its position, as it does for
    highway-env's vehicles at the start.
    """
    dtype = np.dtype(core.dtype.name)

    def last(values: np.ndarray, kind: np.dtype | type = dtype) -> Array:
        """Values with the scenes last."""
        return jnp.asarray(np.moveaxis(values, 0, -1).astype(kind))

    replayed = {name: last(getattr(boundary, f"replayed_{name}")) for name in ("x", "speed", "acceleration")}
    # Values at the beginning of a second are applied at the end of the previous second, so the first ones are left out.
    entering = {name: last(getattr(boundary, name)[:, 1:]) for name in ("x", "speed", "highest_speed")}
    across = boundary.lane[:, 1:] * traffic_model(core).lane_width
    return Boundary(
        motion=Motion(**replayed, lane=last(boundary.replayed_lane, np.int32)),
        identity=Identity(
            length=last(boundary.replayed_length),
            is_truck=last(boundary.replayed_is_truck),
            number=last(boundary.replayed_number, np.int32),
        ),
        entrants=Entrants(
            **entering,
            is_new=last(boundary.is_new[:, 1:], bool),
            lane=last(boundary.lane[:, 1:], np.int32),
            wait=last(1 - ((boundary.x[:, 1:] + across) * np.pi) % 1.0),
        ),
        scene=np.arange(len(boundary.x), dtype=np.int32),
    )


def _state(
    core: CoreConfig,
    x: Float[np.ndarray, "scenes vehicles"],
    lane: Int[np.ndarray, "scenes vehicles"],
    speed: Float[np.ndarray, "scenes vehicles"],
    highest_speed: Float[np.ndarray, "scenes vehicles"],
    n_lanes: int,
) -> TrafficState:
    """States with these positions [m], lanes and speeds [m/s] on a road that has `n_lanes` lanes or more.

    Raises:
        ValueError: The simulated road has too few lanes or another number of vehicles.
    """
    if core.n_vehicles != x.shape[1]:
        message = f"must be the {x.shape[1]} vehicles of a snapshot, scenes.slots, for init.source=scene"
        raise out_of_range("core.n_vehicles", message, core.n_vehicles)
    if n_lanes > core.lanes:
        message = f"must be at least {n_lanes}, the lanes of these recordings, for init.source=scene: leave it out"
        raise out_of_range("core.n_lanes", message, core.lanes)
    model = traffic_model(core)
    y, dtype = lane.T * model.lane_width, np.dtype(core.dtype.name).type
    return make_state(x.T, y, speed.T, model, desired_speed=highest_speed.T, dtype=dtype)
