"""Leader and follower of every vehicle on given lanes.

In small traffic every vehicle is compared with all others one after another, and the nearest is kept ("running
minimum"). That costs n_vehicles^2 comparisons, but only comparisons and selections, which a compiler turns into
straight vector code over the scenarios. In large traffic the vehicles are sorted along the road
(`rearl_jax.core.order`), and neighbours are read off that order (`rearl_jax.core.nearest`).
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.double_double import rounded
from rearl_jax.core.elementary import cosine, not_zero, sine
from rearl_jax.core.model import ROAD_END_MARGIN, TrafficModel
from rearl_jax.core.nearest import NearestOnLanes, lane_bit, scan_along_road
from rearl_jax.core.order import NO_VEHICLE, sort_along_road
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import TrafficState, nearest_lane

Result = TypeVar("Result")

LANE_MARGIN = 1.0
"""A vehicle counts as being on a lane up to this distance [m] beyond the lane's edge.

Source: highway-env 1.12.1, `Road.neighbour_vehicles(margin=1)`."""

LARGEST_SMALL_TRAFFIC = 18
"""Largest number of vehicles for which all pairs are compared."""

LARGE_TRAFFIC_BLOCK = 8
"""Vehicles per pass of a loop over all vehicles in large traffic, where only rare work needs such a loop."""

UNROLLED_SLOTS = 32
"""Largest number of slots for replayed vehicles that are visited without a loop; more would take long to compile."""


class DerivedState(eqx.Module):
    """Quantities that follow from the state and are shared by the stages of one time step.

    Attributes:
        lane: Nearest lane.
        cos_heading: Cosine of the heading [-].
        sin_heading: Sine of the heading [-].
        speed_x: Speed along the road [m/s].
        speed_y: Speed across the road [m/s].
        speed_ratio: max(v, 0) / |v0| with v0 the driver's desired speed under the speed limit [-].
        on_lanes: The lanes the vehicle is on, as bits (`lane_bit`); no bit if it is beyond the road, out of sight.
        nearest: Nearest vehicles on every lane; None in small traffic, where all pairs are compared.
        replayed: Recorded vehicles around the simulated ones; None for none.
    """

    lane: Int[Array, "vehicles *scenarios"]
    cos_heading: Float[Array, "vehicles *scenarios"]
    sin_heading: Float[Array, "vehicles *scenarios"]
    speed_x: Float[Array, "vehicles *scenarios"]
    speed_y: Float[Array, "vehicles *scenarios"]
    speed_ratio: Float[Array, "vehicles *scenarios"]
    on_lanes: Int[Array, "vehicles *scenarios"]
    nearest: NearestOnLanes | None
    replayed: ReplayedVehicles | None = None


class Candidates(NamedTuple):
    """Vehicles among which some vehicles search for their neighbours.

    Attributes:
        state: In large traffic all vehicles; in small traffic the vehicles of each searching vehicle's scenario.
        derived: Derived quantities of these vehicles.
        index: In small traffic, index of each searching vehicle within its scenario.
    """

    state: TrafficState
    derived: DerivedState
    index: Int[Array, "vehicles *scenarios"] | None = None


class Leader(eqx.Module):
    """The nearest vehicle ahead on a lane; without one, the distance is inf and the speed 0.

    Attributes:
        distance: Along the road, centre to centre [m].
        speed_x: Speed along the road [m/s].
        speed_y: Speed across the road [m/s].
    """

    distance: Float[Array, "#vehicles *#scenarios"]
    speed_x: Float[Array, "#vehicles *#scenarios"]
    speed_y: Float[Array, "#vehicles *#scenarios"]


class Follower(eqx.Module):
    """The nearest vehicle behind on a lane; without one, the distance is inf and the speed is the desired speed.

    Attributes:
        distance: Along the road, centre to centre, positive [m].
        speed: Speed [m/s].
        cos_heading: Cosine of the follower's heading [-].
        sin_heading: Sine of the follower's heading [-].
        speed_ratio: The follower's `DerivedState.speed_ratio` [-]; 1 without a follower, which makes its free
            acceleration zero.
    """

    distance: Float[Array, "#vehicles *#scenarios"]
    speed: Float[Array, "#vehicles *#scenarios"]
    cos_heading: Float[Array, "#vehicles *#scenarios"]
    sin_heading: Float[Array, "#vehicles *#scenarios"]
    speed_ratio: Float[Array, "#vehicles *#scenarios"]

    @property
    def speed_x(self) -> Float[Array, "vehicles *scenarios"]:
        """Speed along the road [m/s]."""
        return rounded(self.speed * self.cos_heading)

    @property
    def speed_y(self) -> Float[Array, "vehicles *scenarios"]:
        """Speed across the road [m/s]."""
        return rounded(self.speed * self.sin_heading)


def occupied_lanes(state: TrafficState, model: TrafficModel) -> Int[Array, "vehicles *scenarios"]:
    """Lanes that each vehicle is on, as bits.

    A vehicle is on a lane while its centre is within half a lane width and 1 m of the lane's centre line, so a vehicle
    between lanes is on two.

    Source: highway-env 1.12.1, `StraightLane.on_lane` as called by `Road.neighbour_vehicles`.
    """
    is_visible = (state.x >= -ROAD_END_MARGIN) & (state.x < model.road_length + ROAD_END_MARGIN)
    bits = jnp.zeros(state.y.shape, jnp.int32)
    for lane in range(model.n_lanes):
        offset = jnp.abs(state.y - lane * model.lane_width)
        is_on = is_visible & (offset <= model.lane_width / 2 + LANE_MARGIN)
        bits = bits | jnp.where(is_on, jnp.int32(lane_bit(lane)), jnp.int32(0))
    return bits


def derive_state(state: TrafficState, model: TrafficModel, replayed: ReplayedVehicles | None = None) -> DerivedState:
    """Derived quantities of every vehicle at the start of a time step, with the recorded vehicles around them.

    Source: highway-env 1.12.1, `IDMVehicle.acceleration` (speed limit).
    """
    desired_speed = state.desired_speed
    if model.speed_limit is not None:
        desired_speed = jnp.clip(desired_speed, 0.0, model.speed_limit)
    ratio = jnp.maximum(state.speed, 0.0) / jnp.abs(not_zero(desired_speed))
    cos_heading, sin_heading = cosine(state.heading), sine(state.heading)
    on_lanes = occupied_lanes(state, model)
    nearest = None
    if is_large(state.x.shape[0]):
        nearest = scan_along_road(state.order, state.x, on_lanes, model.n_lanes)
    return DerivedState(
        lane=nearest_lane(state.y, model),
        cos_heading=cos_heading,
        sin_heading=sin_heading,
        speed_x=rounded(state.speed * cos_heading),
        speed_y=rounded(state.speed * sin_heading),
        speed_ratio=ratio,
        on_lanes=on_lanes,
        nearest=nearest,
        replayed=replayed,
    )


def find_leader(
    state: TrafficState, derived: DerivedState, lane: Int[Array, "vehicles *scenarios"], among: Candidates | None = None
) -> Leader:
    """The nearest vehicle ahead of each vehicle on a lane given for each.

    The same position counts as ahead; of several equally near vehicles the last in the list is taken, a
    replayed one only if it is nearer than all simulated ones.

    Args:
        state: The vehicles that search.
        derived: Derived quantities of these vehicles.
        lane: Lane searched by each of them; -1 and n_lanes are empty.
        among: The vehicles that are searched; None if they are the same vehicles.

    Source: highway-env 1.12.1, `Road.neighbour_vehicles`.
    """
    leader, replayed = _find_simulated_leader(state, derived, lane, among), derived.replayed
    if replayed is None:
        return leader

    def keep_nearest(other: Int[Array, ""], nearest: tuple[Array, Array]) -> tuple[Array, Array]:
        ahead_by = row(replayed.x, other) - state.x
        is_nearer = (row(replayed.lane, other) == lane) & (ahead_by >= 0) & (ahead_by < nearest[0])
        return _replace_where(is_nearer, (ahead_by, row(replayed.speed, other)), nearest)

    distance, speed_x = for_each_replayed(replayed.n_slots, keep_nearest, (leader.distance, leader.speed_x))
    return Leader(distance, speed_x, jnp.where(distance < leader.distance, 0.0, leader.speed_y))


def _find_simulated_leader(
    state: TrafficState, derived: DerivedState, lane: Int[Array, "vehicles *scenarios"], among: Candidates | None
) -> Leader:
    """The leader on a lane among the simulated vehicles."""
    if derived.nearest is not None:
        candidates, index = among or Candidates(state, derived), derived.nearest.ahead_on(lane)
        columns = candidates.state.x, candidates.derived.speed_x, candidates.derived.speed_y
        x, *speeds = (derived.nearest.take(values, index) for values in columns)
        leader = Leader(x - state.x, *speeds)
        return _replace_where(index != NO_VEHICLE, leader, _no_leader(state))
    candidates, bit = among or Candidates(state, derived), lane_bit(lane)
    index, motion = candidates.index, candidates.derived
    own_index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0) if index is None else index

    def keep_nearest(other: Int[Array, ""], nearest: Leader) -> Leader:
        ahead_by = row(candidates.state.x, other) - state.x
        is_ahead = ((row(motion.on_lanes, other) & bit) != 0) & (ahead_by >= 0) & (own_index != other)
        candidate = Leader(ahead_by, row(motion.speed_x, other), row(motion.speed_y, other))
        return _replace_where(is_ahead & (ahead_by <= nearest.distance), candidate, nearest)

    return for_each_vehicle(candidates.state.x.shape[0], keep_nearest, _no_leader(state))


def find_follower(
    state: TrafficState, derived: DerivedState, lane: Int[Array, "vehicles *scenarios"], among: Candidates | None = None
) -> Follower:
    """The nearest vehicle behind each vehicle on a lane given for each; of equally near ones the first in the list.

    Arguments as in `find_leader`. The desired speed of a replayed vehicle, which is unknown, is taken to be its speed.

    Source: highway-env 1.12.1, `Road.neighbour_vehicles`.
    """
    follower, replayed = _find_simulated_follower(state, derived, lane, among), derived.replayed
    if replayed is None:
        return follower

    def keep_nearest(other: Int[Array, ""], nearest: tuple[Array, Array]) -> tuple[Array, Array]:
        behind_by = state.x - row(replayed.x, other)
        is_nearer = (row(replayed.lane, other) == lane) & (behind_by > 0) & (behind_by < nearest[0])
        return _replace_where(is_nearer, (behind_by, row(replayed.speed, other)), nearest)

    distance, speed = for_each_replayed(replayed.n_slots, keep_nearest, (follower.distance, follower.speed))
    ones, zeros = jnp.ones_like(state.x), jnp.zeros_like(state.x)
    replayed_follower = Follower(distance, speed, cos_heading=ones, sin_heading=zeros, speed_ratio=ones)
    return _replace_where(distance < follower.distance, replayed_follower, follower)


def _find_simulated_follower(
    state: TrafficState, derived: DerivedState, lane: Int[Array, "vehicles *scenarios"], among: Candidates | None
) -> Follower:
    """The follower on a lane among the simulated vehicles."""
    candidates = among or Candidates(state, derived)
    motion = candidates.derived
    columns = (candidates.state.speed, motion.cos_heading, motion.sin_heading, motion.speed_ratio)
    if derived.nearest is not None:
        index = derived.nearest.behind_on(lane)
        x, *others = (derived.nearest.take(values, index) for values in (candidates.state.x, *columns))
        follower = Follower(state.x - x, *others)
        return _replace_where(index != NO_VEHICLE, follower, _no_follower(state))
    bit = lane_bit(lane)

    def keep_nearest(other: Int[Array, ""], nearest: Follower) -> Follower:
        behind_by = state.x - row(candidates.state.x, other)
        is_behind = ((row(motion.on_lanes, other) & bit) != 0) & (behind_by > 0)
        candidate = Follower(behind_by, *(row(values, other) for values in columns))
        return _replace_where(is_behind & (behind_by < nearest.distance), candidate, nearest)

    return for_each_vehicle(candidates.state.x.shape[0], keep_nearest, _no_follower(state))


def _no_leader(state: TrafficState) -> Leader:
    """Leader of vehicles that have none."""
    zeros = jnp.zeros_like(state.x)
    return Leader(jnp.full_like(state.x, jnp.inf), zeros, zeros)


def _no_follower(state: TrafficState) -> Follower:
    """Follower of vehicles that have none."""
    zeros = jnp.zeros_like(state.x)
    return Follower(jnp.full_like(state.x, jnp.inf), zeros, zeros + 1, zeros, zeros + 1)


def is_large(n_vehicles: int) -> bool:
    """True if a scan along the sorted vehicles is cheaper than comparing all pairs."""
    return n_vehicles > LARGEST_SMALL_TRAFFIC


def sort_if_large(state: TrafficState) -> TrafficState:
    """The state with its order along the road updated, if the search for neighbours uses it."""
    if not is_large(state.x.shape[0]):
        return state
    return eqx.tree_at(lambda s: s.order, state, sort_along_road(state.x, state.order))


def for_each_vehicle(n_vehicles: int | Array, body: Callable[[Array, Result], Result], start: Result) -> Result:
    """A result updated with every vehicle in list order; straight-line code in small traffic.

    Args:
        n_vehicles: Number of vehicles; if it is only known at run time, the loop has no reverse-mode derivative.
        body: From the index of a vehicle and the result so far to the result with it.
        start: Result without any vehicle.
    """
    unroll = None
    if isinstance(n_vehicles, int):
        unroll = LARGE_TRAFFIC_BLOCK if is_large(n_vehicles) else n_vehicles
    return lax.fori_loop(0, n_vehicles, body, start, unroll=unroll)


def for_each_replayed(n_slots: int, body: Callable[[Array, Result], Result], start: Result) -> Result:
    """A result updated with every slot for a replayed vehicle, as in `for_each_vehicle`; straight-line code up to
    UNROLLED_SLOTS.
    """
    return lax.fori_loop(0, n_slots, body, start, unroll=min(n_slots, UNROLLED_SLOTS))


def row(values: Array, other: Int[Array, ""]) -> Array:
    """Values of one vehicle, with the vehicle axis kept for broadcasting."""
    return lax.dynamic_index_in_dim(values, other, 0, keepdims=True)


def _replace_where(is_nearer: Array, candidate: Result, nearest: Result) -> Result:
    """The nearest so far, replaced where the candidate is nearer."""
    return jax.tree.map(lambda a, b: jnp.where(is_nearer, a, b), candidate, nearest)
