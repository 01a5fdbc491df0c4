"""State of the traffic between two time steps, and its construction from measured or drawn vehicles.

Arrays are `[vehicles, *scenarios]`: the vehicle axis first, in the order of highway-env's vehicle list, the
scenario axis last and contiguous. A single scene has no scenario axis. An index of the vehicle axis is also called a
slot, because a vehicle that enters takes the slot of one that leaves.
"""

import enum

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from rearl_jax.core.model import TrafficModel
from rearl_jax.core.timer import ticks_until_decision
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


class Controller(enum.IntEnum):
    """Driver of a vehicle.

    ABSENT pads a scenario that has fewer vehicles than others: the vehicle stands beyond the end of the road, out of
    sight of all others. IDM drives by IDM and MOBIL. META follows meta-actions (target lane and target speed).
    """

    ABSENT = 0
    IDM = 1
    META = 2


class TrafficState(eqx.Module):
    """State of all vehicles between two ticks.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m]; lane k is centred on k * lane_width.
        x_lost: Rounding error of x so far (compensated summation) [m].
        y_lost: The same for y [m].
        heading: Angle to the road, positive towards larger y [rad].
        speed: Speed along the heading, before the slip angle [m/s].
        acceleration: Acceleration executed in the last time step [m/s^2].
        desired_speed: Desired speed of an IDM vehicle, target speed of a META vehicle [m/s].
        target_lane: Lane the vehicle is steered to.
        ticks_to_decision: Ticks until the next lane-change decision is due; it waits while a change is in progress.
        controller: Driver of the vehicle, see `Controller`.
        crashed: Whether the vehicle has been in a collision.
        is_pushed: Whether a collision moves the vehicle in the coming time step.
        push_x: Displacement by that collision along the road [m].
        push_y: The same across the road [m].
        order: Vehicle indices along the road as last sorted; any permutation is a valid start. Only used in large
            traffic.
        memory: Memory of drivers who use gaps, a `gap_driving.DriverMemory`; None if no driver does.
        n_crashed_replaced: Crashed vehicles in the slot replaced by entering ones so far [count]; None if none enters.
    """

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    x_lost: Float[Array, "vehicles *scenarios"]
    y_lost: Float[Array, "vehicles *scenarios"]
    heading: Float[Array, "vehicles *scenarios"]
    speed: Float[Array, "vehicles *scenarios"]
    acceleration: Float[Array, "vehicles *scenarios"]
    desired_speed: Float[Array, "vehicles *scenarios"]
    target_lane: Int[Array, "vehicles *scenarios"]
    ticks_to_decision: Int[Array, "vehicles *scenarios"]
    controller: Int[Array, "vehicles *scenarios"]
    crashed: Bool[Array, "vehicles *scenarios"]
    is_pushed: Bool[Array, "vehicles *scenarios"]
    push_x: Float[Array, "vehicles *scenarios"]
    push_y: Float[Array, "vehicles *scenarios"]
    order: Int[Array, "vehicles *scenarios"]
    memory: PyTree = None
    n_crashed_replaced: PyTree = None


def nearest_lane(y: Float[Array, "*n"], model: TrafficModel) -> Int[Array, "*n"]:
    """Lane whose centre is nearest; the lower index on the border line.

    Source: highway-env 1.12.1, `RoadNetwork.get_closest_lane_index`: on a straight road its heading and range terms
    are equal for all lanes.
    """
    lane = jnp.ceil(y / model.lane_width - 0.5)
    return jnp.clip(lane, 0, model.n_lanes - 1).astype(jnp.int32)


def nearest_level(speed: Float[Array, "*n"] | np.ndarray, model: TrafficModel) -> Float[Array, "*n"] | np.ndarray:
    """Index of the target speed nearest to a speed, halves to even; a float array of NumPy or JAX, like the speed.

    As in highway-env, levels that are not equidistant are treated as if they were, between the first and the last.

    Source: highway-env 1.12.1, `MDPVehicle.speed_to_index`.
    """
    low, high, last = model.speed_levels[0], model.speed_levels[-1], len(model.speed_levels) - 1
    return ((speed - low) / (high - low) * last).round().clip(0, last)


PARKING_SPACING = 100.0
"""Distance [m] between absent vehicles, so that they never touch."""


def make_state(
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    model: TrafficModel,
    *,
    heading: np.ndarray | float = 0.0,
    desired_speed: np.ndarray | None = None,
    target_lane: np.ndarray | None = None,
    timer: np.ndarray | None = None,
    lane_change_delay: float = 1.0,
    controller: np.ndarray | int = Controller.IDM,
    crashed: np.ndarray | bool = False,
    dtype: type = np.float32,
) -> TrafficState:
    """State of vehicles at given positions, built on the host in float64 as highway-env's constructors build it.

    Args:
        x: Positions along the road [m], `[vehicles, *scenarios]`; lane changes need 0 <= x.
        y: Lateral positions [m].
        speed: Speeds [m/s].
        model: The road.
        heading: Headings [rad].
        desired_speed: Desired (IDM) or target (META, snapped to the nearest level) speed [m/s]; None for the present
            speed.
        target_lane: Lanes of the road; None for the nearest lane.
        timer: Time since the last lane-change decision [s]; None for ((x + y) pi) mod delay, highway-env's phase.
        lane_change_delay: Time between lane-change decisions [s].
        controller: One of `Controller` for each vehicle. Positions of ABSENT vehicles are ignored.
        crashed: Vehicles that have collided already.
        dtype: np.float32 or np.float64.

    Raises:
        ValueError: If shapes differ, a value of a vehicle that is present is not finite, a target lane is not on the
            road, or the delay is not a positive time.

    Source: highway-env 1.12.1, constructors of `Vehicle`, `IDMVehicle`, `MDPVehicle`.
    """
    shape = np.shape(x)

    def full(values: object, element_type: type = np.float64) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(values), shape), element_type)

    x, y, speed, heading = full(x), full(y), full(speed), full(heading)
    controller = full(controller, np.int32)
    present = controller != Controller.ABSENT
    checked = {"x": x, "y": y, "speed": speed, "heading": heading}
    optional = {"desired_speed": desired_speed, "timer": timer}
    checked |= {name: full(values) for name, values in optional.items() if values is not None}
    for name, values in checked.items():
        bad = np.argwhere(present & ~np.isfinite(values))
        if len(bad):
            key, remedy = f"{name}{bad[0].tolist()}", "drop the vehicle or mark it Controller.ABSENT"
            raise InvalidInputError(Problem("not-a-number", "must be finite", remedy, key=key))
    if not 0 < lane_change_delay < np.inf:
        raise out_of_range("lane_change_delay", "must be > 0 s and finite", lane_change_delay)
    slot = np.arange(shape[0], dtype=np.float64).reshape(-1, *(1,) * (len(shape) - 1))
    parking = 100 * model.road_length + PARKING_SPACING * slot
    x = np.where(present, x, parking)
    y, speed, heading = (np.where(present, values, 0.0) for values in (y, speed, heading))

    desired = np.where(present, checked.get("desired_speed", speed), 0.0)
    level_speed = np.asarray(model.speed_levels)[np.asarray(nearest_level(desired, model), np.int64)]
    desired = np.where(controller == Controller.META, level_speed, desired)
    lane = np.clip(np.ceil(y / model.lane_width - 0.5), 0, model.n_lanes - 1).astype(np.int32)
    target = lane if target_lane is None else np.where(present, full(target_lane, np.int32), 0)
    if (beyond := (target < 0) | (target >= model.n_lanes)).any():
        raise out_of_range("target_lane", f"must be within 0 and {model.n_lanes - 1}", int(target[beyond][0]))
    phase = ((x + y) * np.pi) % lane_change_delay if timer is None else np.where(present, checked["timer"], 0.0)
    zeros = jnp.zeros(shape, dtype)
    return TrafficState(
        x=jnp.asarray(x, dtype),
        y=jnp.asarray(y, dtype),
        x_lost=zeros,
        y_lost=zeros,
        heading=jnp.asarray(heading, dtype),
        speed=jnp.asarray(speed, dtype),
        acceleration=zeros,
        desired_speed=jnp.asarray(desired, dtype),
        target_lane=jnp.asarray(target, jnp.int32),
        ticks_to_decision=jnp.asarray(ticks_until_decision(phase, lane_change_delay, model.ticks_per_second)),
        controller=jnp.asarray(controller),
        crashed=jnp.asarray(full(crashed, bool) & present),
        is_pushed=jnp.zeros(shape, bool),
        push_x=zeros,
        push_y=zeros,
        order=jnp.asarray(np.argsort(x, axis=0, kind="stable"), jnp.int32),
    )
