"""The order of the vehicles along the road, and what can be read off it in one walk.

For many vehicles, looking at all others costs too much. Walking once from the head of the traffic to its tail, and
remembering the last vehicle met on each lane, gives everybody's leader on every lane; walking back gives the
followers. The order changes little from tick to tick, so that sorting starts from the last one and needs a pass or two.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.model import TrafficModel

_Sorted = tuple[Array, Array]
"""Positions [m] and vehicle indices, by place in the order."""

NOBODY = -1
"""Index that stands for no vehicle."""


def sort_along_road(
    x: Float[Array, "vehicles *scenarios"], order: Int[Array, "vehicles *scenarios"]
) -> Int[Array, "vehicles *scenarios"]:
    """Vehicle indices by rising x, those of equal x by falling index.

    Found from any permutation by exchanging neighbours (odd-even transposition sort).
    """
    n_vehicles = x.shape[0]

    def is_wrong(low: _Sorted, high: _Sorted) -> Array:
        return (low[0] > high[0]) | ((low[0] == high[0]) & (low[1] < high[1]))

    def exchange(first: int, values: _Sorted) -> _Sorted:
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
    return jnp.take_along_axis(each, jnp.maximum(index, 0), axis=0)


def own_places(index: Int[Array, "places *scenarios"]) -> tuple[Array, ...]:
    """Each scenario's own places of an array `[vehicles, *scenarios]`, to write to with `.at`."""
    return index, *(lax.broadcasted_iota(jnp.int32, index.shape, axis) for axis in range(1, index.ndim))


class NearestOnLanes(eqx.Module):
    """The nearest vehicle ahead and behind on every lane, as indices; NOBODY where there is none.

    Attributes:
        ahead: Per lane; the same position counts as ahead, and of equally near vehicles the last in the list is meant.
        behind: Per lane; of equally near vehicles the first in the list.
    """

    ahead: tuple[Int[Array, "vehicles *scenarios"], ...]
    behind: tuple[Int[Array, "vehicles *scenarios"], ...]

    def on(
        self, lane: Int[Array, "vehicles *scenarios"]
    ) -> tuple[Int[Array, "vehicles *scenarios"], Int[Array, "vehicles *scenarios"]]:
        """Vehicle ahead and vehicle behind on a lane of each vehicle's choice."""
        ahead = behind = jnp.full_like(lane, NOBODY)
        for number in range(len(self.ahead)):
            ahead = jnp.where(lane == number, self.ahead[number], ahead)
            behind = jnp.where(lane == number, self.behind[number], behind)
        return ahead, behind


def walk_along_road(
    order: Int[Array, "vehicles *scenarios"],
    x: Float[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    lane_bit: Callable[[int], int],
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
    lanes = range(model.n_lanes)
    nobody = tuple(jnp.full(order.shape[1:], NOBODY, jnp.int32) for _ in lanes)

    def pass_by(met: tuple[Array, ...], vehicle: tuple[Array, Array]) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        index, bits = vehicle
        return tuple(jnp.where((bits & lane_bit(k)) != 0, index, met[k]) for k in lanes), met

    vehicles = order, pick(on_lanes, order)
    _, ahead = lax.scan(pass_by, nobody, vehicles, reverse=True)
    _, behind = lax.scan(pass_by, nobody, vehicles)
    ahead, behind = _see_beside(pick(x, order), *vehicles, ahead, behind, lane_bit)
    place = inverse(order)
    return NearestOnLanes(*(tuple(pick(found, place) for found in side) for side in (ahead, behind)))


def _see_beside(
    x: Float[Array, "vehicles *scenarios"],
    index: Int[Array, "vehicles *scenarios"],
    on_lanes: Int[Array, "vehicles *scenarios"],
    ahead: tuple[Array, ...],
    behind: tuple[Array, ...],
    lane_bit: Callable[[int], int],
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Vehicles level with each other count as ahead of each other, and never as behind; arrays by place in the order.

    The walk has already met those that come later in the order. Of those before, which have higher indices, the
    farthest is the last in the list; and whoever is behind it is behind all vehicles level with it.
    """

    def is_level(places: Array) -> Array:
        """Whether the vehicle so many places back is on the road and has the same x."""
        is_pair = lax.broadcasted_iota(jnp.int32, x.shape, 0) >= places
        return is_pair & (x == jnp.roll(x, places, 0)) & (on_lanes != 0)

    def look_back(work: tuple[Array, Array, tuple[Array, ...], tuple[Array, ...]]) -> tuple:
        places, level, seen_ahead, seen_behind = work
        other, bits = jnp.roll(index, places, 0), jnp.roll(on_lanes, places, 0)
        seen_ahead = tuple(
            jnp.where(level & ((bits & lane_bit(k)) != 0), other, seen) for k, seen in enumerate(seen_ahead)
        )
        seen_behind = tuple(
            jnp.where(level, jnp.roll(walked, places, 0), seen)
            for walked, seen in zip(behind, seen_behind, strict=True)
        )
        return places + 1, is_level(places + 1), seen_ahead, seen_behind

    first = jnp.int32(1)
    return lax.while_loop(lambda work: jnp.any(work[1]), look_back, (first, is_level(first), ahead, behind))[2:]


def inverse(order: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """Place of each vehicle in the order."""
    places = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    return jnp.zeros_like(places).at[own_places(order)].set(places, unique_indices=True, mode="promise_in_bounds")
