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
from rearl_jax.core.contacts import Extent, Marks, contact, extent_of, may_touch
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

    All vehicles of all scenarios are in a row, by their indices.
    """

    crashed: Bool[Array, " all"]
    partner: Int[Array, " all"]
    push_x: Float[Array, " all"]
    push_y: Float[Array, " all"]


class _Road(NamedTuple):
    """Who stands where, all places of all scenarios in a row.

    Attributes:
        rectangles: The vehicles by place; sizes may be one for all.
        vehicle: Where each stands among all vehicles.
        n_scenarios: Number of scenarios, which is how far the next place of the same one is away.
    """

    rectangles: Rectangle
    vehicle: Int[Array, " all"]
    n_scenarios: int

    def at(self, place: Int[Array, " places"]) -> Rectangle:
        """The vehicles at some places."""
        return jax.tree.map(lambda values: pick(values, place), self.rectangles)


def collide_along_road(
    order: Int[Array, "vehicles *scenarios"],
    by_place: Rectangle,
    marks: Marks,
    model: TrafficModel,
) -> Marks:
    """Crash marks and pushes after all pairs that may touch have been tested.

    Args:
        order: Vehicle indices by rising x.
        by_place: The vehicles in this order.
        marks: Of the tick so far, by vehicle index.
        model: The tick.
    """
    extent = extent_of(by_place, model)
    reach = extent.reach_x + jnp.abs(extent.moved_x) + jnp.abs(extent.moved_y)
    farthest = extent.x + reach + jnp.max(reach, axis=0, keepdims=True)
    nobody = jnp.zeros(order.shape, jnp.uint32), jnp.zeros(order.shape, bool)
    is_near = extent.x[1:] <= farthest[:-1]
    close, goes_on = if_any(is_near, lambda: _look_ahead(extent, farthest), nobody)

    n_scenarios = order.size // order.shape[0]
    scenario = lax.broadcasted_iota(jnp.int32, (1, n_scenarios), 1)
    vehicle = order.reshape(-1, n_scenarios) * n_scenarios + scenario
    road = _Road(jax.tree.map(functools.partial(_in_a_row, order.shape), by_place), vehicle.ravel(), n_scenarios)
    crashed, is_pushed, push_x, push_y = marks
    found = _Found(crashed.ravel(), jnp.full(order.size, NOBODY, jnp.int32), push_x.ravel(), push_y.ravel())

    numbers = _together(close.reshape(-1, n_scenarios))
    places = TOGETHER * n_scenarios * lax.broadcasted_iota(jnp.int32, numbers.shape, 0) + scenario
    pairs = _Pairs(numbers.ravel(), places.ravel(), jnp.int32(1))
    found = _test_pairs(pairs, order.size // TESTED + 1, road, found, model)
    found = lax.cond(
        jnp.any(goes_on),
        lambda found: _look_further(goes_on, extent, farthest, road, found, model),
        lambda found: found,
        found,
    )
    found = jax.tree.map(lambda values: values.reshape(order.shape), found)
    return found.crashed, is_pushed | (found.partner != NOBODY), found.push_x, found.push_y


def _in_a_row(shape: tuple[int, ...], values: Array) -> Array:
    """All scenarios' values in a row; what is one for all stays so."""
    return values.ravel() if values.size == 1 else jnp.broadcast_to(values, shape).ravel()


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


class _Pairs(NamedTuple):
    """Pairs of vehicles that may touch.

    Attributes:
        close: The pairs as bits: WINDOW for the places ahead of one place, the next WINDOW for the place after it.
        place: Of each number the first place.
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
    listed = _list(pairs.close != 0)
    close, place = (values.at[listed].get(mode="fill", fill_value=0) for values in (pairs.close, pairs.place))
    count = lax.population_count(close).astype(jnp.int32)
    end = jnp.cumsum(count, dtype=jnp.int32)
    # A lot may reach beyond the last of them, where nothing begins.
    begin, close, place = (jnp.pad(values, (0, n_tested)) for values in (end - count, close, place))

    def test_some(work: tuple[Array, Array, _Found]) -> tuple[Array, Array, _Found]:
        tested, entry, found = work
        is_pair = lax.iota(jnp.int32, n_tested) < end[-1] - tested

        def tell_places() -> tuple[Array, Array, Array]:
            begins = lax.dynamic_slice_in_dim(begin, entry, n_tested) - tested
            is_first = jnp.zeros(n_tested, jnp.int32).at[jnp.where(begins > 0, begins, n_tested)].set(1, mode="drop")
            number = entry + jnp.cumsum(is_first, dtype=jnp.int32)
            bit = _set_bit(close[number], tested + lax.iota(jnp.int32, n_tested) - begin[number])
            rear = place[number] + bit // WINDOW * road.n_scenarios
            return number, rear, rear + (pairs.first + bit % WINDOW) * road.n_scenarios

        nothing = jnp.zeros(n_tested, jnp.int32)
        number, rear, front = if_any(is_pair, tell_places, (nothing, nothing, nothing))
        done = tested + n_tested
        found = _test(rear, front, is_pair, road, found, model)
        return done, number[-1] + (end[number[-1]] == done).astype(jnp.int32), found

    start = jnp.int32(0), jnp.int32(0), found
    return lax.while_loop(lambda work: work[0] < end[-1], test_some, start)[2]


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
    n_places, n_followed = goes_on.size, goes_on.size // FOLLOWED + 1
    goes_on, by_place, farthest = jax.tree.map(jnp.ravel, (goes_on, by_place, farthest))
    window = lax.iota(jnp.int32, WINDOW)
    bit = (jnp.uint32(1) << window.astype(jnp.uint32))[None]
    n_listed = jnp.sum(goes_on, dtype=jnp.int32)
    listed = jnp.pad(_list(goes_on), (0, n_followed))

    def follow_some(work: tuple[Array, _Found]) -> tuple[Array, _Found]:
        followed, found = work
        place = jnp.minimum(lax.dynamic_slice_in_dim(listed, followed, n_followed), n_places - 1)
        rear, their_farthest = jax.tree.map(lambda values: values[place][:, None], (by_place, farthest))

        def look_on(work: tuple[Array, Array, _Found]) -> tuple[Array, Array, _Found]:
            first, goes_on, found = work
            ahead = place[:, None] + (first + window)[None] * road.n_scenarios
            is_there = (ahead < n_places) & goes_on[:, None]
            other = jax.tree.map(lambda values: values[jnp.minimum(ahead, n_places - 1)], by_place)
            bits = jnp.where(may_touch(rear, other) & is_there, bit, jnp.uint32(0))
            pairs = _Pairs(jnp.sum(bits, axis=1, dtype=jnp.uint32), place, first)
            goes_on = (is_there & (other.x <= their_farthest))[:, -1]
            return first + WINDOW, goes_on, _test_pairs(pairs, n_followed // 2 + 1, road, found, model)

        start = jnp.int32(1 + WINDOW), lax.iota(jnp.int32, n_followed) < n_listed - followed, found
        found = lax.while_loop(lambda work: jnp.any(work[1]), look_on, start)[2]
        return followed + n_followed, found

    return lax.while_loop(lambda work: work[0] < n_listed, follow_some, (jnp.int32(0), found))[1]


def _list(is_listed: Bool[Array, " all"]) -> Int[Array, " all"]:
    """Where those listed are, in order; after the last of them a number that is nowhere."""
    n_all = is_listed.size
    place = jnp.where(is_listed, jnp.cumsum(is_listed, dtype=jnp.int32) - 1, n_all)
    return jnp.full(n_all, n_all, jnp.int32).at[place].set(lax.iota(jnp.int32, n_all), mode="drop")


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
    rear: Int[Array, " pairs"],
    front: Int[Array, " pairs"],
    is_pair: Bool[Array, " pairs"],
    road: _Road,
    found: _Found,
    model: TrafficModel,
) -> _Found:
    """What is found after some pairs, whose places are given.

    Of all that push a vehicle, the one with the highest index is the last to do so in highway-env, and counts: pairs
    may come in any sequence here, so each push is written only where nobody with a higher index has pushed so far.
    """
    rear, front = jnp.minimum(rear, road.vehicle.size - 1), jnp.minimum(front, road.vehicle.size - 1)
    of_rear, of_front = road.vehicle[rear], road.vehicle[front]
    is_rear_first = of_rear < of_front
    one, other = road.at(jnp.where(is_rear_first, rear, front)), road.at(jnp.where(is_rear_first, front, rear))
    low, high = jnp.minimum(of_rear, of_front), jnp.maximum(of_rear, of_front)
    touches, will_touch, shift_x, shift_y = contact(one, other, is_pair, model)

    crashed = found.crashed.at[low].max(touches).at[high].max(touches)
    partner = found.partner.at[low].max(jnp.where(will_touch, high, NOBODY))
    partner = partner.at[high].max(jnp.where(will_touch, low, NOBODY))
    n_all = partner.shape[0]
    written_low = jnp.where(will_touch & (partner[low] == high), low, n_all)
    written_high = jnp.where(will_touch & (partner[high] == low), high, n_all)
    push_x, push_y = (
        push.at[written_low].set(shift / 2, mode="drop").at[written_high].set(-shift / 2, mode="drop")
        for push, shift in ((found.push_x, shift_x), (found.push_y, shift_y))
    )
    return _Found(crashed, partner, push_x, push_y)
