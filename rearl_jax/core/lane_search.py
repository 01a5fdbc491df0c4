"""Neighbours for drivers with effects: index, distance, speed, acceleration, length, class.

The search is that of `rearl_jax.core.neighbours`, which gives less information, as needed for highway-env's drivers.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.effects.stimulus import BESIDE_RANGE, OUT_OF_SIGHT
from rearl_jax.core.nearest import lane_bit
from rearl_jax.core.neighbours import DerivedState, for_each_replayed, for_each_vehicle, row
from rearl_jax.core.order import NO_VEHICLE, take_vehicles
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import TrafficState


class VehicleState(eqx.Module):
    """Observable state of each vehicle.

    Attributes:
        speed: Speed along the road [m/s].
        acceleration: Acceleration in the last time step [m/s^2].
        length: Length [m].
        is_truck: 1 for a truck, else 0.
        desired_speed: Present desired speed of the driver [m/s].
    """

    speed: Float[Array, "#vehicles *#scenarios"]
    acceleration: Float[Array, "#vehicles *#scenarios"]
    length: Float[Array, "#vehicles *#scenarios"]
    is_truck: Float[Array, "#vehicles *#scenarios"]
    desired_speed: Float[Array, "#vehicles *#scenarios"]


class Neighbour(eqx.Module):
    """A neighbour of each vehicle.

    Attributes:
        index: Index of the neighbour; NO_VEHICLE without a neighbour.
        distance: Centre-to-centre distance along the road, positive [m]; inf without a neighbour.
        vehicle: State of the neighbour; that of the searching vehicle itself without a neighbour.
    """

    index: Int[Array, "#vehicles *#scenarios"]
    distance: Float[Array, "#vehicles *#scenarios"]
    vehicle: VehicleState

    @property
    def is_there(self) -> Bool[Array, "#vehicles *#scenarios"]:
        """True if there is a neighbour."""
        return self.index != NO_VEHICLE


def no_neighbour(vehicles: VehicleState) -> Neighbour:
    """No neighbour of any vehicle; `vehicles` are the searching vehicles themselves."""
    return Neighbour(
        jnp.full(vehicles.speed.shape, NO_VEHICLE, jnp.int32),
        jnp.full(vehicles.speed.shape, jnp.inf, vehicles.speed.dtype),
        vehicles,
    )


def bumper_gap(neighbour: Neighbour, vehicles: VehicleState) -> Float[Array, "vehicles *scenarios"]:
    """Gap between the bumpers of each vehicle and its neighbour [m]; OUT_OF_SIGHT without a neighbour."""
    gap = neighbour.distance - (vehicles.length + neighbour.vehicle.length) / 2
    return jnp.where(neighbour.is_there, gap, OUT_OF_SIGHT)


def find_ahead(
    state: TrafficState,
    derived: DerivedState,
    vehicles: VehicleState,
    lane: Int[Array, "vehicles *scenarios"],
    n_leaders: int,
) -> tuple[Neighbour, ...]:
    """The nearest vehicles ahead of each vehicle on a lane given for each, nearest first.

    The same position counts as ahead; of several equally near vehicles the last in the list is nearest.
    In this list replayed vehicles come after all simulated ones.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        vehicles: Observable state of each vehicle.
        lane: Lane searched by each vehicle; -1 and n_lanes are empty.
        n_leaders: Vehicles to find.
    """
    leaders, replayed = _find_simulated_ahead(state, derived, vehicles, lane, n_leaders), derived.replayed
    if replayed is None:
        return leaders

    def insert(other: Int[Array, ""], leaders: tuple[Neighbour, ...]) -> tuple[Neighbour, ...]:
        return _inserted(leaders, _replayed_row(state, replayed, other), row(replayed.lane, other) == lane)

    return for_each_replayed(replayed.n_slots, insert, leaders)


def _find_simulated_ahead(
    state: TrafficState,
    derived: DerivedState,
    vehicles: VehicleState,
    lane: Int[Array, "vehicles *scenarios"],
    n_leaders: int,
) -> tuple[Neighbour, ...]:
    """The nearest vehicles ahead on a lane among the simulated ones."""
    own_index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)
    none = no_neighbour(vehicles)
    if derived.nearest is not None:
        index = derived.nearest.ahead_on(lane)
        leader_indices = [index]
        while len(leader_indices) < n_leaders:
            further = derived.nearest.after(index, lane)
            # Among vehicles side by side the searching vehicle may come after its leader in the order; it is skipped.
            further = jnp.where(further == own_index, derived.nearest.after(own_index, lane), further)
            index = jnp.where(index == NO_VEHICLE, NO_VEHICLE, further)
            leader_indices.append(index)
        return tuple(_where(index != NO_VEHICLE, _at_index(state, vehicles, index), none) for index in leader_indices)
    bit = lane_bit(lane)

    def insert(other: Int[Array, ""], leaders: tuple[Neighbour, ...]) -> tuple[Neighbour, ...]:
        is_on_lane = ((row(derived.on_lanes, other) & bit) != 0) & (own_index != other)
        return _inserted(leaders, _row(state, vehicles, other), is_on_lane)

    return for_each_vehicle(state.x.shape[0], insert, (none,) * n_leaders)


def _inserted(
    leaders: tuple[Neighbour, ...], candidate: Neighbour, is_on_lane: Bool[Array, "#vehicles *#scenarios"]
) -> tuple[Neighbour, ...]:
    """Leaders, nearest first, after insertion of a candidate; every displaced leader is inserted in turn."""
    is_ahead = is_on_lane & (candidate.distance >= 0)
    kept = []
    for leader in leaders:
        is_nearer = is_ahead & (candidate.distance <= leader.distance)
        kept.append(_where(is_nearer, candidate, leader))
        candidate = _where(is_nearer, leader, candidate)
    return tuple(kept)


def find_behind(
    state: TrafficState, derived: DerivedState, vehicles: VehicleState, lane: Int[Array, "vehicles *scenarios"]
) -> Neighbour:
    """The nearest vehicle behind each vehicle on a lane given for each; of equally near ones the first in the list.

    Arguments as in `find_ahead`.
    """
    follower, replayed = _find_simulated_behind(state, derived, vehicles, lane), derived.replayed
    if replayed is None:
        return follower

    def keep_nearest(other: Int[Array, ""], nearest: Neighbour) -> Neighbour:
        candidate = _reversed(_replayed_row(state, replayed, other))
        is_behind = (row(replayed.lane, other) == lane) & (candidate.distance > 0)
        return _where(is_behind & (candidate.distance < nearest.distance), candidate, nearest)

    return for_each_replayed(replayed.n_slots, keep_nearest, follower)


def _find_simulated_behind(
    state: TrafficState, derived: DerivedState, vehicles: VehicleState, lane: Int[Array, "vehicles *scenarios"]
) -> Neighbour:
    """The nearest vehicle behind on a lane among the simulated ones."""
    none = no_neighbour(vehicles)
    if derived.nearest is not None:
        index = derived.nearest.behind_on(lane)
        return _where(index != NO_VEHICLE, _reversed(_at_index(state, vehicles, index)), none)
    bit = lane_bit(lane)

    def keep_nearest(other: Int[Array, ""], nearest: Neighbour) -> Neighbour:
        candidate = _reversed(_row(state, vehicles, other))
        is_behind = ((row(derived.on_lanes, other) & bit) != 0) & (candidate.distance > 0)
        return _where(is_behind & (candidate.distance < nearest.distance), candidate, nearest)

    return for_each_vehicle(state.x.shape[0], keep_nearest, none)


def find_entrant(
    state: TrafficState, derived: DerivedState, vehicles: VehicleState, wanted_lane: Int[Array, "vehicles *scenarios"]
) -> Neighbour:
    """For each vehicle, the nearest vehicle ahead on another lane whose driver wants to change to its lane.

    Replayed vehicles are left out, because the lanes that their drivers want are unknown.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic.
        vehicles: Observable state of each vehicle.
        wanted_lane: Lane that each driver wants to be on.
    """

    def keep_nearest(other: Int[Array, ""], nearest: Neighbour) -> Neighbour:
        candidate = _row(state, vehicles, other)
        wants_in = (row(wanted_lane, other) == derived.lane) & (row(derived.lane, other) != derived.lane)
        is_ahead = wants_in & (row(derived.on_lanes, other) != 0) & (candidate.distance > 0)
        return _where(is_ahead & (candidate.distance <= nearest.distance), candidate, nearest)

    return for_each_vehicle(state.x.shape[0], keep_nearest, no_neighbour(vehicles))


def traffic_beside(
    state: TrafficState, derived: DerivedState, vehicles: VehicleState
) -> tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]:
    """Lowest speed [m/s] and number of the vehicles on adjacent lanes within BESIDE_RANGE; without any of them, the
    speed is OUT_OF_SIGHT.
    """

    def add(other: Int[Array, ""], beside: tuple[Array, Array]) -> tuple[Array, Array]:
        is_near = jnp.abs(row(state.x, other) - state.x) <= BESIDE_RANGE
        is_beside = (
            (jnp.abs(row(derived.lane, other) - derived.lane) == 1) & (row(derived.on_lanes, other) != 0) & is_near
        )
        slowest, count = beside
        slowest = jnp.where(is_beside, jnp.minimum(slowest, row(vehicles.speed, other)), slowest)
        return slowest, count + is_beside.astype(state.x.dtype)

    nothing, replayed = jnp.zeros_like(state.x), derived.replayed
    beside = for_each_vehicle(state.x.shape[0], add, (nothing + OUT_OF_SIGHT, nothing))
    if replayed is None:
        return beside

    def add_replayed(other: Int[Array, ""], beside: tuple[Array, Array]) -> tuple[Array, Array]:
        is_near = jnp.abs(row(replayed.x, other) - state.x) <= BESIDE_RANGE
        is_beside = (jnp.abs(row(replayed.lane, other) - derived.lane) == 1) & is_near
        slowest, count = beside
        slowest = jnp.where(is_beside, jnp.minimum(slowest, row(replayed.speed, other)), slowest)
        return slowest, count + is_beside.astype(state.x.dtype)

    return for_each_replayed(replayed.n_slots, add_replayed, beside)


def _row(state: TrafficState, vehicles: VehicleState, other: Int[Array, ""]) -> Neighbour:
    """One vehicle as the neighbour of all; distances are signed."""
    index = jnp.broadcast_to(other, (1,) * state.x.ndim).astype(jnp.int32)
    return Neighbour(index, row(state.x, other) - state.x, jax.tree.map(lambda values: row(values, other), vehicles))


def _replayed_row(state: TrafficState, replayed: ReplayedVehicles, other: Int[Array, ""]) -> Neighbour:
    """One replayed vehicle as the neighbour of all; its desired speed, which is unknown, is taken to be its speed."""
    columns = replayed.x, replayed.speed, replayed.acceleration, replayed.length, replayed.is_truck, replayed.number
    x, speed, acceleration, length, is_truck, number = (row(values, other) for values in columns)
    return Neighbour(number, x - state.x, VehicleState(speed, acceleration, length, is_truck, desired_speed=speed))


def _at_index(state: TrafficState, vehicles: VehicleState, index: Int[Array, "vehicles *scenarios"]) -> Neighbour:
    """The vehicle at an index given for each vehicle as its neighbour; distances are signed."""
    return Neighbour(
        index,
        take_vehicles(state.x, index) - state.x,
        jax.tree.map(lambda values: take_vehicles(values, index), vehicles),
    )


def _reversed(neighbour: Neighbour) -> Neighbour:
    """The neighbour with the sign of distances reversed."""
    return Neighbour(neighbour.index, -neighbour.distance, neighbour.vehicle)


def _where(condition: Array, first: Neighbour, second: Neighbour) -> Neighbour:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), first, second)
