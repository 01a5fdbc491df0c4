"""Stimulus of car following and effects, from the state of simulated traffic."""

from dataclasses import fields

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.effects.side_lane import SideLane
from rearl_jax.core.effects.stimulus import OUT_OF_SIGHT
from rearl_jax.core.lane_search import (
    Neighbour,
    VehicleState,
    bumper_gap,
    find_ahead,
    find_behind,
    find_entrant,
    no_neighbour,
    traffic_beside,
)
from rearl_jax.core.leader_history import LeaderHistory
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import DerivedState
from rearl_jax.core.state import Controller, TrafficState


def vehicle_states(state: TrafficState, derived: DerivedState, drivers: Drivers) -> VehicleState:
    """Observable state of each vehicle; desired speeds are those of the state."""

    def full(values: Array) -> Float[Array, "vehicles *scenarios"]:
        return jnp.broadcast_to(values.astype(state.x.dtype), state.x.shape)

    is_truck = drivers.body.is_truck
    return VehicleState(
        speed=derived.speed_x,
        acceleration=state.acceleration,
        length=full(drivers.body.length),
        is_truck=jnp.zeros_like(state.x) if is_truck is None else full(is_truck),
        desired_speed=state.desired_speed,
    )


class Neighbours(eqx.Module):
    """Neighbours of each vehicle on its own lane: three vehicles ahead, nearest first, and one behind."""

    ahead: tuple[Neighbour, ...]
    behind: Neighbour


def find_neighbours(state: TrafficState, derived: DerivedState, vehicles: VehicleState) -> Neighbours:
    """Neighbours of each vehicle on its own lane."""
    is_present, none = state.controller != Controller.ABSENT, no_neighbour(vehicles)
    ahead = if_any(is_present, lambda: find_ahead(state, derived, vehicles, derived.lane, 3), (none,) * 3)
    return Neighbours(ahead, if_any(is_present, lambda: find_behind(state, derived, vehicles, derived.lane), none))


def stimulus(
    state: TrafficState,
    derived: DerivedState,
    vehicles: VehicleState,
    neighbours: Neighbours,
    history: LeaderHistory,
    wanted_lane: Int[Array, "vehicles *scenarios"],
    time: Float[Array, ""],
    model: TrafficModel,
) -> SimulatedStimulus:
    """The stimulus of each driver.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        vehicles: Observable state of each vehicle.
        neighbours: Neighbours of each vehicle on its own lane.
        history: Last change of each driver's leader.
        wanted_lane: Lane that each driver wants to be on.
        time: Time since the start [s].
        model: Traffic model; only its road is used.
    """
    (leader, second, third), follower = neighbours.ahead, neighbours.behind
    is_present = state.controller != Controller.ABSENT
    no_traffic = jnp.full_like(state.x, OUT_OF_SIGHT), jnp.zeros_like(state.x)
    left = if_any(
        is_present, lambda: find_ahead(state, derived, vehicles, derived.lane - 1, 1), (no_neighbour(vehicles),)
    )[0]
    beside_speed, n_beside = if_any(is_present, lambda: traffic_beside(state, derived, vehicles), no_traffic)
    wants_change = wanted_lane != derived.lane
    entrant = if_any(wants_change, lambda: find_entrant(state, derived, vehicles, wanted_lane), no_neighbour(vehicles))
    is_changing = state.target_lane != derived.lane
    changer = if_any(
        is_changing, lambda: find_entrant(state, derived, vehicles, state.target_lane), no_neighbour(vehicles)
    )
    (new_leader,) = if_any(
        wants_change, lambda: find_ahead(state, derived, vehicles, wanted_lane, 1), (no_neighbour(vehicles),)
    )

    def as_float(values: Array) -> Float[Array, "vehicles *scenarios"]:
        return values.astype(state.x.dtype)

    lane = as_float(derived.lane)
    leader_speed = leader.vehicle.speed
    second_speed = jnp.where(second.is_there, second.vehicle.speed, leader_speed)
    second_gap = bumper_gap(second, vehicles) - leader.vehicle.length
    return SimulatedStimulus(
        time=time,
        position=state.x,
        lane=lane,
        is_leftmost=as_float(derived.lane == 0),
        is_rightmost=as_float(derived.lane == model.n_lanes - 1),
        lateral_offset=state.y - lane * model.lane_width,
        speed=vehicles.speed,
        length=vehicles.length,
        is_truck=vehicles.is_truck,
        **leader_fields(leader, vehicles),
        has_second=as_float(second.is_there),
        second_gap=jnp.where(second.is_there, second_gap, OUT_OF_SIGHT),
        second_speed=second_speed,
        has_third=as_float(third.is_there),
        third_speed=jnp.where(third.is_there, third.vehicle.speed, second_speed),
        has_follower=as_float(follower.is_there),
        follower_gap=bumper_gap(follower, vehicles),
        follower_speed=follower.vehicle.speed,
        has_left=as_float(left.is_there),
        left_gap=bumper_gap(left, vehicles),
        left_speed=left.vehicle.speed,
        beside_speed=beside_speed,
        n_beside=n_beside,
        time_since_change=history.time_since_change,
        gap_lost=history.gap_lost,
        time_gap_at_change=history.time_gap,
        has_entrant=as_float(entrant.is_there),
        entrant_gap=bumper_gap(entrant, vehicles),
        entrant_speed=entrant.vehicle.speed,
        has_changer=as_float(changer.is_there),
        changer_gap=bumper_gap(changer, vehicles),
        changer_speed=changer.vehicle.speed,
        has_new_leader=as_float(wants_change & new_leader.is_there),
        new_leader_gap=bumper_gap(new_leader, vehicles),
        new_leader_speed=new_leader.vehicle.speed,
    )


def leader_fields(leader: Neighbour, vehicles: VehicleState) -> dict[str, Float[Array, "vehicles *scenarios"]]:
    """Fields of `Stimulus` that describe the vehicle ahead; arguments as in `bumper_gap`."""
    has_leader = leader.is_there.astype(vehicles.speed.dtype)
    return {
        "has_leader": has_leader,
        "gap": bumper_gap(leader, vehicles),
        "leader_speed": leader.vehicle.speed,
        "leader_acceleration": has_leader * leader.vehicle.acceleration,
        "leader_length": leader.vehicle.length,
        "leader_is_truck": has_leader * leader.vehicle.is_truck,
    }


def side_lane(
    direction: int,
    leader: Neighbour,
    follower: Neighbour,
    gain_of_others: Float[Array, "vehicles *scenarios"],
    vehicles: VehicleState,
) -> SideLane:
    """The lane on one side of each driver.

    Args:
        direction: -1 for the left, +1 for the right.
        leader: The nearest vehicle ahead on this lane.
        follower: The nearest vehicle behind on this lane.
        gain_of_others: Gains of the present and the new follower by a change, added [m/s^2].
        vehicles: Observable state of each vehicle.
    """
    of_leader = leader_fields(leader, vehicles)
    names = {item.name for item in fields(SideLane)}
    return SideLane(
        direction=direction,
        **{name: values for name, values in of_leader.items() if name in names},
        has_follower=follower.is_there.astype(vehicles.speed.dtype),
        follower_gap=bumper_gap(follower, vehicles),
        follower_speed=follower.vehicle.speed,
        gain_of_others=gain_of_others,
    )
