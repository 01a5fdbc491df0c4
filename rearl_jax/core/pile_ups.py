"""Contacts in large traffic: who may touch whom among those that are close along the road.

Held against all others, as in small traffic, every wreck costs a pass over all vehicles, and among a thousand there are
always some. Here the order along the road says who may touch whom, one window after the other: everybody is held
against the next WINDOW vehicles ahead. Where traffic is piled up, somebody further ahead may still be within reach.
The few vehicles of which that is true are followed, some at a time, from window to window until it is true of none.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, UInt32

from rearl_jax.core.affected import if_any
from rearl_jax.core.contacts import Extent, close_to_next, may_touch
from rearl_jax.core.drivers import Body
from rearl_jax.core.lots import Lot, in_lots, list_vehicles
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import in_a_row, pick
from rearl_jax.core.pairs import Found, Road, settle_ahead, settle_close
from rearl_jax.core.state import TrafficState

WINDOW = 8
"""Places ahead that are looked at in one pass; as many bits are remembered of each vehicle."""

FOLLOWED = 64
"""Vehicles of all scenarios for each that is followed further ahead at a time; own choice."""


def settle_along_road(extent: Extent, state: TrafficState, body: Body, found: Found, model: TrafficModel) -> Found:
    """What is found once all pairs that may touch have been tested.

    Args:
        extent: Boxes of all vehicles, by vehicle.
        state: The traffic; its order along the road is up to date.
        body: Sizes of the vehicles.
        found: So far.
        model: The tick.
    """
    order = state.order
    by_place = jax.tree.map(lambda values: pick(values, order), extent)
    reach = by_place.reach_x + jnp.abs(by_place.moved)
    farthest = by_place.x + reach + _largest(reach)
    nobody = jnp.zeros(order.shape, jnp.uint32), jnp.zeros(order.shape, bool)
    close, goes_on = if_any(body.collides, lambda: _look_ahead(by_place, farthest), nobody)
    road = Road(state, body, in_a_row(order).ravel())
    found = settle_close(close, road, found, model)
    return lax.cond(
        jnp.any(goes_on),
        lambda found: _look_further(goes_on, by_place, farthest, road, found, model),
        lambda found: found,
        found,
    )


def _largest(values: Float[Array, "vehicles *scenarios"]) -> Float[Array, "1 *scenarios"]:
    """The largest of each scenario, by halves: XLA's own reduction along this axis is ten times as slow on a CPU."""
    while (n := values.shape[0]) > 1:
        values = jnp.maximum(values[: (n + 1) // 2], values[n // 2 :])
    return values


def _look_ahead(
    by_place: Extent, farthest: Float[Array, "vehicles *scenarios"]
) -> tuple[UInt32[Array, "vehicles *scenarios"], Bool[Array, "vehicles *scenarios"]]:
    """By place, which of the next WINDOW vehicles may be touched, as bits, and whether there may be more beyond.

    Args:
        by_place: Everybody.
        farthest: Position beyond which nobody can be touched [m].
    """
    others = by_place.x.shape[1:]

    def from_next(values: Array, beyond: float = 0) -> Array:
        return jnp.pad(values[1:], [(0, WINDOW)] + [(0, 0)] * len(others), constant_values=beyond)

    # Beyond the last vehicle somebody is infinitely far away.
    ahead = replace(jax.tree.map(from_next, by_place), x=from_next(by_place.x, jnp.inf))
    # Positions rise: where the last of a window is out of reach, so are all beyond it.
    return close_to_next(by_place, ahead, WINDOW), ahead.x[WINDOW - 1 :] <= farthest


def _look_further(
    goes_on: Bool[Array, "vehicles *scenarios"],
    by_place: Extent,
    farthest: Float[Array, "vehicles *scenarios"],
    road: Road,
    found: Found,
    model: TrafficModel,
) -> Found:
    """What is found once the pairs beyond the first window have been tested as well.

    Args:
        goes_on: By place, whether somebody beyond the first window may be touched.
        by_place: Everybody.
        farthest: Position beyond which nobody can be touched [m].
        road: The traffic.
        found: So far.
        model: The tick.
    """
    n_places = goes_on.size
    in_a_row, farthest_in_a_row = jax.tree.map(jnp.ravel, (by_place, farthest))
    window = lax.iota(jnp.int32, WINDOW)
    bit = (jnp.uint32(1) << window.astype(jnp.uint32))[None]

    def follow(lot: Lot, found: Found) -> Found:
        place = lot.place[:, None]
        rear, farthest = jax.tree.map(lambda values: values[place], (in_a_row, farthest_in_a_row))

        def look_on(work: tuple[Array, Array, Found]) -> tuple[Array, Array, Found]:
            first, goes_on, found = work
            ahead = place + (first + window)[None] * road.n_scenarios
            is_there = (ahead < n_places) & goes_on[:, None]
            other = jax.tree.map(lambda values: values[jnp.minimum(ahead, n_places - 1)], in_a_row)
            bits = jnp.where(may_touch(rear, other) & is_there, bit, jnp.uint32(0))
            found = settle_ahead(lot.place, jnp.sum(bits, axis=1, dtype=jnp.uint32), first, road, found, model)
            return first + WINDOW, (is_there & (other.x <= farthest))[:, -1], found

        start = jnp.int32(1 + WINDOW), lot.is_there, found
        return lax.while_loop(lambda work: jnp.any(work[1]), look_on, start)[2]

    return in_lots(list_vehicles(goes_on), n_places // FOLLOWED + 1, follow, found)
