"""Lane-change conflicts: a change is aborted if a vehicle ahead is changing into the same lane.

Source: highway-env 1.12.1, `IDMVehicle.change_lane_policy`.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.compaction import VEHICLES_PER_LANE_CHANGER, Subset, apply_where, compact
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.gap_driving import present_car_following
from rearl_jax.core.mobil import approach_rate, uses_mobil
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.nearest import lane_bit
from rearl_jax.core.neighbours import DerivedState, Leader, for_each_vehicle, is_large, row
from rearl_jax.core.state import TrafficState

NO_LANE = -1_000
"""Target lane in empty places of a subset: a lane that does not exist."""

_Conflict = tuple[
    Int[Array, "n *s"], Bool[Array, "n *s"], TrafficState, DerivedState, CarFollowing, Float[Array, "#n *#s"]
]
"""Decided lanes, whether a change is in progress, state, derived quantities, car following and lengths [m]."""


def abort_conflicts(
    decided_lane: Int[Array, "vehicles *scenarios"],
    state: TrafficState,
    derived: DerivedState,
    drivers: Drivers,
    model: TrafficModel,
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes after conflicting lane changes have been aborted.

    A vehicle aborts its lane change if another vehicle, ahead of it by less than its desired spacing, is changing into
    the same lane. highway-env updates the vehicles one after another, so each vehicle uses the new target lanes of
    vehicles before it in the list and the old ones of vehicles after it. In parallel, this is a triangular system of
    booleans. Fixed-point iteration solves it exactly, in as many iterations as the longest chain of vehicles that give
    way to each other.

    Args:
        decided_lane: Target lanes after the lane-change decision.
        state: The traffic; its target lanes are those before that decision.
        derived: Derived quantities of the traffic.
        drivers: Parameters of all vehicles.
        model: Traffic model; only its speed limit is used.
    """
    # highway-env's desired spacing does not depend on the desired speed.
    car_following = present_car_following(state, drivers, model) if drivers.see_gaps else drivers.car_following
    # A decision has no derivative. Memory and tables of neighbours have other axes than the gathered arrays, and the
    # target lane of a replayed vehicle is unknown.
    own_derived = replace(derived, nearest=None, replayed=None)
    inputs = replace(state, memory=None), own_derived, car_following, drivers.body.length
    state, derived, car_following, length = lax.stop_gradient(inputs)
    changing = uses_mobil(state, drivers) & (derived.lane != state.target_lane)

    def solve_for_all() -> Int[Array, "vehicles *scenarios"]:
        return _solve_where_needed((decided_lane, changing, state, derived, car_following, length))

    def solve_for(subset: Subset) -> Int[Array, "vehicles *scenarios"]:
        own_state, *others = jax.tree.map(subset.gather, (state, derived, car_following, length))

        def or_no_lane(lane: Array) -> Array:
            return jnp.where(subset.is_filled, lane, NO_LANE)

        own_state = replace(own_state, target_lane=or_no_lane(own_state.target_lane))
        decided, changes = or_no_lane(subset.gather(decided_lane)), subset.gather(changing) & subset.is_filled
        return subset.scatter(_solve_where_needed((decided, changes, own_state, *others)), decided_lane)

    if not is_large(state.x.shape[0]):
        return solve_for_all()
    subset = compact((state.target_lane != derived.lane) | (decided_lane != derived.lane), VEHICLES_PER_LANE_CHANGER)
    return lax.cond(subset.suffices, lambda: solve_for(subset), solve_for_all)


def _solve_where_needed(conflict: _Conflict) -> Int[Array, "n *s"]:
    """Target lanes, solved only in scenarios in which a vehicle may have to give way: at least two vehicles enter one
    lane, and at least one of them has a change in progress.
    """
    decided_lane, changing, state, derived, *_ = conflict

    def bit_where(is_counted: Array, lane: Array) -> Array:
        return jnp.where(is_counted, lane_bit(jnp.maximum(lane, -1)), 0)

    enters = bit_where(state.target_lane != derived.lane, state.target_lane) | bit_where(
        decided_lane != derived.lane, decided_lane
    )
    gives_way = bit_where(changing, state.target_lane)

    def count_entries(other: Int[Array, ""], lanes: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        """Lanes, as bits, that at least one vehicle enters, that two or more enter, and on which a vehicle may give
        way.
        """
        once, twice, contested = lanes
        entered = row(enters, other)
        return once | entered, twice | (once & entered), contested | row(gives_way, other)

    no_vehicle = jnp.zeros((1, *changing.shape[1:]), jnp.int32)
    _, twice, contested = for_each_vehicle(changing.shape[0], count_entries, (no_vehicle, no_vehicle, no_vehicle))
    return apply_where(((twice & contested) != 0)[0], _solve, conflict, decided_lane)


def _solve(conflict: _Conflict) -> Int[Array, "n *s"]:
    """Target lanes, the fixed point of `_is_blocked`."""
    decided_lane, changing, state, derived, car_following, length = conflict
    n_filled = state.x.shape[0]
    if is_large(n_filled):
        n_filled = jnp.max(jnp.sum(state.target_lane != NO_LANE, axis=0))  # the first places of a subset are filled

    def iterate(lanes: Int[Array, "n *s"]) -> Int[Array, "n *s"]:
        is_blocked = _is_blocked(lanes, state, derived, car_following, length, n_filled)
        return jnp.where(changing & is_blocked, derived.lane, decided_lane)

    def has_changed(last_two: tuple[Array, Array]) -> Array:
        return jnp.any(last_two[0] != last_two[1])

    first_two = decided_lane, iterate(decided_lane)
    return lax.while_loop(has_changed, lambda last_two: (last_two[1], iterate(last_two[1])), first_two)[1]


def _is_blocked(
    lanes: Int[Array, "vehicles *scenarios"],
    state: TrafficState,
    derived: DerivedState,
    car_following: CarFollowing,
    length: Float[Array, "#vehicles *#scenarios"],
    n_filled: int | Array,
) -> Bool[Array, "vehicles *scenarios"]:
    """True where another vehicle, ahead within the desired spacing, is changing into a vehicle's target lane.

    Compared are the first `n_filled` vehicles; `lanes` are the new target lanes of vehicles earlier in the list.
    """
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)

    def compare(other: Int[Array, ""], blocked: Array) -> Array:
        ahead_by = row(state.x, other) - state.x
        dv = approach_rate(derived, Leader(ahead_by, row(derived.speed_x, other), row(derived.speed_y, other)))
        desired_spacing = car_following.desired_spacing(length, state.speed, dv)
        other_target = jnp.where(other < index, row(lanes, other), row(state.target_lane, other))
        same_target = (other_target == state.target_lane) & (row(derived.lane, other) != state.target_lane)
        return blocked | (same_target & (ahead_by > 0) & (ahead_by < desired_spacing))

    return for_each_vehicle(n_filled, compare, jnp.zeros(state.x.shape, bool))
