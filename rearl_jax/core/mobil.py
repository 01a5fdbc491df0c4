"""Lane changing: MOBIL decisions.

Source: Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86; highway-env 1.12.1,
`IDMVehicle.change_lane_policy` and `IDMVehicle.mobil`. As in highway-env, and unlike in the paper, the deciding
driver's parameters replace those of the followers, except their desired speeds; a driver's own safety is not tested,
and the gains of left and right are not compared.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.highway_env_idm import HighwayEnvIDM
from rearl_jax.core.compaction import if_any
from rearl_jax.core.double_double import rounded
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import ROAD_END_MARGIN, TrafficModel
from rearl_jax.core.neighbours import (
    Candidates,
    DerivedState,
    Follower,
    Leader,
    find_follower,
    find_leader,
)
from rearl_jax.core.state import Controller, TrafficState

MIN_LANE_CHANGE_SPEED = 1.0
"""Speed [m/s] below which no vehicle decides to change lanes. Source: highway-env 1.12.1, `change_lane_policy`."""

REACHABLE_LANES = 2.0
"""Lateral distance, in lane widths, within which a lane can be reached. Source: highway-env 1.12.1,
`is_reachable_from`.
"""


class LaneAccelerations(eqx.Module):
    """Car-following accelerations that a driver compares [m/s^2], before the limits of the vehicle are applied.

    Attributes:
        own: Acceleration of the vehicle behind its leader.
        left: Acceleration of the vehicle behind the leader on the left lane.
        right: Acceleration of the vehicle behind the leader on the right lane.
        left_follower: Acceleration of the new follower after a change to the left.
        right_follower: Acceleration of the new follower after a change to the right.
        left_others: Gains of the present and the new follower by a change to the left, added; 0 unless the model is
            cooperative.
        right_others: The same for a change to the right.
    """

    own: Float[Array, "vehicles *scenarios"]
    left: Float[Array, "vehicles *scenarios"]
    right: Float[Array, "vehicles *scenarios"]
    left_follower: Float[Array, "vehicles *scenarios"]
    right_follower: Float[Array, "vehicles *scenarios"]
    left_others: Float[Array, "vehicles *scenarios"]
    right_others: Float[Array, "vehicles *scenarios"]


def is_due(state: TrafficState, derived: DerivedState, drivers: Drivers) -> Bool[Array, "vehicles *scenarios"]:
    """True if a driver takes a lane-change decision in this time step."""
    return uses_mobil(state, drivers) & (derived.lane == state.target_lane) & (state.ticks_to_decision <= 0)


def restart_countdown(
    state: TrafficState, derived: DerivedState, drivers: Drivers
) -> Int[Array, "vehicles *scenarios"]:
    """Ticks to the next decision, restarted for drivers who decide in this time step."""
    return jnp.where(is_due(state, derived, drivers), drivers.mobil.decision_period, state.ticks_to_decision)


def uses_mobil(state: TrafficState, drivers: Drivers) -> Bool[Array, "vehicles *scenarios"]:
    """True for vehicles whose lane changes follow MOBIL."""
    return (state.controller == Controller.IDM) & ~state.crashed & drivers.mobil.changes_lanes


def evaluate_lanes(
    state: TrafficState,
    derived: DerivedState,
    free: Float[Array, "vehicles *scenarios"],
    own_acceleration: Float[Array, "vehicles *scenarios"],
    due: Bool[Array, "vehicles *scenarios"],
    drivers: Drivers,
    model: TrafficModel,
    among: Candidates | None = None,
) -> LaneAccelerations:
    """Accelerations on the lanes of every deciding driver, and those of the new followers.

    Each search is compiled separately (`if_any`) as one pass over the vehicles, because otherwise XLA fuses all
    searches and stores every pair of vehicles, which is three times slower.

    Args:
        state: The vehicles that decide.
        derived: Derived quantities of these vehicles.
        free: Acceleration of these vehicles on a free road [m/s^2].
        own_acceleration: Acceleration of these vehicles behind their leaders [m/s^2].
        due: Vehicles whose decision is due; results for others are undefined.
        drivers: Parameters of these vehicles.
        model: Traffic model; only its road is used.
        among: The vehicles that they search; None if they are the same vehicles.
    """
    left_lane, right_lane, zeros = derived.lane - 1, derived.lane + 1, jnp.zeros_like(state.x)

    def behind_leader(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        return acceleration_behind(free, state, derived, find_leader(state, derived, lane, among), drivers)

    def new_follower(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        follower = find_follower(state, derived, lane, among)
        return _follower_acceleration(follower, follower.distance, derived, drivers)

    def follower_gain(lane: Array) -> Float[Array, "vehicles *scenarios"]:
        """Gain of the follower on a lane from the vehicle's presence there, usually negative."""
        leader = find_leader(state, derived, lane, among)
        follower = find_follower(state, derived, lane, among)
        before_change = _follower_acceleration(follower, follower.distance + leader.distance, leader, drivers)
        return _follower_acceleration(follower, follower.distance, derived, drivers) - before_change

    def where_due(evaluate: Callable[[Array], Array], lane: Array) -> Array:
        return if_any(due, lambda: evaluate(lane), zeros)

    left_others = right_others = zeros
    if model.cooperative:
        present = where_due(follower_gain, derived.lane)  # this gain ends with the change
        left_others = where_due(follower_gain, left_lane) - present
        right_others = where_due(follower_gain, right_lane) - present
    return LaneAccelerations(
        own=own_acceleration,
        left=where_due(behind_leader, left_lane),
        right=where_due(behind_leader, right_lane),
        left_follower=where_due(new_follower, left_lane),
        right_follower=where_due(new_follower, right_lane),
        left_others=left_others,
        right_others=right_others,
    )


def is_reachable(state: TrafficState, lane: Int[Array, "vehicles *scenarios"], model: TrafficModel) -> Array:
    """True if a lane exists and the vehicle is near enough to steer to it.

    Source: highway-env 1.12.1, `AbstractLane.is_reachable_from`.
    """
    lateral_distance = jnp.abs(state.y - lane.astype(state.y.dtype) * model.lane_width)
    on_road = (state.x >= 0) & (state.x < model.road_length + ROAD_END_MARGIN)
    exists = (lane >= 0) & (lane < model.n_lanes)
    return exists & on_road & (lateral_distance <= REACHABLE_LANES * model.lane_width)


def lane_gains(
    accelerations: LaneAccelerations, drivers: Drivers, model: TrafficModel
) -> tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]:
    """Gains of a change to the left and to the right [m/s^2]: the driver's and, weighted, the followers' gains."""

    def gain(acceleration: Array, others: Array) -> Float[Array, "vehicles *scenarios"]:
        own_gain = acceleration - accelerations.own
        return own_gain + drivers.mobil.politeness * others if model.cooperative else own_gain

    return gain(accelerations.left, accelerations.left_others), gain(accelerations.right, accelerations.right_others)


def is_fast_enough(state: TrafficState) -> Bool[Array, "vehicles *scenarios"]:
    """True if a vehicle is fast enough to change lanes."""
    return jnp.abs(state.speed) >= MIN_LANE_CHANGE_SPEED


def is_unsafe(
    follower_acceleration: Float[Array, "vehicles *scenarios"], drivers: Drivers
) -> Bool[Array, "vehicles *scenarios"]:
    """True if the new follower, with the given acceleration [m/s^2], would brake too hard."""
    return follower_acceleration < -drivers.mobil.safe_decel


def decide_lanes(
    state: TrafficState,
    derived: DerivedState,
    due: Bool[Array, "vehicles *scenarios"],
    accelerations: LaneAccelerations,
    gains: tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]],
    drivers: Drivers,
    model: TrafficModel,
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes after all due decisions.

    The left lane is tested first, then the right lane; if both are accepted, the right lane is chosen. No decision
    depends on the target lane of another vehicle, so all are taken at once.

    Args:
        state: The vehicles that decide.
        derived: Derived quantities of these vehicles.
        due: Vehicles whose decision is due.
        accelerations: Accelerations on the lanes [m/s^2].
        gains: Gains of a change to the left and to the right [m/s^2].
        drivers: Parameters of these vehicles.
        model: Traffic model; only its road is used.
    """
    willing = due & is_fast_enough(state)
    target_lane = state.target_lane
    followers = accelerations.left_follower, accelerations.right_follower
    for side, gain, follower in zip((-1, +1), gains, followers, strict=True):
        candidate = derived.lane + side
        accepted = ~is_unsafe(follower, drivers) & ~(gain < drivers.mobil.gain_threshold)
        accepted = accepted & willing & is_reachable(state, candidate, model)
        target_lane = jnp.where(accepted, candidate, target_lane)
    return target_lane


def acceleration_behind(
    free: Float[Array, "vehicles *scenarios"],
    state: TrafficState,
    derived: DerivedState,
    leader: Leader,
    drivers: Drivers,
) -> Float[Array, "vehicles *scenarios"]:
    """Acceleration of each vehicle behind a leader [m/s^2], from its free-road acceleration."""
    assert isinstance(drivers.car_following, HighwayEnvIDM)  # all others drive by gaps
    dv = approach_rate(derived, leader)
    return free - drivers.car_following.interaction_at(distance=leader.distance, speed=state.speed, approach_rate=dv)


def approach_rate(rear: DerivedState | Follower, front: DerivedState | Leader) -> Float[Array, "vehicles *scenarios"]:
    """Approach rate dv of a rear to a front vehicle, along the rear vehicle's heading [m/s]; positive = closing in.

    Source: highway-env 1.12.1, `IDMVehicle.desired_gap` (projected).
    """
    speed_x, speed_y = rear.speed_x, rear.speed_y
    return rounded((speed_x - front.speed_x) * rear.cos_heading) + (speed_y - front.speed_y) * rear.sin_heading


def _follower_acceleration(follower: Follower, spacing: Array, front: DerivedState | Leader, drivers: Drivers) -> Array:
    """A follower's acceleration [m/s^2] behind a vehicle at a spacing [m]; 0 without a follower."""
    assert isinstance(drivers.car_following, HighwayEnvIDM)
    free = drivers.car_following.free_acceleration_at(speed_ratio=follower.speed_ratio)
    dv = approach_rate(follower, front)
    return free - drivers.car_following.interaction_at(distance=spacing, speed=follower.speed, approach_rate=dv)
