"""Lane changing: MOBIL decisions, and the rule that breaks off a change somebody else is making too.

Source: Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86; highway-env 1.12.1,
`IDMVehicle.change_lane_policy` and `IDMVehicle.mobil`. As there, and unlike in the paper: the deciding driver's
parameters stand in for everybody's, the own safety is not tested, and gains of left and right are not compared.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.affected import if_any, on_affected
from rearl_jax.core.drivers import Drivers, IDMParams
from rearl_jax.core.idm import approach_rate, desired_spacing, free_acceleration, interaction
from rearl_jax.core.model import LANE_TEST_LENGTH, TrafficModel
from rearl_jax.core.neighbours import (
    Follower,
    Leader,
    View,
    find_follower,
    find_leader,
    for_each_vehicle,
    row,
)
from rearl_jax.core.order import own_places, pick
from rearl_jax.core.state import Controller, TrafficState

LEAST_SPEED = 1.0
"""Speed [m/s] below which nobody decides to change lanes. Source: highway-env 1.12.1, `change_lane_policy`."""

FEW = 64
"""Vehicles per scenario that may be on their way to another lane for conflicts to be settled among them alone."""

NOWHERE = -1_000
"""A lane that does not exist."""

REACHABLE_LANES = 2.0
"""Lateral distance, in lane widths, within which a lane can be reached. Source: highway-env 1.12.1,
`is_reachable_from`.
"""


class Prospects(eqx.Module):
    """What a driver expects of the lanes in reach [m/s^2], unlimited accelerations.

    Attributes:
        own: Own acceleration behind the leader on the own lane.
        target: Own acceleration behind the leader on the target lane.
        left: Own acceleration behind the leader on the left lane.
        right: Own acceleration behind the leader on the right lane.
        left_follower: Acceleration of the new follower after a change to the left.
        right_follower: Acceleration of the new follower after a change to the right.
        left_others: What the followers gain together by a change to the left; 0 unless the model is cooperative.
        right_others: What the followers gain together by a change to the right.
    """

    own: Float[Array, "vehicles *scenarios"]
    target: Float[Array, "vehicles *scenarios"]
    left: Float[Array, "vehicles *scenarios"]
    right: Float[Array, "vehicles *scenarios"]
    left_follower: Float[Array, "vehicles *scenarios"]
    right_follower: Float[Array, "vehicles *scenarios"]
    left_others: Float[Array, "vehicles *scenarios"]
    right_others: Float[Array, "vehicles *scenarios"]


def is_due(state: TrafficState, view: View, drivers: Drivers) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a driver takes a lane-change decision in this tick."""
    return _decides(state, drivers) & (view.lane == state.target_lane) & (state.ticks_to_decision <= 0)


def _decides(state: TrafficState, drivers: Drivers) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle changes lanes by this model."""
    return (state.controller == Controller.IDM) & ~state.crashed & drivers.mobil.changes_lanes


def weigh_lanes(state: TrafficState, view: View, drivers: Drivers, model: TrafficModel) -> Prospects:
    """The driver's own acceleration on each lane, and what a change would do to the followers.

    Each search is a program of its own (`if_any`): one pass over the vehicles. Left to the compiler, all searches
    would be woven together and every pair of vehicles kept in memory, three times slower.
    """
    left_lane, right_lane, nothing = view.lane - 1, view.lane + 1, jnp.zeros_like(state.x)
    free = free_acceleration(speed_ratio=view.speed_ratio, params=drivers.idm)

    def behind_leader(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        leader = find_leader(state, view, lane)
        dv = _closing_in(view, leader)
        return free - interaction(distance=leader.distance, speed=state.speed, dv=dv, params=drivers.idm)

    def of_follower(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        follower = find_follower(state, view, lane)
        return _behind(follower, follower.distance, view, drivers)

    def gain_of_follower(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        leader = find_leader(state, view, lane)
        follower = find_follower(state, view, lane)
        alone = _behind(follower, follower.distance + leader.distance, leader, drivers)
        return _behind(follower, follower.distance, view, drivers) - alone

    def where_needed(is_needed: Array, look: Callable[[Array], Array], lane: Array) -> Array:
        return if_any(is_needed, lambda: look(lane), nothing)

    follows = state.controller == Controller.IDM
    if model.meta_follows:
        follows = state.controller != Controller.ABSENT
    own = where_needed(follows, behind_leader, view.lane)
    target = where_needed(follows & (view.lane != state.target_lane), behind_leader, state.target_lane)
    if not model.lane_changes:
        return Prospects(own, target, *(nothing,) * 6)
    due = is_due(state, view, drivers)
    left_others = right_others = nothing
    if model.cooperative:
        freed = where_needed(due, gain_of_follower, view.lane)
        left_others = where_needed(due, gain_of_follower, left_lane) - freed
        right_others = where_needed(due, gain_of_follower, right_lane) - freed
    return Prospects(
        own=own,
        target=target,
        left=where_needed(due, behind_leader, left_lane),
        right=where_needed(due, behind_leader, right_lane),
        left_follower=where_needed(due, of_follower, left_lane),
        right_follower=where_needed(due, of_follower, right_lane),
        left_others=left_others,
        right_others=right_others,
    )


def is_reachable(state: TrafficState, lane: Int[Array, "vehicles *scenarios"], model: TrafficModel) -> Array:
    """Whether a lane exists and a vehicle is near enough to steer to it.

    Source: highway-env 1.12.1, `AbstractLane.is_reachable_from`.
    """
    sideways = jnp.abs(state.y - lane.astype(state.y.dtype) * model.lane_width)
    on_road = (state.x >= 0) & (state.x < model.road_length + LANE_TEST_LENGTH)
    exists = (lane >= 0) & (lane < model.n_lanes)
    return exists & on_road & (sideways <= REACHABLE_LANES * model.lane_width)


def lane_gains(
    prospects: Prospects, drivers: Drivers, model: TrafficModel
) -> tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]:
    """What a change to the left and to the right gains [m/s^2]: the own acceleration and, weighted, the followers'."""

    def gain(prospect: Array, others: Array) -> Float[Array, "vehicles *scenarios"]:
        own = prospect - prospects.own
        return own + drivers.mobil.politeness * others if model.cooperative else own

    return gain(prospects.left, prospects.left_others), gain(prospects.right, prospects.right_others)


def is_moving(state: TrafficState) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle is fast enough to change lanes."""
    return jnp.abs(state.speed) >= LEAST_SPEED


def is_unsafe(follower: Float[Array, "vehicles *scenarios"], drivers: Drivers) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a change would make the new follower, whose acceleration [m/s^2] is given, brake too hard."""
    return follower < -drivers.mobil.safe_decel


def decide_lanes(
    state: TrafficState,
    view: View,
    prospects: Prospects,
    gains: tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]],
    drivers: Drivers,
    model: TrafficModel,
) -> tuple[Int[Array, "vehicles *scenarios"], Int[Array, "vehicles *scenarios"]]:
    """Target lanes and decision countdowns after every driver whose decision is due has taken it.

    The left lane is looked at first, then the right one; where both are accepted the right one wins. No decision
    depends on another's target lane, so all are taken at once.
    """
    due = is_due(state, view, drivers)
    willing = due & is_moving(state)
    target_lane = state.target_lane
    followers = prospects.left_follower, prospects.right_follower
    for side, gain, follower in zip((-1, +1), gains, followers, strict=True):
        candidate = view.lane + side
        accepted = ~is_unsafe(follower, drivers) & ~(gain < drivers.mobil.gain_threshold)
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
    changing = _decides(state, drivers) & (view.lane != state.target_lane)
    concerned = jnp.zeros(changing.shape[1:], bool)
    for lane in range(model.n_lanes):
        enters = (view.lane != lane) & ((state.target_lane == lane) | (decided_lane == lane))
        gives_way = changing & (state.target_lane == lane)
        concerned = concerned | ((jnp.sum(enters, axis=0) >= 2) & jnp.any(gives_way, axis=0))
    view = eqx.tree_at(lambda v: v.nearest, view, None, is_leaf=lambda leaf: leaf is None)
    # What drivers remember has other axes than the treated few scenarios could be picked from.
    operands = lax.stop_gradient((decided_lane, changing, replace(state, memory=None), view, drivers.idm))
    settle = _settle_few if state.x.shape[0] >= 2 * FEW else _settle
    return on_affected(concerned, settle, operands, decided_lane)


def _settle_few(
    operands: tuple[Int[Array, "n *s"], Bool[Array, "n *s"], TrafficState, View, IDMParams],
) -> Int[Array, "n *s"]:
    """What `_settle` finds, of those alone who are or will be on their way to another lane, where they are few."""
    decided_lane, _, state, view, _ = operands
    shape = state.x.shape
    moves = (state.target_lane != view.lane) | (decided_lane != view.lane)

    def among_few() -> Int[Array, "n *s"]:
        index = lax.broadcasted_iota(jnp.int32, shape, 0)
        slot = jnp.where(moves, jnp.cumsum(moves, axis=0, dtype=jnp.int32) - 1, FEW)
        nobody = jnp.full((FEW, *shape[1:]), shape[0], jnp.int32)
        who = nobody.at[own_places(slot)].set(index, mode="drop")
        is_there = who < shape[0]

        def take(values: Array) -> Array:
            return pick(values, jnp.minimum(who, shape[0] - 1))

        decided, changing, few, seen, idm = jax.tree.map(take, operands)
        # An empty place is on its way to where nobody else is going.
        few = replace(few, target_lane=jnp.where(is_there, few.target_lane, NOWHERE))
        answer = _settle((jnp.where(is_there, decided, NOWHERE), changing & is_there, few, seen, idm))
        return decided_lane.at[own_places(who)].set(answer, mode="drop")

    return lax.cond(jnp.all(jnp.sum(moves, axis=0) <= FEW), among_few, lambda: _settle(operands))


def _settle(
    operands: tuple[Int[Array, "n *s"], Bool[Array, "n *s"], TrafficState, View, IDMParams],
) -> Int[Array, "n *s"]:
    """Target lanes once every answer follows from the others."""
    decided_lane, changing, state, view, idm = operands

    def ask_everybody(answer: Int[Array, "n *s"]) -> Int[Array, "n *s"]:
        return jnp.where(changing & _is_blocked(answer, state, view, idm), view.lane, decided_lane)

    def is_unsettled(rounds: tuple[Array, Array]) -> Array:
        return jnp.any(rounds[0] != rounds[1])

    rounds = decided_lane, ask_everybody(decided_lane)
    return lax.while_loop(is_unsettled, lambda rounds: (rounds[1], ask_everybody(rounds[1])), rounds)[1]


def _is_blocked(
    answer: Int[Array, "vehicles *scenarios"], state: TrafficState, view: View, idm: IDMParams
) -> Bool[Array, "vehicles *scenarios"]:
    """Whether somebody ahead is changing into a vehicle's target lane, if `answer` holds for those before it in the
    list.
    """
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)

    def look_at(other: Int[Array, ""], blocked: Array) -> Array:
        ahead_by = row(state.x, other) - state.x
        dv = _closing_in(view, Leader(ahead_by, row(view.speed_x, other), row(view.speed_y, other)))
        wanted = desired_spacing(speed=state.speed, dv=dv, params=idm)
        its_target = jnp.where(other < index, row(answer, other), row(state.target_lane, other))
        same_goal = (its_target == state.target_lane) & (row(view.lane, other) != state.target_lane)
        return blocked | (same_goal & (ahead_by > 0) & (ahead_by < wanted))

    return for_each_vehicle(state.x.shape[0], look_at, jnp.zeros(state.x.shape, bool))
