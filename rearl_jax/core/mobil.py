"""Lane changing: MOBIL decisions, and the rule that breaks off a change somebody else is making too.

Source: Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86; highway-env 1.12.1,
`IDMVehicle.change_lane_policy` and `IDMVehicle.mobil`. As there, and unlike in the paper: the deciding driver's
parameters stand in for everybody's, the own safety is not tested, and gains of left and right are not compared.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.drivers import Drivers
from rearl_jax.core.idm import approach_rate, desired_spacing, free_acceleration, interaction
from rearl_jax.core.model import LANE_TEST_LENGTH, TrafficModel
from rearl_jax.core.neighbours import Follower, Leader, Neighbours, View
from rearl_jax.core.state import Controller, TrafficState

LEAST_SPEED = 1.0
"""Speed [m/s] below which nobody decides to change lanes. Source: highway-env 1.12.1, `change_lane_policy`."""

REACHABLE_LANES = 2.0
"""Lateral distance, in lane widths, within which a lane can be reached. Source: highway-env 1.12.1, `is_reachable_from`."""


class Prospects(eqx.Module):
    """Acceleration a driver would have now behind the leader of each lane [m/s^2], unlimited."""

    own: Float[Array, "vehicles *scenarios"]
    target: Float[Array, "vehicles *scenarios"]
    left: Float[Array, "vehicles *scenarios"]
    right: Float[Array, "vehicles *scenarios"]


def weigh_lanes(state: TrafficState, view: View, neighbours: Neighbours, drivers: Drivers) -> Prospects:
    """The driver's own acceleration behind each of the leaders in sight."""
    free = free_acceleration(speed_ratio=view.speed_ratio, params=drivers.idm)

    def behind(leader: Leader) -> Float[Array, "vehicles *scenarios"]:
        dv = _closing_in(view, leader)
        return free - interaction(distance=leader.distance, speed=state.speed, dv=dv, params=drivers.idm)

    return Prospects(
        own=behind(neighbours.leader),
        target=behind(neighbours.target_leader),
        left=behind(neighbours.left_leader),
        right=behind(neighbours.right_leader),
    )


def is_reachable(state: TrafficState, lane: Int[Array, "vehicles *scenarios"], model: TrafficModel) -> Array:
    """Whether a lane exists and a vehicle is near enough to steer to it.

    Source: highway-env 1.12.1, `AbstractLane.is_reachable_from`.
    """
    sideways = jnp.abs(state.y - lane.astype(state.y.dtype) * model.lane_width)
    on_road = (state.x >= 0) & (state.x < model.road_length + LANE_TEST_LENGTH)
    exists = (lane >= 0) & (lane < model.n_lanes)
    return exists & on_road & (sideways <= REACHABLE_LANES * model.lane_width)


def decide_lanes(
    state: TrafficState,
    view: View,
    neighbours: Neighbours,
    prospects: Prospects,
    drivers: Drivers,
    model: TrafficModel,
) -> tuple[Int[Array, "vehicles *scenarios"], Int[Array, "vehicles *scenarios"]]:
    """Target lanes and decision countdowns after every driver whose decision is due has taken it.

    The left lane is looked at first, then the right one; where both are accepted the right one wins. No decision depends
    on another's target lane, so all are taken at once.
    """
    follows_model = (state.controller == Controller.IDM) & ~state.crashed & drivers.mobil.changes_lanes
    due = follows_model & (view.lane == state.target_lane) & (state.ticks_to_decision <= 0)
    willing = due & (jnp.abs(state.speed) >= LEAST_SPEED)
    target_lane = state.target_lane
    sides = (
        (-1, prospects.left, neighbours.left_leader, neighbours.left_follower),
        (+1, prospects.right, neighbours.right_leader, neighbours.right_follower),
    )
    for side, prospect, leader, follower in sides:
        candidate = view.lane + side
        gain = prospect - prospects.own
        imposed = _behind(follower, follower.distance, view, drivers)
        if model.cooperative:
            old = neighbours.follower
            freed = _behind(old, old.distance + neighbours.leader.distance, neighbours.leader, drivers)
            undisturbed = _behind(follower, follower.distance + leader.distance, leader, drivers)
            others = imposed - undisturbed + freed - _behind(old, old.distance, view, drivers)
            gain = gain + drivers.mobil.politeness * others
        accepted = ~(imposed < -drivers.mobil.safe_decel) & ~(gain < drivers.mobil.gain_threshold)
        accepted = accepted & willing & is_reachable(state, candidate, model)
        target_lane = jnp.where(accepted, candidate, target_lane)
    countdown = jnp.where(due, drivers.mobil.decision_period, state.ticks_to_decision)
    return target_lane, countdown


def _closing_in(rear: View | Follower, front: View | Leader) -> Float[Array, "vehicles *scenarios"]:
    """Approach rate of one vehicle to another [m/s]."""
    return approach_rate(
        rear.speed_x,
        rear.speed_y,
        front.speed_x,
        front.speed_y,
        cos_heading=rear.cos_heading,
        sin_heading=rear.sin_heading,
    )


def _behind(follower: Follower, spacing: Array, front: View | Leader, drivers: Drivers) -> Array:
    """A follower's acceleration [m/s^2] behind a vehicle at a spacing [m]; 0 without a follower."""
    free = free_acceleration(speed_ratio=follower.speed_ratio, params=drivers.idm)
    dv = _closing_in(follower, front)
    return free - interaction(distance=spacing, speed=follower.speed, dv=dv, params=drivers.idm)


def abort_conflicts(
    decided_lane: Int[Array, "vehicles *scenarios"],
    state: TrafficState,
    view: View,
    drivers: Drivers,
    model: TrafficModel,
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes after changes in progress have been broken off for the sake of others.

    A vehicle that is changing gives up where another vehicle, ahead within its desired spacing, is on its way into the
    same lane. highway-env asks the vehicles one after another, so each sees the new target lanes of those before it in
    the list and the old ones of those behind. All at once, that is a triangular system of booleans: repeating the
    question with the answers of the round before settles it, in as many rounds as the longest chain of
    vehicles that give way to each other.

    Source: highway-env 1.12.1, `IDMVehicle.change_lane_policy`.
    """
    changing = (state.controller == Controller.IDM) & ~state.crashed & drivers.mobil.changes_lanes
    changing = changing & (view.lane != state.target_lane)

    def ask_everybody(answer: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        blocked = _is_blocked(answer, state, view, drivers)
        return jnp.where(changing & blocked, view.lane, decided_lane)

    def settled_twice(rounds: tuple[Array, Array]) -> Array:
        before, after = rounds
        return jnp.any(before != after)

    first = ask_everybody(decided_lane)
    _, target_lane = lax.while_loop(
        settled_twice, lambda rounds: (rounds[1], ask_everybody(rounds[1])), (decided_lane, first)
    )
    return target_lane


def _is_blocked(
    answer: Int[Array, "vehicles *scenarios"], state: TrafficState, view: View, drivers: Drivers
) -> Bool[Array, "vehicles *scenarios"]:
    """Whether somebody ahead is changing into a vehicle's target lane, if `answer` holds for those before it in the list."""
    n_vehicles = state.x.shape[0]
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)
    state, view, idm = lax.stop_gradient((state, view, drivers.idm))

    def look_at(other: Int[Array, ""], blocked: Array) -> Array:
        def row(values: Array) -> Array:
            return lax.dynamic_index_in_dim(values, other, 0, keepdims=True)

        ahead_by = row(state.x) - state.x
        dv = _closing_in(view, Leader(ahead_by, row(view.speed_x), row(view.speed_y)))
        wanted = desired_spacing(speed=state.speed, dv=dv, params=idm)
        its_target = jnp.where(other < index, row(answer), row(state.target_lane))
        same_goal = (its_target == state.target_lane) & (row(view.lane) != state.target_lane)
        return blocked | (same_goal & (ahead_by > 0) & (ahead_by < wanted))

    nobody = jnp.zeros(state.x.shape, bool)
    return lax.fori_loop(0, n_vehicles, look_at, nobody, unroll=min(n_vehicles, 16))
