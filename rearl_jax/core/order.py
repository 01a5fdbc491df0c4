"""The order of the vehicles along the road.

For many vehicles, looking at all others costs too much. Instead they are kept sorted by x, starting from the order of
the last tick, which has changed little. Who is next on every lane is read off it in `rearl_jax.core.nearest`.
"""

import math

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

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


def in_a_row(index: Int[Array, "places *scenarios"]) -> Int[Array, "places *scenarios"]:
    """Where vehicles are among those of all scenarios in a row, given their indices within their scenario."""
    n_scenarios = math.prod(index.shape[1:])
    return index * n_scenarios + lax.iota(jnp.int32, n_scenarios).reshape(1, *index.shape[1:])


def pick(values: Array, index: Int[Array, "places *scenarios"]) -> Array:
    """Each scenario's values at the given vehicle indices; the first vehicle's for NOBODY.

    From all scenarios in a row, which costs half of what indices along two axes do.
    """
    if values.shape[0] == 1:
        return values
    each = jnp.broadcast_to(values, (values.shape[0], *index.shape[1:]))
    return each.ravel().at[in_a_row(jnp.maximum(index, 0))].get(mode="promise_in_bounds")


def inverse(order: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """Place of each vehicle in the order."""
    places = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    row = (
        jnp.zeros(order.size, jnp.int32).at[in_a_row(order)].set(places, unique_indices=True, mode="promise_in_bounds")
    )
    return row.reshape(order.shape)
