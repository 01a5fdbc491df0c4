"""The order of the vehicles along the road, and what can be read off it: who is next on every lane.

For many vehicles, looking at all others costs too much. Instead they are kept sorted by x (`sort_along_road`), starting
from the order of the last tick, which has changed little. Then the order is walked once from the head of the traffic to
its tail, remembering the last vehicle met on each lane: that is the leader on this lane for whoever comes next. Walking
back gives the followers (`walk_along_road`). Whom a vehicle finds on a lane is looked up afterwards (`NearestOnLanes`),
where vehicles abreast, at exactly the same x, get the answers that highway-env gives them.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.affected import if_any
from rearl_jax.core.model import TrafficModel

_Sorted = tuple[Array, Array]
"""Positions [m] and vehicle indices, by place in the order."""

NOBODY = -1
"""Index that stands for no vehicle."""


def sort_along_road(
    x: Float[Array, "vehicles *scenarios"], order: Int[Array, "vehicles *scenarios"]
) -> Int[Array, "vehicles *scenarios"]:
    """Vehicle indices by rising x, those of equal x by falling index.

    Odd-even transposition sort from any permutation: neighbours that stand in the wrong order are exchanged, all pairs
    that begin at even places at once, then all that begin at odd places, until no scenario has such a pair. A vehicle
    moves two places at most in such a double pass, and hardly any needs to move more in a tick.
    """
    n_vehicles = x.shape[0]

    def is_wrong(low: _Sorted, high: _Sorted) -> Array:
        return (low[0] > high[0]) | ((low[0] == high[0]) & (low[1] < high[1]))

    def exchange(first: int, values: _Sorted) -> _Sorted:
        # The pairs are (first, first + 1), (first + 2, first + 3), ...; who has no partner at the ends stays.
        last = first + (n_vehicles - first) // 2 * 2
        lows = values[0][first:last:2], values[1][first:last:2]
        highs = values[0][first + 1 : last : 2], values[1][first + 1 : last : 2]
        swap = is_wrong(lows, highs)

        def exchanged(array: Array, low: Array, high: Array) -> Array:
            pairs = jnp.stack([jnp.where(swap, high, low), jnp.where(swap, low, high)], axis=1)
            middle = pairs.reshape(last - first, *array.shape[1:])
            return jnp.concatenate([array[:first], middle, array[last:]])

        return exchanged(values[0], lows[0], highs[0]), exchanged(values[1], lows[1], highs[1])

    def is_unsorted(values: _Sorted) -> Array:
        return jnp.any(is_wrong((values[0][:-1], values[1][:-1]), (values[0][1:], values[1][1:])))

    def passes(values: _Sorted) -> _Sorted:
        return exchange(1, exchange(0, values))

    return lax.while_loop(is_unsorted, passes, (pick(x, order), order))[1]


def pick(values: Array, index: Int[Array, "places *scenarios"]) -> Array:
    """Each scenario's values at the given vehicle indices; the first vehicle's for NOBODY."""
    if values.shape[0] == 1:
        return values
    each = jnp.broadcast_to(values, (values.shape[0], *index.shape[1:]))
    return jnp.take_along_axis(each, jnp.maximum(index, 0), axis=0, mode="promise_in_bounds")


def own_places(index: Int[Array, "places *scenarios"]) -> tuple[Array, ...]:
    """Each scenario's own places of an array `[vehicles, *scenarios]`, to write to with `.at`."""
    return index, *(lax.broadcasted_iota(jnp.int32, index.shape, axis) for axis in range(1, index.ndim))


class NearestOnLanes(eqx.Module):
    """The nearest vehicle ahead and behind on every lane, as seen from every place in the order.

    `ahead` and `behind` have a row for each place and lane. The rows of a place stand together, lane 0 first; the
    places follow each other in the sequence in which `_walk` comes by, which is not that of the order, so each vehicle
    carries the number of its first row.

    Vehicles abreast, which have exactly the same x, count as ahead of each other and never as behind. In the order they
    stand by falling index, so the answers for all of them begin at the first: it may be the vehicle ahead itself, being
    the last in the list, and only those before it are behind.

    Attributes:
        ahead: Index of the first vehicle later in the order that is on the lane; NOBODY where there is none.
        behind: Index of the last one earlier in the order; NOBODY where there is none.
        row: First row of each vehicle's place.
        first_row: First row of the first of those abreast of each vehicle, mostly its own.
        first: Index of that one.
        first_on: Lanes it is on, as bits.
        who: Index of each vehicle that looks; None where all do.
        n_lanes: Number of lanes.
        lane_bit: The bit of a lane.
    """

    ahead: Int[Array, "rows *scenarios"]
    behind: Int[Array, "rows *scenarios"]
    row: Int[Array, "vehicles *scenarios"]
    first_row: Int[Array, "vehicles *scenarios"]
    first: Int[Array, "vehicles *scenarios"]
    first_on: Int[Array, "vehicles *scenarios"]
    who: Int[Array, "vehicles *scenarios"] | None
    n_lanes: int = eqx.field(static=True)
    lane_bit: Callable[[Array], Array] = eqx.field(static=True)

    def ahead_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The vehicle next ahead on a lane of each vehicle's choice; NOBODY for none.

        The same x counts as ahead; of equally near vehicles the last in the list is meant.

        Args:
            lane: The lanes; those that do not exist are empty.
        """
        index = lax.broadcasted_iota(jnp.int32, lane.shape, 0) if self.who is None else self.who
        is_first_on = (self.first_on & self.lane_bit(lane)) != 0
        nearest = jnp.where(is_first_on, self.first, self._at(self.ahead, self.first_row, lane))
        # A vehicle that finds itself is the first of those abreast that are on the lane: the next one is later.
        nearest = jnp.where(nearest == index, self._at(self.ahead, self.row, lane), nearest)
        return self._found(nearest, lane)

    def seen_by(self, who: Int[Array, "places *scenarios"]) -> "NearestOnLanes":
        """The same for some vehicles, who alone may then ask whom they find ahead or behind.

        Args:
            who: Their indices.
        """
        row, first_row, first, first_on = (pick(v, who) for v in (self.row, self.first_row, self.first, self.first_on))
        return replace(self, row=row, first_row=first_row, first=first, first_on=first_on, who=who)

    def after(
        self, index: Int[Array, "vehicles *scenarios"], lane: Int[Array, "vehicles *scenarios"]
    ) -> Int[Array, "vehicles *scenarios"]:
        """The next on a lane later in the order than a given vehicle; NOBODY for none.

        Args:
            index: The vehicles; means nothing for NOBODY.
            lane: The lanes; those that do not exist are empty.
        """
        return self._found(self._at(self.ahead, pick(self.row, index), lane), lane)

    def behind_on(self, lane: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
        """The vehicle next behind on a lane of each vehicle's choice; of equally near ones the first in the list."""
        return self._found(self._at(self.behind, self.first_row, lane), lane)

    def _found(self, index: Array, lane: Array) -> Array:
        """The index, where the lane exists."""
        exists = (lane >= 0) & (lane < self.n_lanes)
        return jnp.where(exists, index, NOBODY)

    def _at(self, rows: Array, row: Array, lane: Array) -> Array:
        return pick(rows, row + jnp.clip(lane, 0, self.n_lanes - 1))


def walk_along_road(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    lane_bit: Callable[[Array], Array],
    model: TrafficModel,
) -> NearestOnLanes:
    """Everybody's nearest vehicles on every lane.

    Args:
        order: Vehicle indices as `sort_along_road` leaves them.
        x: Positions [m].
        on_lanes: Lanes each vehicle is on, as bits.
        lane_bit: The bit of a lane.
        model: The road.
    """
    n_lanes, place = model.n_lanes, inverse(order)
    ahead, behind = _walk(order, pick(on_lanes, order), lane_bit(jnp.arange(n_lanes, dtype=jnp.int32)))
    along = pick(x, order)
    is_level = jnp.pad(along[1:] == along[:-1], [(1, 0)] + [(0, 0)] * (along.ndim - 1))

    def look_abreast() -> tuple[Array, Array, Array]:
        first_place = pick(_first_of_level(is_level), place)
        first = pick(order, first_place)
        return first_place, first, pick(on_lanes, first)

    index = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    first_place, first, first_on = if_any(is_level, look_abreast, (place, index, on_lanes))
    return NearestOnLanes(
        ahead=ahead,
        behind=behind,
        row=_row_of(place) * n_lanes,
        first_row=_row_of(first_place) * n_lanes,
        first=first,
        first_on=first_on,
        who=None,
        n_lanes=n_lanes,
        lane_bit=lane_bit,
    )


def _walk(
    order: Int[Array, "vehicles *scenarios"], bits: Int[Array, "vehicles *scenarios"], lane_bits: Int[Array, " lanes"]
) -> tuple[Int[Array, "rows *scenarios"], Int[Array, "rows *scenarios"]]:
    """By row the vehicle last met on the lane, walking against the order and along it.

    Stretches of the order are walked side by side (`by_step`). Whom a stretch has met last on each lane is then handed
    on from stretch to stretch, and counts wherever nobody has been met on the own one yet.

    Rows are numbered by step, in each step by stretch (`_row_of`), and there by lane.

    Args:
        order: Vehicle indices by place.
        bits: Lanes they are on.
        lane_bits: The bit of every lane.
    """
    n_lanes = len(lane_bits)
    others = order.shape[1:]
    lane_bits = lane_bits.reshape(1, n_lanes, *(1,) * len(others))
    # The last stretch is filled up with vehicles that are on no lane.
    vehicles = by_step(order)[:, :, None], by_step(bits)[:, :, None]
    length, n_stretches = vehicles[0].shape[:2]

    def met_on_the_way(reverse: bool) -> Array:
        """By row, who has been met last on the lane before coming to the place."""

        def pass_by(met: Array, vehicle: tuple[Array, Array]) -> tuple[Array, Array]:
            index, on = vehicle
            return jnp.where((on & lane_bits) != 0, index, met), met

        def go_on(met: Array, last: Array) -> tuple[Array, Array]:
            return jnp.where(last == NOBODY, met, last), met

        nobody = jnp.full((n_stretches, n_lanes, *others), NOBODY, jnp.int32)
        last, met = lax.scan(pass_by, nobody, vehicles, reverse=reverse)
        _, before = lax.scan(go_on, nobody[0], last, reverse=reverse)
        return jnp.where(met == NOBODY, before[None], met).reshape(-1, *others)

    return met_on_the_way(reverse=True), met_on_the_way(reverse=False)


def _row_of(place: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """Where a place of the order comes among the rows of `by_step`, flattened."""
    length, n_stretches = _stretches(place.shape[0])
    return place % length * n_stretches + place // length


def _stretches(n_vehicles: int) -> tuple[int, int]:
    """Places of a stretch, and stretches of the order."""
    length = math.isqrt(n_vehicles - 1) + 1
    return length, -(-n_vehicles // length)


def by_step(values: Array) -> Array:
    """`[length, stretches, *scenarios]`: a row of vehicles cut into stretches that can be walked side by side.

    A plain walk takes n steps of one place each. With stretches of about sqrt(n) places, step k comes to the k-th place
    of every stretch, and another walk of as many steps goes from stretch to stretch: about 2 sqrt(n) steps, with
    vector code over many places in each. The last stretch is filled up with zeros.

    Args:
        values: `[vehicles, *scenarios]`.
    """
    n_vehicles, others = values.shape[0], values.shape[1:]
    length, n_stretches = _stretches(n_vehicles)
    filled = jnp.pad(values, [(0, n_stretches * length - n_vehicles)] + [(0, 0)] * len(others))
    return filled.reshape(n_stretches, length, *others).swapaxes(0, 1)


def running_count(is_counted: Bool[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """How many are counted before each vehicle of a scenario. Several times as fast as jnp.cumsum."""

    def count(before: Array, counted: Array) -> tuple[Array, Array]:
        return before + counted, before

    steps = by_step(is_counted.astype(jnp.int32))
    in_stretch, before = lax.scan(count, jnp.zeros_like(steps[0]), steps)
    _, before_stretch = lax.scan(count, jnp.zeros_like(in_stretch[0]), in_stretch)
    total = (before + before_stretch[None]).swapaxes(0, 1)
    return total.reshape(-1, *is_counted.shape[1:])[: is_counted.shape[0]]


def _first_of_level(is_level: Bool[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """By place, the first place with the same x, given which have that of the place before.

    Everybody points at the place before if that is level, and then at whatever the place pointed at points at: twice as
    far back each time, until all point at one that begins a level.
    """
    place = lax.broadcasted_iota(jnp.int32, is_level.shape, 0)

    def point_further(work: tuple[Array, Array]) -> tuple[Array, Array]:
        first = pick(work[0], work[0])
        return first, pick(is_level, first)

    start = place - is_level.astype(jnp.int32), is_level & jnp.roll(is_level, 1, axis=0)
    return lax.while_loop(lambda work: jnp.any(work[1]), point_further, start)[0]


def inverse(order: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """Place of each vehicle in the order."""
    places = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    return jnp.zeros_like(places).at[own_places(order)].set(places, unique_indices=True, mode="promise_in_bounds")
