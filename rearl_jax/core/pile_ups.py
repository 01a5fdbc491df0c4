"""Contacts in large traffic: which vehicles touch among those that are close along the road.

Held against all others, as in small traffic, every wreck costs a pass over all vehicles, and a thousand always have
some. Here the sorted road is walked once: everybody is held against the next vehicle ahead, the one after that and so
on, until nobody is within reach of anybody; pairs that may touch are remembered as bits. Then the pairs are tested in
full, those of a few vehicles of every scenario side by side.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int

from rearl_jax.core.contacts import Extent, Marks, contact, may_touch
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import own_places, pick
from rearl_jax.core.rectangles import Rectangle

AT_A_TIME = 32
"""Vehicles per scenario whose pairs are tested side by side."""

WINDOW = 31
"""Places ahead that are remembered at a time: bits of an integer, without its sign."""


class _Found(NamedTuple):
    """Marks so far, and for each vehicle the highest index that pushes it; -1 for none."""

    marks: Marks
    partner: Int[Array, "vehicles *scenarios"]


def collide_along_road(
    order: Int[Array, "vehicles *scenarios"],
    extent: Extent,
    rectangles: Rectangle,
    marks: Marks,
    model: TrafficModel,
) -> Marks:
    """Crash marks and pushes after all pairs that may touch have been tested.

    Args:
        order: Vehicle indices by rising x.
        extent: Bounding boxes, by vehicle index.
        rectangles: The vehicles, by vehicle index.
        marks: Of the tick so far.
        model: The tick.
    """
    n_vehicles = order.shape[0]
    rear = jax.tree.map(lambda values: pick(values, order), extent)
    # A second copy beyond the end lets every vehicle look any number of places ahead.
    ahead = jax.tree.map(lambda values: jnp.concatenate([values, values]), rear)
    reach = rear.reach_x + jnp.abs(rear.moved_x) + jnp.abs(rear.moved_y)
    farthest = reach + jnp.max(reach, axis=0, keepdims=True)
    place = lax.broadcasted_iota(jnp.int32, order.shape, 0)

    def look_ahead(work: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
        places, bit, _, close = work
        front = jax.tree.map(lambda values: lax.dynamic_slice_in_dim(values, places, n_vehicles), ahead)
        is_near = (place + places < n_vehicles) & (front.x - rear.x <= farthest)
        close = close | jnp.where(is_near & may_touch(rear, front), bit, 0)
        return places + 1, bit << 1, jnp.any(is_near), close

    def goes_on(work: tuple[Array, Array, Array, Array]) -> Array:
        places, bit, any_near, _ = work
        return any_near & (places < n_vehicles) & (bit > 0)

    def one_window(work: tuple[Array, Array, _Found]) -> tuple[Array, Array, _Found]:
        first, _, found = work
        begin = (first, jnp.int32(1), jnp.bool_(True), jnp.zeros(order.shape, jnp.int32))
        places, _, any_near, close = lax.while_loop(goes_on, look_ahead, begin)
        found = lax.cond(
            jnp.any(close != 0), lambda: _test_pairs(close, first, order, rectangles, found, model), lambda: found
        )
        return places, any_near & (places < n_vehicles), found

    start = jnp.int32(1), jnp.bool_(True), _Found(marks, jnp.full(order.shape, -1, jnp.int32))
    return lax.while_loop(lambda work: work[1], one_window, start)[2].marks


def _test_pairs(
    close: Int[Array, "vehicles *scenarios"],
    first: Int[Array, ""],
    order: Int[Array, "vehicles *scenarios"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found once all pairs have been tested.

    Args:
        close: By place, the places ahead whose vehicle may be touched, as bits; the lowest stands for `first`.
        first: Places ahead of the lowest bit.
        order: Vehicle indices by rising x.
        rectangles: The vehicles, by vehicle index.
        found: So far.
        model: The tick.
    """
    n_vehicles, others = order.shape[0], order.shape[1:]
    place = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    rank = jnp.cumsum(close != 0, axis=0, dtype=jnp.int32) - 1

    def test_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        tested, found = work
        slot = jnp.where((close != 0) & (rank >= tested), rank - tested, AT_A_TIME)
        rear = jnp.zeros((AT_A_TIME, *others), jnp.int32).at[own_places(slot)].set(place, mode="drop")
        bits = jnp.zeros((AT_A_TIME, *others), jnp.int32).at[own_places(slot)].set(close, mode="drop")

        def test_next(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
            bits, found = work
            lowest = bits & -bits
            further = first + lax.population_count(jnp.maximum(lowest, 1) - 1)
            pair = pick(order, rear), pick(order, jnp.minimum(rear + further, n_vehicles - 1))
            found = _test(jnp.minimum(*pair), jnp.maximum(*pair), bits != 0, rectangles, found, model)
            return bits & ~lowest, found

        found = lax.while_loop(lambda work: jnp.any(work[0] != 0), test_next, (bits, found))[1]
        return tested + AT_A_TIME, found

    return lax.while_loop(lambda work: jnp.any(rank >= work[0]), test_some, (jnp.int32(0), found))[1]


def _test(
    low: Int[Array, "pairs *scenarios"],
    high: Int[Array, "pairs *scenarios"],
    is_pair: Bool[Array, "pairs *scenarios"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found after one pair of some vehicles; `low` comes before `high` in the list.

    Of all that push a vehicle, the one with the highest index is the last to do so in highway-env, and counts.
    """
    one, other = (jax.tree.map(lambda values, who=who: pick(values, who), rectangles) for who in (low, high))
    touches, will_touch, shift_x, shift_y = contact(one, other, is_pair, model)

    crashed, is_pushed, push_x, push_y = found.marks
    partner = found.partner
    for who, pusher in ((low, high), (high, low)):
        crashed = crashed.at[own_places(who)].max(touches)
        is_pushed = is_pushed.at[own_places(who)].max(will_touch)
        partner = partner.at[own_places(who)].max(jnp.where(will_touch, pusher, -1))
    for who, pusher, sign in ((low, high, 0.5), (high, low, -0.5)):
        counts = will_touch & (pick(partner, who) == pusher)
        written = jnp.where(counts, who, partner.shape[0])
        push_x = push_x.at[own_places(written)].set(sign * shift_x, mode="drop")
        push_y = push_y.at[own_places(written)].set(sign * shift_y, mode="drop")
    return _Found((crashed, is_pushed, push_x, push_y), partner)
