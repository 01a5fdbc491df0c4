"""Admissible actions of each vehicle."""

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.decision import AdmissibleConfig, LaneGate
from rearl_jax.core.car_following.model import SpacingStimulus
from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.mobil import approach_rate
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.nearest import lane_bit
from rearl_jax.core.neighbours import (
    DerivedState,
    derive_state,
    find_follower,
    find_leader,
    for_each_vehicle,
    occupied_lanes,
    row,
    sort_if_large,
)
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import Controller, TrafficState, nearest_lane, nearest_level


def admissible_actions(
    state: TrafficState,
    drivers: Drivers,
    model: TrafficModel,
    options: AdmissibleConfig,
    replayed: ReplayedVehicles | None = None,
) -> Bool[Array, "actions vehicles scenarios"]:
    """Mask of the actions admissible for each vehicle, in the order of `MetaAction`; none for crashed vehicles.

    FASTER and SLOWER need a next speed level. A lane action needs an adjacent lane, no lane change in progress, and the
    condition of `options.lane`. With `options.longitudinal` the other three actions need a sufficient gap to the
    vehicle ahead. Replayed vehicles count like all others.
    """
    state = sort_if_large(state)
    lane = nearest_lane(state.y, model)
    drives = ~state.crashed & (state.controller != Controller.ABSENT)
    may_turn = drives & (lane == state.target_lane)
    has_left, has_right = may_turn & (lane > 0), may_turn & (lane < model.n_lanes - 1)
    left, right = has_left, has_right
    if options.lane is LaneGate.gap:
        room_left, room_right = if_any(
            may_turn, lambda: has_room_beside(state, lane, drivers, model, options, replayed), (has_left, has_right)
        )
        left, right = left & room_left, right & room_right
    needs_derived = options.lane is LaneGate.mobil_safe or options.longitudinal
    derived = derive_state(state, model, replayed) if needs_derived else None
    if derived is not None and options.lane is LaneGate.mobil_safe:
        left = left & is_safe(state, derived, lane - 1, left, drivers)
        right = right & is_safe(state, derived, lane + 1, right, drivers)
    level = nearest_level(state.speed, model)
    keep = drives
    faster, slower = drives & (level < len(model.speed_levels) - 1), drives & (level > 0)
    if derived is not None and options.longitudinal:
        interaction = leader_interaction(state, derived, lane, drives, drivers)
        keep = keep & (interaction <= options.decel_keep)
        faster, slower = faster & (interaction <= options.decel_faster), slower & (interaction <= options.decel_slower)
    return jnp.stack([left, keep, right, faster, slower])


class _Gaps(eqx.Module):
    """Bumper-to-bumper gaps on one lane [m], inf without a neighbour, and the speed of the vehicle behind [m/s]."""

    ahead: Float[Array, "vehicles scenarios"]
    behind: Float[Array, "vehicles scenarios"]
    rear_speed: Float[Array, "vehicles scenarios"]


def has_room_beside(
    state: TrafficState,
    lane: Int[Array, "vehicles scenarios"],
    drivers: Drivers,
    model: TrafficModel,
    options: AdmissibleConfig,
    replayed: ReplayedVehicles | None = None,
) -> tuple[Bool[Array, "vehicles scenarios"], Bool[Array, "vehicles scenarios"]]:
    """True where the gaps to the nearest vehicles ahead and behind suffice, on the left and on the right lane.

    A gap suffices above max(min_gap, min_time_gap * speed of the rear one of the two vehicles). One pass over the other
    vehicles serves both lanes.
    """
    on_lanes = occupied_lanes(state, model)
    length = jnp.broadcast_to(drivers.body.length, state.x.shape)
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)
    bits = (lane_bit(lane - 1), lane_bit(lane + 1))

    def update(
        side_gaps: tuple[_Gaps, _Gaps],
        distance: Array,
        other_length: Array,
        speed: Array,
        is_on_side: tuple[Array, Array],
    ) -> tuple[_Gaps, _Gaps]:
        gap = jnp.abs(distance) - (length + other_length) / 2
        is_ahead = distance >= 0

        def nearer(gaps: _Gaps, is_on_lane: Bool[Array, "vehicles scenarios"]) -> _Gaps:
            is_next = is_on_lane & ~is_ahead & (gap < gaps.behind)
            return _Gaps(
                ahead=jnp.where(is_on_lane & is_ahead, jnp.minimum(gaps.ahead, gap), gaps.ahead),
                behind=jnp.where(is_next, gap, gaps.behind),
                rear_speed=jnp.where(is_next, speed, gaps.rear_speed),
            )

        return nearer(side_gaps[0], is_on_side[0]), nearer(side_gaps[1], is_on_side[1])

    def keep_nearest(other: Int[Array, ""], side_gaps: tuple[_Gaps, _Gaps]) -> tuple[_Gaps, _Gaps]:
        on_left, on_right = (((row(on_lanes, other) & bit) != 0) & (index != other) for bit in bits)
        distance = row(state.x, other) - state.x
        return update(side_gaps, distance, row(length, other), row(state.speed, other), (on_left, on_right))

    no_vehicle = jnp.full_like(state.x, jnp.inf)
    no_neighbours = _Gaps(no_vehicle, no_vehicle, jnp.zeros_like(state.x))
    left, right = for_each_vehicle(state.x.shape[0], keep_nearest, (no_neighbours, no_neighbours))
    if replayed is not None:

        def keep_nearest_replayed(other: Int[Array, ""], side_gaps: tuple[_Gaps, _Gaps]) -> tuple[_Gaps, _Gaps]:
            on_left, on_right = (row(replayed.lane, other) == lane + side for side in (-1, +1))
            distance = row(replayed.x, other) - state.x
            other_length, speed = row(replayed.length, other), row(replayed.speed, other)
            return update(side_gaps, distance, other_length, speed, (on_left, on_right))

        left, right = for_each_vehicle(replayed.n_slots, keep_nearest_replayed, (left, right))

    def suffice(gaps: _Gaps) -> Bool[Array, "vehicles scenarios"]:
        needed_ahead, needed_behind = (
            jnp.maximum(options.min_time_gap * speed, options.min_gap) for speed in (state.speed, gaps.rear_speed)
        )
        return (gaps.ahead > needed_ahead) & (gaps.behind > needed_behind)

    return suffice(left), suffice(right)


def is_safe(
    state: TrafficState,
    derived: DerivedState,
    lane: Int[Array, "vehicles scenarios"],
    is_needed: Bool[Array, "vehicles scenarios"],
    drivers: Drivers,
) -> Bool[Array, "vehicles scenarios"]:
    """True where neither the new follower nor the vehicle itself would brake harder than MOBIL's safe deceleration.

    Source: Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86, safety criterion (of the new follower). The
    same bound for the vehicle itself is ours, because nothing else keeps the vehicle from cutting in behind a slow one.
    """

    def follower_acceleration() -> Float[Array, "vehicles scenarios"]:
        follower = find_follower(state, derived, lane)
        approach = approach_rate(follower, derived)
        stimulus = SpacingStimulus(
            follower.distance, drivers.body.length, follower.speed, follower.speed_ratio, approach
        )
        return drivers.car_following.spacing_acceleration(stimulus)

    bound = drivers.mobil.safe_decel
    behind_acceleration = if_any(is_needed, follower_acceleration, jnp.zeros_like(state.x))
    return (behind_acceleration >= -bound) & (leader_interaction(state, derived, lane, is_needed, drivers) <= bound)


def leader_interaction(
    state: TrafficState,
    derived: DerivedState,
    lane: Int[Array, "vehicles scenarios"],
    is_needed: Bool[Array, "vehicles scenarios"],
    drivers: Drivers,
) -> Float[Array, "vehicles scenarios"]:
    """Car-following deceleration because of the leader on a lane [m/s^2], positive."""

    def interaction() -> Float[Array, "vehicles scenarios"]:
        leader = find_leader(state, derived, lane)
        approach = approach_rate(derived, leader)
        stimulus = SpacingStimulus(leader.distance, drivers.body.length, state.speed, derived.speed_ratio, approach)
        return drivers.car_following.spacing_interaction(stimulus)

    return if_any(is_needed, interaction, jnp.zeros_like(state.x))
