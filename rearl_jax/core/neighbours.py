"""What a driver sees: the leader and the follower in the lanes that matter.

Every driver looks at all other vehicles one after another and keeps the nearest ("running minimum"). That costs
n_vehicles^2 comparisons but only comparisons and selections, which a compiler turns into straight vector code over the
scenarios: up to some 200 vehicles it beats sorting and gathering.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.elementary import cosine, rounded, sine
from rearl_jax.core.model import LANE_TEST_LENGTH, TrafficModel
from rearl_jax.core.state import TrafficState, nearest_lane

LANE_MARGIN = 1.0
"""A vehicle counts as being on a lane up to this distance [m] beyond the lane's edge.

Source: highway-env 1.12.1, `Road.neighbour_vehicles(margin=1)`."""

UNROLLED_VEHICLES = 16
"""Most vehicles for which the search is compiled as straight-line code; beyond it runs in blocks of this many."""

class View(eqx.Module):
    """What others can see of each vehicle, and what the stages of one tick share.

    Attributes:
        lane: Nearest lane.
        cos_heading: Cosine of the heading [-].
        sin_heading: Sine of the heading [-].
        speed_x: Speed along the road [m/s].
        speed_y: Speed across the road [m/s].
        speed_ratio: max(v, 0) / |v0| with the vehicle's own desired speed v0 under the speed limit [-].
        visible_y: Lateral position [m]; inf where the lane's range test hides the vehicle.
    """

    lane: Int[Array, "vehicles *scenarios"]
    cos_heading: Float[Array, "vehicles *scenarios"]
    sin_heading: Float[Array, "vehicles *scenarios"]
    speed_x: Float[Array, "vehicles *scenarios"]
    speed_y: Float[Array, "vehicles *scenarios"]
    speed_ratio: Float[Array, "vehicles *scenarios"]
    visible_y: Float[Array, "vehicles *scenarios"]


class Leader(eqx.Module):
    """The nearest vehicle ahead on a lane; distance inf and standing still where there is none.

    Attributes:
        distance: Along the road, centre to centre [m].
        speed_x: Its speed along the road [m/s].
        speed_y: Its speed across the road [m/s].
    """

    distance: Float[Array, "vehicles *scenarios"]
    speed_x: Float[Array, "vehicles *scenarios"]
    speed_y: Float[Array, "vehicles *scenarios"]


class Follower(eqx.Module):
    """The nearest vehicle behind on a lane; distance inf and driving at its desired speed where there is none.

    Attributes:
        distance: Along the road, centre to centre, positive [m].
        speed: Its speed [m/s].
        speed_x: Its speed along the road [m/s].
        speed_y: Its speed across the road [m/s].
        cos_heading: Cosine of its heading [-].
        sin_heading: Sine of its heading [-].
        speed_ratio: Its `View.speed_ratio` [-]; 1 without a follower, which makes its free acceleration zero.
    """

    distance: Float[Array, "vehicles *scenarios"]
    speed: Float[Array, "vehicles *scenarios"]
    speed_x: Float[Array, "vehicles *scenarios"]
    speed_y: Float[Array, "vehicles *scenarios"]
    cos_heading: Float[Array, "vehicles *scenarios"]
    sin_heading: Float[Array, "vehicles *scenarios"]
    speed_ratio: Float[Array, "vehicles *scenarios"]


class Neighbours(eqx.Module):
    """Leaders on the own, the target, the left and the right lane; followers on the own, the left and the right lane."""

    leader: Leader
    target_leader: Leader
    left_leader: Leader
    right_leader: Leader
    follower: Follower
    left_follower: Follower
    right_follower: Follower


def not_zero(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The value, moved away from zero to +-0.01 with its sign (zero counts as positive).

    Source: highway-env 1.12.1, `utils.not_zero`.
    """
    return jnp.where(jnp.abs(value) > 0.01, value, jnp.where(value >= 0, 0.01, -0.01))


def perceive(state: TrafficState, model: TrafficModel) -> View:
    """What can be seen of each vehicle at the start of a tick.

    Source: highway-env 1.12.1, `StraightLane.on_lane` and `IDMVehicle.acceleration` (speed limit).
    """
    desired_speed = state.desired_speed
    if model.speed_limit is not None:
        desired_speed = jnp.clip(desired_speed, 0.0, model.speed_limit)
    ratio = jnp.maximum(state.speed, 0.0) / jnp.abs(not_zero(desired_speed))
    is_visible = (state.x >= -LANE_TEST_LENGTH) & (state.x < model.road_length + LANE_TEST_LENGTH)
    cos_heading, sin_heading = cosine(state.heading), sine(state.heading)
    return View(
        lane=nearest_lane(state.y, model),
        cos_heading=cos_heading,
        sin_heading=sin_heading,
        speed_x=rounded(state.speed * cos_heading),
        speed_y=rounded(state.speed * sin_heading),
        speed_ratio=ratio,
        visible_y=jnp.where(is_visible, state.y, jnp.inf),
    )


def find_neighbours(state: TrafficState, view: View, model: TrafficModel) -> Neighbours:
    """Leaders and followers of every vehicle on the lanes it may drive on next.

    A vehicle is on a lane while its centre is within half a lane width and 1 m of the lane's centre line, so a vehicle
    between lanes is on two. The same position counts as ahead; of several equally near leaders the last in the list is
    taken, of equally near followers the first.

    Source: highway-env 1.12.1, `Road.neighbour_vehicles`.
    """
    n_vehicles = state.x.shape[0]
    half_width = model.lane_width / 2 + LANE_MARGIN
    centre = view.lane.astype(state.x.dtype) * model.lane_width
    target_centre = state.target_lane.astype(state.x.dtype) * model.lane_width
    self_index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)
    seen_leader = (view.speed_x, view.speed_y)
    seen_follower = (state.speed, view.speed_x, view.speed_y, view.cos_heading, view.sin_heading, view.speed_ratio)

    def look_at(other: Int[Array, ""], found: Neighbours) -> Neighbours:
        def row(values: Array) -> Array:
            return lax.dynamic_index_in_dim(values, other, 0, keepdims=True)

        ahead_by = row(state.x) - state.x
        is_ahead = (ahead_by >= 0) & (self_index != other)
        other_y = row(view.visible_y)

        def is_on(lane_centre: Array) -> Bool[Array, "vehicles *scenarios"]:
            return jnp.abs(other_y - lane_centre) <= half_width

        def nearer_leader(leader: Leader, on_lane: Array) -> Leader:
            nearer = on_lane & is_ahead & (ahead_by <= leader.distance)
            new = Leader(ahead_by, *map(row, seen_leader))
            return jax.tree.map(lambda a, b: jnp.where(nearer, a, b), new, leader)

        def nearer_follower(follower: Follower, on_lane: Array) -> Follower:
            nearer = on_lane & (ahead_by < 0) & (-ahead_by < follower.distance)
            new = Follower(-ahead_by, *map(row, seen_follower))
            return jax.tree.map(lambda a, b: jnp.where(nearer, a, b), new, follower)

        on_own, on_left, on_right = is_on(centre), is_on(centre - model.lane_width), is_on(centre + model.lane_width)
        return Neighbours(
            leader=nearer_leader(found.leader, on_own),
            target_leader=nearer_leader(found.target_leader, is_on(target_centre)),
            left_leader=nearer_leader(found.left_leader, on_left),
            right_leader=nearer_leader(found.right_leader, on_right),
            follower=nearer_follower(found.follower, on_own),
            left_follower=nearer_follower(found.left_follower, on_left),
            right_follower=nearer_follower(found.right_follower, on_right),
        )

    far, still = jnp.full_like(state.x, jnp.inf), jnp.zeros_like(state.x)
    nobody_ahead, nobody_behind = Leader(far, still, still), Follower(far, still, still, still, still + 1, still, still + 1)
    nobody = Neighbours(*(nobody_ahead,) * 4, *(nobody_behind,) * 3)
    return lax.fori_loop(0, n_vehicles, look_at, nobody, unroll=min(n_vehicles, UNROLLED_VEHICLES))
