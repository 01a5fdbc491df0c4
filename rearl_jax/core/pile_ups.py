"""Contacts in large traffic: which vehicles touch among those that are close along the road.

Held against all others, as in small traffic, every wreck costs a pass over all vehicles, and among a thousand there are
always some. Here the order along the road says who may touch whom, one window after the other:

1. `_look_ahead` holds everybody against the next WINDOW vehicles ahead by the cheap test of bounding boxes, and
   remembers as bits which of them may be touched.
2. `_test_pairs` takes up the scenarios that have such pairs, some at a time, numbers the pairs of these in one sequence
   and tests them in full, a lot at a time. The work grows with the number of pairs and does not wait for the scenario
   that has most of them.

It ends with the window beyond which nobody is within reach of anybody, which is the first one unless traffic is piled
up.
"""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int, UInt32

from rearl_jax.core.contacts import Extent, Marks, contact, may_touch
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import NOBODY, pick
from rearl_jax.core.rectangles import Rectangle

WINDOW = 8
"""Places ahead that are looked at in one pass and remembered as bits of a number; a power of two, at most 32."""

TREATED = 16
"""Scenarios whose pairs are numbered together: as many numbers as a cache line holds."""

TESTED = 32
"""Vehicles of these scenarios for each pair of a lot that is tested at a time."""


class _Found(NamedTuple):
    """Crash marks and pushes so far, and of all that push a vehicle the one with the highest index, NOBODY for none.

    All scenarios are in a row.
    """

    crashed: Bool[Array, " all"]
    partner: Int[Array, " all"]
    push_x: Float[Array, " all"]
    push_y: Float[Array, " all"]


def collide_along_road(
    order: Int[Array, "vehicles *scenarios"],
    extent: Extent,
    rectangles: Rectangle,
    marks: Marks,
    model: TrafficModel,
) -> Marks:
    """Crash marks and pushes after all pairs that may touch have been tested.

    Args:
        order: Vehicle indices by rising x, as of the beginning of the tick: who has come past others since then stands
            far less than a WINDOW of places off.
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
        found = _test_pairs(close, first, order, flat, found, model)
        front = jax.tree.map(lambda values: jnp.concatenate([values[WINDOW:], values[-WINDOW:]]), front)
        return first + WINDOW, front, goes_on, found

    crashed, is_pushed, push_x, push_y = marks
    found = _Found(crashed.ravel(), jnp.full(order.size, NOBODY, jnp.int32), push_x.ravel(), push_y.ravel())
    start = jnp.int32(1), front, jnp.bool_(True), found
    found = lax.while_loop(lambda work: work[2], one_window, start)[3]
    found = jax.tree.map(lambda values: values.reshape(order.shape), found)
    return found.crashed, is_pushed | (found.partner != NOBODY), found.push_x, found.push_y


def _look_ahead(rear: Extent, front: Extent) -> tuple[UInt32[Array, "vehicles *scenarios"], Bool[Array, ""]]:
    """By place, which of the next vehicles may be touched, as bits, and whether there may be more beyond.

    Args:
        rear: Everybody, by place.
        front: Whoever is ahead of the rearmost by as many places as the window begins at, and all after that one, so
            that entry p + k is the k-th of the window of place p. There are n_vehicles + WINDOW - 1 entries.
    """
    n_vehicles = rear.x.shape[0]
    close = jnp.zeros(rear.x.shape, jnp.uint32)
    for places in range(WINDOW):
        other = jax.tree.map(lambda values, k=places: values[k : k + n_vehicles], front)
        close = close | jnp.where(may_touch(rear, other), jnp.uint32(1 << places), jnp.uint32(0))
    reach = rear.reach_x + jnp.abs(rear.moved_x) + jnp.abs(rear.moved_y)
    farthest = reach + jnp.max(reach, axis=0, keepdims=True)
    # Positions rise: where the last of a window is out of reach, so are all beyond it.
    return close, jnp.any(front.x[WINDOW - 1 :] - rear.x <= farthest)


def _test_pairs(
    close: UInt32[Array, "vehicles *scenarios"],
    first: Int[Array, ""],
    order: Int[Array, "vehicles *scenarios"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found once all pairs have been tested, some scenarios at a time: in ordinary traffic few have any.

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

    def treat_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        left, found = work
        (columns,) = jnp.nonzero(left, size=min(TREATED, n_scenarios), fill_value=n_scenarios)
        columns = columns.astype(jnp.int32)
        some = jnp.minimum(columns, n_scenarios - 1)
        close_here = jnp.where(columns[None] < n_scenarios, close[:, some], jnp.uint32(0))
        # Where each vehicle of these scenarios stands among all.
        vehicles = order[:, some] * n_scenarios + some[None]
        found = _test_numbered(close_here.T, first, vehicles.T, rectangles, found, model)
        return left.at[columns].set(False, mode="drop"), found

    has_pairs = jnp.any(close != 0, axis=0)
    return lax.while_loop(lambda work: jnp.any(work[0]), treat_some, (has_pairs, found))[1]


def _test_numbered(
    close: UInt32[Array, "some vehicles"],
    first: Int[Array, ""],
    vehicles: Int[Array, "some vehicles"],
    rectangles: Rectangle,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found once the pairs of some scenarios, numbered scenario by scenario and by rising place, are tested.

    Args:
        close: By place, the places ahead whose vehicle may be touched, as bits; the lowest stands for `first`.
        first: Places ahead of the lowest bit.
        vehicles: By place, where the vehicle stands among those of all scenarios.
        rectangles: The vehicles by index, all scenarios in a row.
        found: So far.
        model: The tick.
    """
    close, vehicles = close.ravel(), vehicles.ravel()
    count = lax.population_count(close).astype(jnp.int32)
    end = jnp.cumsum(count, dtype=jnp.int32)
    n_tested = close.size // TESTED + 1

    def test_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        tested, found = work
        pair = tested + lax.iota(jnp.int32, n_tested)
        rear = jnp.minimum(jnp.searchsorted(end, pair, side="right", method="scan_unrolled"), close.size - 1)
        further = first + _set_bit(close[rear], pair - end[rear] + count[rear])
        one, other = vehicles[rear], vehicles[jnp.minimum(rear + further, close.size - 1)]
        found = _test(jnp.minimum(one, other), jnp.maximum(one, other), pair < end[-1], rectangles, found, model)
        return tested + n_tested, found

    return lax.while_loop(lambda work: work[0] < end[-1], test_some, (jnp.int32(0), found))[1]


def _set_bit(bits: UInt32[Array, " pairs"], number: Int[Array, " pairs"]) -> Int[Array, " pairs"]:
    """Position of the set bit that has this number of set bits below it, by halving the range it may be in."""
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
    """What is found after some pairs; `low` comes before `high` in the list of vehicles.

    Of all that push a vehicle, the one with the highest index is the last to do so in highway-env, and counts: pairs
    may come in any sequence here, so each push is written only where nobody with a higher index has pushed so far.
    """
    one, other = (jax.tree.map(lambda values, who=who: values[who], rectangles) for who in (low, high))
    touches, will_touch, shift_x, shift_y = contact(one, other, is_pair, model)

    who, pusher = jnp.concatenate([low, high]), jnp.concatenate([high, low])
    touches, will_touch = jnp.tile(touches, 2), jnp.tile(will_touch, 2)
    crashed = found.crashed.at[who].max(touches)
    partner = found.partner.at[who].max(jnp.where(will_touch, pusher, NOBODY))
    written = jnp.where(will_touch & (partner[who] == pusher), who, partner.shape[0])
    push_x, push_y = (
        push.at[written].set(jnp.concatenate([shift / 2, -shift / 2]), mode="drop")
        for push, shift in ((found.push_x, shift_x), (found.push_y, shift_y))
    )
    return _Found(crashed, partner, push_x, push_y)
