"""Contacts in large traffic: which vehicles touch among those that are close along the road.

Held against all others, as in small traffic, every wreck costs a pass over all vehicles, and among a thousand there are
always some. Here the order along the road says who may touch whom, one window after the other:

1. `_look_ahead` holds everybody against the next WINDOW vehicles ahead by the cheap test of bounding boxes, and
   remembers as bits which of them may be touched.
2. `_test_pairs` numbers these pairs in one sequence through all scenarios and tests them in full, a lot at a time. The
   work grows with the number of pairs and does not wait for the scenario that has most of them.
3. Where traffic is piled up, somebody further ahead may still be within reach. `_look_further` takes up the few
   vehicles of which that is true, some at a time, and goes on from window to window until it is true of none of them.
"""

import functools
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int, UInt32

from rearl_jax.core.affected import if_any
from rearl_jax.core.contacts import Extent, Marks, contact, may_touch
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import NOBODY, pick
from rearl_jax.core.rectangles import Rectangle

WINDOW = 8
"""Places ahead that are looked at in one pass; as many bits are remembered of each vehicle."""

TOGETHER = 32 // WINDOW
"""Vehicles whose bits make one number."""

TESTED = 64
"""Vehicles of all scenarios for each pair of a lot that is tested at a time."""

FOLLOWED = 64
"""Vehicles of all scenarios for each that is followed further ahead at a time."""


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
        order: Vehicle indices by rising x.
        extent: Bounding boxes, by vehicle index.
        rectangles: The vehicles, by vehicle index.
        marks: Of the tick so far.
        model: The tick.
    """
    by_place = jax.tree.map(lambda values: pick(values, order), extent)
    reach = by_place.reach_x + jnp.abs(by_place.moved_x) + jnp.abs(by_place.moved_y)
    farthest = by_place.x + reach + jnp.max(reach, axis=0, keepdims=True)
    nobody = jnp.zeros(order.shape, jnp.uint32), jnp.zeros(order.shape, bool)
    is_near = by_place.x[1:] <= farthest[:-1]
    close, goes_on = if_any(is_near, lambda: _look_ahead(by_place, farthest), nobody)

    n_scenarios = order.size // order.shape[0]
    scenario = lax.broadcasted_iota(jnp.int32, (1, n_scenarios), 1)
    road = _Road(order.reshape(-1, n_scenarios) * n_scenarios + scenario, jax.tree.map(jnp.ravel, rectangles))
    crashed, is_pushed, push_x, push_y = marks
    found = _Found(crashed.ravel(), jnp.full(order.size, NOBODY, jnp.int32), push_x.ravel(), push_y.ravel())
    numbers = _together(close.reshape(-1, n_scenarios))
    places = TOGETHER * n_scenarios * lax.broadcasted_iota(jnp.int32, numbers.shape, 0) + scenario
    pairs = _Pairs(numbers.ravel(), places.ravel(), jnp.int32(1))
    found = _test_pairs(pairs, order.size // TESTED + 1, road, found, model)
    found = _look_further(goes_on, by_place, farthest, road, found, model)
    found = jax.tree.map(lambda values: values.reshape(order.shape), found)
    return found.crashed, is_pushed | (found.partner != NOBODY), found.push_x, found.push_y


def _look_ahead(
    by_place: Extent, farthest: Float[Array, "vehicles *scenarios"]
) -> tuple[UInt32[Array, "vehicles *scenarios"], Bool[Array, "vehicles *scenarios"]]:
    """By place, which of the next WINDOW vehicles may be touched, as bits, and whether there may be more beyond.

    Args:
        by_place: Everybody.
        farthest: Position beyond which nobody can be touched [m].
    """
    n_vehicles, *others = by_place.x.shape

    def from_next(values: Array, beyond: float = 0) -> Array:
        return jnp.pad(values[1:], [(0, WINDOW)] + [(0, 0)] * len(others), constant_values=beyond)

    # Beyond the last vehicle somebody is infinitely far away.
    ahead = replace(jax.tree.map(from_next, by_place), x=from_next(by_place.x, jnp.inf))
    close = jnp.zeros(by_place.x.shape, jnp.uint32)
    for places in range(WINDOW):
        other = jax.tree.map(lambda values, k=places: values[k : k + n_vehicles], ahead)
        close = close | jnp.where(may_touch(by_place, other), jnp.uint32(1 << places), jnp.uint32(0))
    # Positions rise: where the last of a window is out of reach, so are all beyond it.
    return close, ahead.x[WINDOW - 1 :] <= farthest


def _together(close: UInt32[Array, "vehicles scenarios"]) -> UInt32[Array, "numbers scenarios"]:
    """The bits of TOGETHER places in one number, those of the rearmost lowest."""
    n_vehicles, n_scenarios = close.shape
    close = jnp.pad(close, [(0, -n_vehicles % TOGETHER), (0, 0)]).reshape(-1, TOGETHER, n_scenarios)
    return functools.reduce(jnp.bitwise_or, (close[:, k] << jnp.uint32(k * WINDOW) for k in range(TOGETHER)))


class _Road(NamedTuple):
    """Who stands where, and the vehicles, all scenarios in a row.

    Attributes:
        vehicle: By place, where the vehicle stands among all.
        rectangles: The vehicles.
    """

    vehicle: Int[Array, "vehicles scenarios"]
    rectangles: Rectangle


class _Pairs(NamedTuple):
    """Pairs of vehicles that may touch.

    Attributes:
        close: The pairs as bits: WINDOW for the places ahead of one place, the next WINDOW for the place after it.
        place: Of each number the first place, counted through all scenarios as in `_Road`.
        first: Places ahead of the lowest of WINDOW bits.
    """

    close: UInt32[Array, " numbers"]
    place: Int[Array, " numbers"]
    first: Int[Array, ""]


def _test_pairs(pairs: _Pairs, n_tested: int, road: _Road, found: _Found, model: TrafficModel) -> _Found:
    """What is found once the pairs have been tested.

    Args:
        pairs: The pairs.
        n_tested: How many are tested at a time.
        road: The traffic.
        found: So far.
        model: The tick.
    """
    count = lax.population_count(pairs.close).astype(jnp.int32)
    end = jnp.cumsum(count, dtype=jnp.int32)
    vehicle, n_scenarios = road.vehicle.ravel(), road.vehicle.shape[1]

    def test_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        tested, found = work
        pair = tested + lax.iota(jnp.int32, n_tested)
        number = _listed(end, pair)
        bit = _set_bit(pairs.close[number], pair - end[number] + count[number])
        rear = pairs.place[number] + bit // WINDOW * n_scenarios
        front = jnp.minimum(rear + (pairs.first + bit % WINDOW) * n_scenarios, vehicle.size - 1)
        one, other = vehicle[jnp.minimum(rear, vehicle.size - 1)], vehicle[front]
        is_pair = pair < end[-1]
        found = _test(jnp.minimum(one, other), jnp.maximum(one, other), is_pair, road.rectangles, found, model)
        return tested + n_tested, found

    return lax.while_loop(lambda work: work[0] < end[-1], test_some, (jnp.int32(0), found))[1]


def _look_further(
    goes_on: Bool[Array, "vehicles *scenarios"],
    by_place: Extent,
    farthest: Float[Array, "vehicles *scenarios"],
    road: _Road,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found once the pairs beyond the first window have been tested as well.

    Args:
        goes_on: By place, whether somebody beyond the first window may be touched.
        by_place: Everybody.
        farthest: Position beyond which nobody can be touched [m].
        road: The traffic.
        found: So far.
        model: The tick.
    """
    n_followed = goes_on.size // FOLLOWED + 1
    goes_on, by_place, farthest = jax.tree.map(jnp.ravel, (goes_on, by_place, farthest))
    window, n_scenarios = lax.iota(jnp.int32, WINDOW), road.vehicle.shape[1]
    bit = (jnp.uint32(1) << window.astype(jnp.uint32))[None]
    end = jnp.cumsum(goes_on, dtype=jnp.int32)

    def follow_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        followed, found = work
        number = followed + lax.iota(jnp.int32, n_followed)
        place = _listed(end, number)
        rear, their_farthest = jax.tree.map(lambda values: values[place][:, None], (by_place, farthest))

        def look_on(work: tuple[Array, Array, _Found]) -> tuple[Array, Array, _Found]:
            first, goes_on, found = work
            ahead = place[:, None] + (first + window)[None] * n_scenarios
            is_there = (ahead < end.size) & goes_on[:, None]
            other = jax.tree.map(lambda values: values[jnp.minimum(ahead, end.size - 1)], by_place)
            bits = jnp.where(may_touch(rear, other) & is_there, bit, jnp.uint32(0))
            pairs = _Pairs(jnp.sum(bits, axis=1, dtype=jnp.uint32), place, first)
            goes_on = (is_there & (other.x <= their_farthest))[:, -1]
            return first + WINDOW, goes_on, _test_pairs(pairs, n_followed // 2 + 1, road, found, model)

        start = jnp.int32(1 + WINDOW), number < end[-1], found
        found = lax.while_loop(lambda work: jnp.any(work[1]), look_on, start)[2]
        return followed + n_followed, found

    return lax.while_loop(lambda work: work[0] < end[-1], follow_some, (jnp.int32(0), found))[1]


def _listed(end: Int[Array, " listed"], number: Int[Array, " wanted"]) -> Int[Array, " wanted"]:
    """Under which entry of a list each number falls; `end` is the number after the last of each entry."""
    entry = jnp.searchsorted(end, number, side="right", method="scan_unrolled")
    return jnp.minimum(entry, end.size - 1)


def _set_bit(bits: UInt32[Array, " pairs"], number: Int[Array, " pairs"]) -> Int[Array, " pairs"]:
    """Position of the set bit that has this number of set bits below it, by halving the range it may be in."""
    position = jnp.zeros_like(number)
    width = WINDOW * TOGETHER // 2
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
