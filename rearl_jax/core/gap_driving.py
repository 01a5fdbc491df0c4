"""Traffic whose drivers use bumper-to-bumper gaps and effects instead of highway-env's rules.

Road, clock, steering, collisions and lane-change rules (timing, safety, side) are the same as in highway-env.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from rearl_jax.core.car_following.model import LEAST_DESIRED_SPEED, CarFollowing
from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.driving import Driving
from rearl_jax.core.following import adjust_setpoints, begin_effects, perceive, respond
from rearl_jax.core.gap_lanes import LaneOptions, compare_lanes, desired_side
from rearl_jax.core.lane_search import bumper_gap, find_ahead
from rearl_jax.core.leader_history import LeaderHistory
from rearl_jax.core.mobil import decide_lanes, is_due
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import DerivedState, derive_state, sort_if_large
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import Controller, TrafficState
from rearl_jax.core.stimuli import find_neighbours, leader_fields, stimulus, vehicle_states


class DriverMemory(eqx.Module):
    """Memory of the drivers from one time step to the next.

    Attributes:
        n_ticks: Time steps since the start.
        leader_history: Last change of each driver's leader.
        effects: Memory of each effect.
        desired_side: Side to which drivers wanted to change at their last decision but had no room: -1 left, +1 right,
            else 0.
    """

    n_ticks: Int[Array, ""]
    leader_history: LeaderHistory
    effects: tuple[PyTree, ...]
    desired_side: Int[Array, "vehicles *scenarios"]


def begin_driving(
    state: TrafficState,
    drivers: Drivers,
    model: TrafficModel,
    replayed: ReplayedVehicles | None = None,
    highest_speed: Float[Array, "vehicles *scenarios"] | None = None,
) -> TrafficState:
    """The initial state with the drivers' desired speeds and memory.

    Drivers whose model has no desired speed keep that of the state or, if they were recorded, get their highest
    recorded speed; highway-env's drivers without effects need no memory.

    Args:
        state: The vehicles.
        drivers: Parameters of all vehicles.
        model: Traffic model; only its road and its time step are used.
        replayed: Recorded vehicles around them; None for none.
        highest_speed: Highest recorded speed of each vehicle [m/s], the upper bound of its driver's desired speed; None
            for vehicles that were not recorded.
    """
    desired_speed = drivers.car_following.desired_speed
    if highest_speed is not None:
        desired_speed = limited_desired_speed(highest_speed, drivers)
    if desired_speed is not None:
        desired_speed = jnp.broadcast_to(desired_speed, state.x.shape)
        desired_speed = jnp.where(state.controller == Controller.IDM, desired_speed, state.desired_speed)
        state = replace(state, desired_speed=desired_speed)
    if not drivers.see_gaps:
        return state
    state = sort_if_large(state)
    derived = derive_state(state, model, replayed)
    vehicles = vehicle_states(state, derived, drivers)
    neighbours = find_neighbours(state, derived, vehicles)
    history = LeaderHistory.begin(neighbours.ahead[0].index, bumper_gap(neighbours.ahead[0], vehicles))
    seen = stimulus(state, derived, vehicles, neighbours, history, derived.lane, jnp.zeros((), state.x.dtype), model)
    driver = present_car_following(state, drivers, model).full(state.x.shape)
    effect_memory = begin_effects(drivers.effects, seen, driver, model.dt)
    return replace(state, memory=DriverMemory(jnp.int32(0), history, effect_memory, jnp.zeros_like(state.target_lane)))


def limited_desired_speed(
    highest: Float[Array, "vehicles *scenarios"], drivers: Drivers
) -> Float[Array, "vehicles *scenarios"]:
    """Desired speed of recorded vehicles' drivers [m/s]: that of their model, limited to the highest recorded speed.

    Drivers whose model has no desired speed, such as highway-env's, get the highest recorded speed.

    Args:
        highest: Highest recorded speed of each vehicle [m/s].
        drivers: Parameters of all vehicles.
    """
    own = drivers.car_following.desired_speed
    return highest if own is None else jnp.minimum(jnp.broadcast_to(own, highest.shape), highest)


def drive_by_gaps(state: TrafficState, derived: DerivedState, drivers: Drivers, model: TrafficModel) -> Driving:
    """Accelerations behind the leaders, and target lanes.

    Effects act on the acceleration on the vehicle's lane and on the target lane of a lane change; the target lane is
    perceived without delay or error. Lanes are compared by car following alone, with each driver's present desired
    speed; the other parameters of the followers are replaced by those of the deciding driver, as in highway-env. Then
    effects act on the gain.

    Raises:
        ValueError: The drivers have no memory yet.
    """
    memory = state.memory
    if memory is None:
        raise ValueError("these drivers have a memory: start from begin_driving(state, drivers, model)")
    vehicles = vehicle_states(state, derived, drivers)
    neighbours = find_neighbours(state, derived, vehicles)
    leader = neighbours.ahead[0]
    history = memory.leader_history.update(leader.index, bumper_gap(leader, vehicles), vehicles.speed, model.dt)
    wanted_lane = jnp.where(derived.lane == state.target_lane, derived.lane + memory.desired_side, state.target_lane)
    time = memory.n_ticks.astype(state.x.dtype) * model.dt
    seen = stimulus(state, derived, vehicles, neighbours, history, wanted_lane, time, model)
    effects, driver = drivers.effects, present_car_following(state, drivers, model).full(state.x.shape)
    perceived, effect_memory = perceive(seen, driver, effects, memory.effects, model.dt)
    adjusted = adjust_setpoints(perceived, driver, effects, effect_memory)
    stop_at_once = -jnp.maximum(state.speed, 0.0) / model.dt  # harder braking would make the vehicle drive backwards

    def on_target_lane() -> Float[Array, "vehicles *scenarios"]:
        (ahead,) = find_ahead(state, derived, vehicles, state.target_lane, 1)
        seen_there = replace(seen, **leader_fields(ahead, vehicles), has_second=jnp.zeros_like(state.x))
        return respond(seen_there, adjust_setpoints(seen_there, driver, effects, effect_memory), effects, effect_memory)

    is_changing = (state.controller != Controller.ABSENT) & (derived.lane != state.target_lane)
    zeros = jnp.zeros_like(state.x)
    own_acceleration = jnp.maximum(respond(perceived, adjusted, effects, effect_memory), stop_at_once)
    target_acceleration = if_any(is_changing, on_target_lane, zeros)
    left = right = zeros
    target_lane, side = state.target_lane, memory.desired_side
    if model.lane_changes:
        vehicles = replace(vehicles, desired_speed=jnp.broadcast_to(adjusted.desired_speed, state.x.shape))
        options = LaneOptions(vehicles, leader, seen, adjusted, effect_memory)
        accelerations, gains = compare_lanes(state, derived, options, drivers, model)
        left, right = accelerations.left, accelerations.right
        due = is_due(state, derived, drivers)
        target_lane = decide_lanes(state, derived, due, accelerations, gains, drivers, model)
        side = desired_side(state, derived, accelerations, gains, drivers, model, before=side)

    def acceleration_on(lane: Int[Array, "vehicles *scenarios"]) -> Float[Array, "vehicles *scenarios"]:
        beside = jnp.where(lane < derived.lane, left, right)
        return jnp.maximum(jnp.where(lane == state.target_lane, target_acceleration, beside), stop_at_once)

    memory = DriverMemory(memory.n_ticks + 1, history, effect_memory, side)
    return Driving(replace(state, memory=memory), own_acceleration, target_lane, acceleration_on)


def present_car_following(state: TrafficState, drivers: Drivers, model: TrafficModel) -> CarFollowing:
    """The drivers' car-following model with the desired speeds of the state, under the road's limit."""
    desired_speed = jnp.clip(state.desired_speed, LEAST_DESIRED_SPEED, model.speed_limit)
    return replace(drivers.car_following, desired_speed=desired_speed)
