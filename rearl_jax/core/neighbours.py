"""What a driver sees: the leader and the follower in the lanes that matter.

In small traffic every driver looks at all other vehicles one after another and keeps the nearest ("running minimum").
That costs n_vehicles^2 comparisons, but only comparisons and selections, which a compiler turns into straight vector
code over the scenarios. In large traffic the vehicles are sorted along the road (`rearl_jax.core.order`), and who is
next on every lane is read off that order (`rearl_jax.core.nearest`).
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
from rearl_jax.core.model import LANE_TEST_LENGTH, TrafficModel
from rearl_jax.core.nearest import NearestOnLanes, lane_bit, scan_along_road
from rearl_jax.core.order import NOBODY, sort_along_road
from rearl_jax.core.state import TrafficState, nearest_lane

Found = TypeVar("Found")

LANE_MARGIN = 1.0
"""A vehicle counts as being on a lane up to this distance [m] beyond the lane's edge.

Source: highway-env 1.12.1, `Road.neighbour_vehicles(margin=1)`."""

LARGEST_SMALL_TRAFFIC = 18
"""Most vehicles for which everybody looks at everybody."""

LARGE_TRAFFIC_BLOCK = 8
"""Vehicles per pass of a loop over all vehicles in large traffic, where only rare work needs one."""


class View(eqx.Module):
    """What others can see of each vehicle, and what the stages of one time step share.

    Attributes:
        lane: Nearest lane.
        cos_heading: Cosine of the heading [-].
        sin_heading: Sine of the heading [-].
        speed_x: Speed along the road [m/s].
        speed_y: Speed across the road [m/s].
        speed_ratio: max(v, 0) / |v0| with the vehicle's own desired speed v0 under the speed limit [-].
        on_lanes: The lanes the vehicle is on, as bits (`lane_bit`); none where it is out of sight beyond the road.
        nearest: Who is next on every lane; None in small traffic, where everybody looks at everybody.
    """

    lane: Int[Array, "vehicles *scenarios"]
    cos_heading: Float[Array, "vehicles *scenarios"]
    sin_heading: Float[Array, "vehicles *scenarios"]
    speed_x: Float[Array, "vehicles *scenarios"]
    speed_y: Float[Array, "vehicles *scenarios"]
    speed_ratio: Float[Array, "vehicles *scenarios"]
    on_lanes: Int[Array, "vehicles *scenarios"]
    nearest: NearestOnLanes | None


class Traffic(NamedTuple):
    """All vehicles and what can be seen of them, where only some of them look."""

    state: TrafficState
    view: View


class Leader(eqx.Module):
    """The nearest vehicle ahead on a lane; distance inf and standing still where there is none.

    Attributes:
        distance: Along the road, centre to centre [m].
        speed_x: Its speed along the road [m/s].
        speed_y: Its speed across the road [m/s].
    """

    distance: Float[Array, "#vehicles *#scenarios"]
    speed_x: Float[Array, "#vehicles *#scenarios"]
    speed_y: Float[Array, "#vehicles *#scenarios"]


class Follower(eqx.Module):
    """The nearest vehicle behind on a lane; distance inf and driving at its desired speed where there is none.

    Attributes:
        distance: Along the road, centre to centre, positive [m].
        speed: Its speed [m/s].
        cos_heading: Cosine of its heading [-].
        sin_heading: Sine of its heading [-].
        speed_ratio: Its `View.speed_ratio` [-]; 1 without a follower, which makes its free acceleration zero.
    """

    distance: Float[Array, "#vehicles *#scenarios"]
    speed: Float[Array, "#vehicles *#scenarios"]
    cos_heading: Float[Array, "#vehicles *#scenarios"]
    sin_heading: Float[Array, "#vehicles *#scenarios"]
    speed_ratio: Float[Array, "#vehicles *#scenarios"]

    @property
    def speed_x(self) -> Float[Array, "vehicles *scenarios"]:
        """Its speed along the road [m/s]."""
        return rounded(self.speed * self.cos_heading)

    @property
    def speed_y(self) -> Float[Array, "vehicles *scenarios"]:
        """Its speed across the road [m/s]."""
        return rounded(self.speed * self.sin_heading)


def lanes_under(state: TrafficState, model: TrafficModel) -> Int[Array, "vehicles *scenarios"]:
    """The lanes each vehicle is on, as bits.

    A vehicle is on a lane while its centre is within half a lane width and 1 m of the lane's centre line, so a vehicle
    between lanes is on two.

    Source: highway-env 1.12.1, `StraightLane.on_lane` as called by `Road.neighbour_vehicles`.
    """
    is_visible = (state.x >= -LANE_TEST_LENGTH) & (state.x < model.road_length + LANE_TEST_LENGTH)
    bits = jnp.zeros(state.y.shape, jnp.int32)
    for lane in range(model.n_lanes):
        offset = jnp.abs(state.y - lane * model.lane_width)
        is_on = is_visible & (offset <= model.lane_width / 2 + LANE_MARGIN)
        bits = bits | jnp.where(is_on, jnp.int32(lane_bit(lane)), jnp.int32(0))
    return bits


def perceive(state: TrafficState, model: TrafficModel) -> View:
    """What can be seen of each vehicle at the start of a time step.

    Source: highway-env 1.12.1, `IDMVehicle.acceleration` (speed limit).
    """
    desired_speed = state.desired_speed
    if model.speed_limit is not None:
        desired_speed = jnp.clip(desired_speed, 0.0, model.speed_limit)
    ratio = jnp.maximum(state.speed, 0.0) / jnp.abs(not_zero(desired_speed))
    cos_heading, sin_heading = cosine(state.heading), sine(state.heading)
    on_lanes = lanes_under(state, model)
    nearest = None
    if is_large(state.x.shape[0]):
        nearest = scan_along_road(state.order, state.x, on_lanes, model.n_lanes)
    return View(
        lane=nearest_lane(state.y, model),
        cos_heading=cos_heading,
        sin_heading=sin_heading,
        speed_x=rounded(state.speed * cos_heading),
        speed_y=rounded(state.speed * sin_heading),
        speed_ratio=ratio,
        on_lanes=on_lanes,
        nearest=nearest,
    )


def find_leader(
    state: TrafficState, view: View, lane: Int[Array, "vehicles *scenarios"], among: Traffic | None = None
) -> Leader:
    """The nearest vehicle ahead of each vehicle on a lane of its choice.

    The same position counts as ahead; of several equally near vehicles the last in the list is taken.

    Args:
        state: The vehicles that look.
        view: What can be seen of them.
        lane: The lane each of them looks at; -1 and n_lanes are empty.
        among: The traffic they look at, which is large; None for themselves.

    Source: highway-env 1.12.1, `Road.neighbour_vehicles`.
    """
    if view.nearest is not None:
        its, index = among or Traffic(state, view), view.nearest.ahead_on(lane)
        x, *speeds = (view.nearest.take(values, index) for values in (its.state.x, its.view.speed_x, its.view.speed_y))
        seen = Leader(x - state.x, *speeds)
        return _replace_where(index != NOBODY, seen, _nobody_ahead(state))
    bit = lane_bit(lane)
    own_index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)

    def look_at(other: Int[Array, ""], found: Leader) -> Leader:
        ahead_by = row(state.x, other) - state.x
        is_ahead = ((row(view.on_lanes, other) & bit) != 0) & (ahead_by >= 0) & (own_index != other)
        new = Leader(ahead_by, row(view.speed_x, other), row(view.speed_y, other))
        return _replace_where(is_ahead & (ahead_by <= found.distance), new, found)

    return for_each_vehicle(state.x.shape[0], look_at, _nobody_ahead(state))


def find_follower(
    state: TrafficState, view: View, lane: Int[Array, "vehicles *scenarios"], among: Traffic | None = None
) -> Follower:
    """The nearest vehicle behind each vehicle on a lane of its choice; of equally near ones the first in the list.

    Arguments as of `find_leader`.

    Source: highway-env 1.12.1, `Road.neighbour_vehicles`.
    """
    traffic = among or Traffic(state, view)
    its = traffic.view
    seen = (traffic.state.speed, its.cos_heading, its.sin_heading, its.speed_ratio)
    if view.nearest is not None:
        index = view.nearest.behind_on(lane)
        x, *others = (view.nearest.take(values, index) for values in (traffic.state.x, *seen))
        new = Follower(state.x - x, *others)
        return _replace_where(index != NOBODY, new, _nobody_behind(state))
    bit = lane_bit(lane)

    def look_at(other: Int[Array, ""], found: Follower) -> Follower:
        behind_by = state.x - row(state.x, other)
        is_behind = ((row(view.on_lanes, other) & bit) != 0) & (behind_by > 0)
        new = Follower(behind_by, *(row(values, other) for values in seen))
        return _replace_where(is_behind & (behind_by < found.distance), new, found)

    return for_each_vehicle(state.x.shape[0], look_at, _nobody_behind(state))


def _nobody_ahead(state: TrafficState) -> Leader:
    """Nobody ahead of anybody."""
    still = jnp.zeros_like(state.x)
    return Leader(jnp.full_like(state.x, jnp.inf), still, still)


def _nobody_behind(state: TrafficState) -> Follower:
    """Nobody behind anybody."""
    still = jnp.zeros_like(state.x)
    return Follower(jnp.full_like(state.x, jnp.inf), still, still + 1, still, still + 1)


def is_large(n_vehicles: int) -> bool:
    """Whether walking along the sorted vehicles is cheaper than letting everybody look at everybody."""
    return n_vehicles > LARGEST_SMALL_TRAFFIC


def sort_if_large(state: TrafficState) -> TrafficState:
    """The state with its order along the road up to date, where the search for neighbours walks along it."""
    if not is_large(state.x.shape[0]):
        return state
    return eqx.tree_at(lambda s: s.order, state, sort_along_road(state.x, state.order))


def for_each_vehicle(n_vehicles: int | Array, look_at: Callable[[Array, Found], Found], nothing: Found) -> Found:
    """What every vehicle has found after looking at all vehicles in list order; straight-line code in small traffic.

    A number that is only known when the program runs has no derivatives backwards.
    """
    unroll = None
    if isinstance(n_vehicles, int):
        unroll = LARGE_TRAFFIC_BLOCK if is_large(n_vehicles) else n_vehicles
    return lax.fori_loop(0, n_vehicles, look_at, nothing, unroll=unroll)


def row(values: Array, other: Int[Array, ""]) -> Array:
    """One vehicle's values, against which all others are held."""
    return lax.dynamic_index_in_dim(values, other, 0, keepdims=True)


def _replace_where(is_nearer: Array, new: Found, found: Found) -> Found:
    """What was found so far, replaced where something nearer has come up."""
    return jax.tree.map(lambda a, b: jnp.where(is_nearer, a, b), new, found)
