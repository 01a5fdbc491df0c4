"""Contacts in large traffic: which vehicles touch among those that are close along the road.

Held against all others, as in small traffic, every wreck costs a pass over all vehicles, and a thousand always have
some. Here the sorted road is walked once: everybody is held against the next few vehicles ahead, then against those
after them and so on, until nobody is within reach of anybody; pairs that may touch are remembered as bits. Then the
pairs of all scenarios are listed and tested in full.
"""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int, UInt32

from rearl_jax.core.contacts import Extent, Marks, contact, may_touch
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import pick
from rearl_jax.core.rectangles import Rectangle

WINDOW = 16
"""Places ahead that are looked at in one pass and remembered as bits; a power of two."""

TESTED = 32
"""So many times fewer pairs than vehicles in all scenarios are tested at a time."""

LISTED = 8
"""So many times more pairs are listed at a time."""


class _Found(NamedTuple):
    """Marks so far, and for each vehicle the highest index that pushes it; -1 for none. All scenarios in a row."""

    marks: Marks
    partner: Int[Array, " all"]


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
    rear = jax.tree.map(lambda values: pick(values, order), extent)
    flat = jax.tree.map(jnp.ravel, rectangles)

    def next_and_beyond(values: Array, beyond: float = 0) -> Array:
        return jnp.pad(values[1:], [(0, WINDOW)] + [(0, 0)] * (order.ndim - 1), constant_values=beyond)

    # Beyond the last vehicle somebody is infinitely far away.
    front = replace(jax.tree.map(next_and_beyond, rear), x=next_and_beyond(rear.x, jnp.inf))

    def one_window(work: tuple[Array, Extent, Array, _Found]) -> tuple[Array, Extent, Array, _Found]:
        first, front, _, found = work
        close, goes_on = _look_ahead(rear, front)
        found = lax.cond(
            jnp.any(close != 0), lambda: _test_pairs(close, first, order, flat, found, model), lambda: found
        )
        front = jax.tree.map(lambda values: jnp.concatenate([values[WINDOW:], values[-WINDOW:]]), front)
        return first + WINDOW, front, goes_on, found

    found = _Found(jax.tree.map(jnp.ravel, marks), jnp.full(order.size, -1, jnp.int32))
    start = jnp.int32(1), front, jnp.bool_(True), found
    found = lax.while_loop(lambda work: work[2], one_window, start)[3]
    return jax.tree.map(lambda values: values.reshape(order.shape), found.marks)


def _look_ahead(rear: Extent, front: Extent) -> tuple[UInt32[Array, "vehicles *scenarios"], Bool[Array, ""]]:
    """By place, which of the next vehicles may be touched, as bits, and whether there may be more beyond.

    Args:
        rear: Everybody, by place.
        front: Those ahead of the first one, by place; a WINDOW more than there are vehicles but one.
    """
    n_vehicles = rear.x.shape[0]
    close = jnp.zeros(rear.x.shape, jnp.uint32)
    for places in range(WINDOW):
        other = jax.tree.map(lambda values, k=places: values[k : k + n_vehicles], front)
        close = close | jnp.where(may_touch(rear, other), jnp.uint32(1 << places), jnp.uint32(0))
    reach = rear.reach_x + jnp.abs(rear.moved_x) + jnp.abs(rear.moved_y)
    farthest = reach + jnp.max(reach, axis=0, keepdims=True)
    return close, jnp.any(front.x[WINDOW - 1 :] - rear.x <= farthest)


def _test_pairs(
    close: UInt32[Array, "vehicles *scenarios"],
    first: Int[Array, ""],
    order: Int[Array, "vehicles *scenarios"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found once all pairs have been tested.

    The pairs are numbered scenario by scenario, in each by rising place.

    Args:
        close: By place, the places ahead whose vehicle may be touched, as bits; the lowest stands for `first`.
        first: Places ahead of the lowest bit.
        order: Vehicle indices by rising x.
        rectangles: The vehicles by index, all scenarios in a row.
        found: So far.
        model: The tick.
    """
    n_vehicles = order.shape[0]
    close, order = close.reshape(n_vehicles, -1), order.reshape(n_vehicles, -1)
    n_scenarios = order.shape[1]
    n_tested = order.size // TESTED + 1
    n_listed = LISTED * n_tested
    count = lax.population_count(close).astype(jnp.int32)
    total, number = lax.scan(lambda sum_, n: (sum_ + n, sum_), jnp.zeros(n_scenarios, jnp.int32), count)
    number = number + (jnp.cumsum(total, dtype=jnp.int32) - total)[None]
    n_pairs = jnp.sum(total, dtype=jnp.int32)
    # Rises with the numbers of the pairs.
    place, scenario = (lax.broadcasted_iota(jnp.int32, order.shape, axis) for axis in (0, 1))
    cell = scenario * n_vehicles + place

    def test_some(tested: Array, cells: Array, found: _Found) -> _Found:
        scenario, place = jnp.divmod(cells, n_vehicles)
        pair = tested + lax.iota(jnp.int32, n_tested)
        further = first + _set_bit(close[place, scenario], pair - number[place, scenario])
        one, other = (
            order[at, scenario] * n_scenarios + scenario for at in (place, jnp.minimum(place + further, n_vehicles - 1))
        )
        return _test(jnp.minimum(one, other), jnp.maximum(one, other), pair < n_pairs, rectangles, found, model)

    def list_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        listed, found = work
        is_here = (count > 0) & (number < listed + n_listed) & (number + count > listed)
        slot = jnp.where(is_here, jnp.maximum(number - listed, 0), n_listed)
        cells = lax.cummax(jnp.zeros(n_listed, jnp.int32).at[slot].max(cell, mode="drop"))

        def test_next(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
            tested, found = work
            some = lax.dynamic_slice_in_dim(cells, tested - listed, n_tested)
            return tested + n_tested, test_some(tested, some, found)

        end = jnp.minimum(n_pairs, listed + n_listed)
        found = lax.while_loop(lambda work: work[0] < end, test_next, (listed, found))[1]
        return listed + n_listed, found

    return lax.while_loop(lambda work: work[0] < n_pairs, list_some, (jnp.int32(0), found))[1]


def _set_bit(bits: UInt32[Array, " pairs"], number: Int[Array, " pairs"]) -> Int[Array, " pairs"]:
    """Position of a set bit that so many lower ones come before."""
    position = jnp.zeros_like(number)
    width = WINDOW // 2
    while width:
        low = (bits >> position.astype(jnp.uint32)) & jnp.uint32((1 << width) - 1)
        n_low = lax.population_count(low).astype(jnp.int32)
        is_above = number >= n_low
        number = number - jnp.where(is_above, n_low, 0)
        position = position + jnp.where(is_above, width, 0)
        width //= 2
    return position


def _test(
    low: Int[Array, " pairs"],
    high: Int[Array, " pairs"],
    is_pair: Bool[Array, " pairs"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found after some pairs; `low` comes before `high` in the list.

    Of all that push a vehicle, the one with the highest index is the last to do so in highway-env, and counts.
    """
    one, other = (jax.tree.map(lambda values, who=who: values[who], rectangles) for who in (low, high))
    touches, will_touch, shift_x, shift_y = contact(one, other, is_pair, model)

    crashed, is_pushed, push_x, push_y = found.marks
    partner = found.partner
    for who, pusher in ((low, high), (high, low)):
        crashed = crashed.at[who].max(touches)
        is_pushed = is_pushed.at[who].max(will_touch)
        partner = partner.at[who].max(jnp.where(will_touch, pusher, -1))
    for who, pusher, sign in ((low, high, 0.5), (high, low, -0.5)):
        counts = will_touch & (partner[who] == pusher)
        written = jnp.where(counts, who, partner.shape[0])
        push_x = push_x.at[written].set(sign * shift_x, mode="drop")
        push_y = push_y.at[written].set(sign * shift_y, mode="drop")
    return _Found((crashed, is_pushed, push_x, push_y), partner)
