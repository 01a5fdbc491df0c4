"""Giving way: a change of lanes is broken off where somebody ahead is changing into the same lane.

Source: highway-env 1.12.1, `IDMVehicle.change_lane_policy`.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.compaction import ONE_IN_CHANGES_LANES, Subset, apply_where, compact
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.mobil import closing_in, decides
from rearl_jax.core.nearest import lane_bit
from rearl_jax.core.neighbours import Leader, View, for_each_vehicle, is_large, row
from rearl_jax.core.state import TrafficState

NOWHERE = -1_000
"""A lane that does not exist; nobody is on the way there but who fills an empty place."""

_Question = tuple[Int[Array, "n *s"], Bool[Array, "n *s"], TrafficState, View, CarFollowing, Float[Array, "#n *#s"]]
"""Lanes as decided, who is changing lanes, and all that is known of them; their car following and lengths [m]."""


def abort_conflicts(
    decided_lane: Int[Array, "vehicles *scenarios"],
    state: TrafficState,
    view: View,
    drivers: Drivers,
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes after changes in progress have been broken off for the sake of others.

    A vehicle that is changing gives up where another vehicle, ahead within its desired spacing, is on its way into the
    same lane. highway-env asks the vehicles one after another, so each sees the new target lanes of those before it in
    the list and the old ones of those behind. All at once, that is a triangular system of booleans: repeating the
    question with the answers of the round before settles it, in as many rounds as the longest chain of
    vehicles that give way to each other.
    """
    # What is decided has no slope; and what drivers remember has other axes than those a subset is gathered from.
    known = replace(state, memory=None), replace(view, nearest=None), drivers.car_following, drivers.body.length
    state, view, own, length = lax.stop_gradient(known)
    changing = decides(state, drivers) & (view.lane != state.target_lane)

    def among_everybody() -> Int[Array, "vehicles *scenarios"]:
        return _where_concerned((decided_lane, changing, state, view, own, length))

    def among(subset: Subset) -> Int[Array, "vehicles *scenarios"]:
        own_state, *others = jax.tree.map(subset.gather, (state, view, own, length))

        def if_there(lane: Array) -> Array:
            return jnp.where(subset.is_filled, lane, NOWHERE)

        own_state = replace(own_state, target_lane=if_there(own_state.target_lane))
        decided, changes = if_there(subset.gather(decided_lane)), subset.gather(changing) & subset.is_filled
        return subset.scatter(_where_concerned((decided, changes, own_state, *others)), decided_lane)

    if not is_large(state.x.shape[0]):
        return among_everybody()
    subset = compact((state.target_lane != view.lane) | (decided_lane != view.lane), ONE_IN_CHANGES_LANES)
    return lax.cond(subset.suffices, lambda: among(subset), among_everybody)


def _where_concerned(question: _Question) -> Int[Array, "n *s"]:
    """Target lanes, asked for in those scenarios alone where somebody may have to give way: two are on the way into a
    lane, and one of them would break it off.
    """
    decided_lane, changing, state, view, *_ = question

    def bit_of(lane: Array, is_meant: Array) -> Array:
        return jnp.where(is_meant, lane_bit(jnp.maximum(lane, -1)), 0)

    enters = bit_of(state.target_lane, state.target_lane != view.lane) | bit_of(decided_lane, decided_lane != view.lane)
    gives_way = bit_of(state.target_lane, changing)

    def look_at(other: Int[Array, ""], found: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        once, twice, given = found
        entered = row(enters, other)
        return once | entered, twice | (once & entered), given | row(gives_way, other)

    nobody = jnp.zeros((1, *changing.shape[1:]), jnp.int32)
    _, twice, given = for_each_vehicle(changing.shape[0], look_at, (nobody, nobody, nobody))
    return apply_where(((twice & given) != 0)[0], _settle, question, decided_lane)


def _settle(question: _Question) -> Int[Array, "n *s"]:
    """Target lanes once every answer follows from the others."""
    decided_lane, changing, state, view, own, length = question
    n_there = state.x.shape[0]
    if is_large(n_there):
        n_there = jnp.max(jnp.sum(state.target_lane != NOWHERE, axis=0))  # they are in the first places

    def ask_everybody(answer: Int[Array, "n *s"]) -> Int[Array, "n *s"]:
        return jnp.where(changing & _is_blocked(answer, state, view, own, length, n_there), view.lane, decided_lane)

    def is_unsettled(rounds: tuple[Array, Array]) -> Array:
        return jnp.any(rounds[0] != rounds[1])

    rounds = decided_lane, ask_everybody(decided_lane)
    return lax.while_loop(is_unsettled, lambda rounds: (rounds[1], ask_everybody(rounds[1])), rounds)[1]


def _is_blocked(
    answer: Int[Array, "vehicles *scenarios"],
    state: TrafficState,
    view: View,
    own: CarFollowing,
    length: Float[Array, "#vehicles *#scenarios"],
    n_there: int | Array,
) -> Bool[Array, "vehicles *scenarios"]:
    """Whether somebody ahead, of the first `n_there` vehicles, is changing into a vehicle's target lane, if `answer`
    holds for those before it in the list.
    """
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)

    def look_at(other: Int[Array, ""], blocked: Array) -> Array:
        ahead_by = row(state.x, other) - state.x
        dv = closing_in(view, Leader(ahead_by, row(view.speed_x, other), row(view.speed_y, other)))
        wanted = own.desired_spacing(length, state.speed, dv)
        its_target = jnp.where(other < index, row(answer, other), row(state.target_lane, other))
        same_goal = (its_target == state.target_lane) & (row(view.lane, other) != state.target_lane)
        return blocked | (same_goal & (ahead_by > 0) & (ahead_by < wanted))

    return for_each_vehicle(n_there, look_at, jnp.zeros(state.x.shape, bool))
