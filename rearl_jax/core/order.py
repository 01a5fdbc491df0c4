"""The order of the vehicles along the road.

For many vehicles, looking at all others costs too much. Instead they are kept sorted by x, starting from the order of
the last tick, which has changed little. Who is next on every lane is read off it in `rearl_jax.core.nearest`.
"""

import math

import jax
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
    moves two places at most in such a double pass, and hardly any needs to move more in a tick. Even and odd places
    are kept apart, so that a pair is the same row of both and nothing has to be woven together in between.
    """

    def is_unsorted(places: tuple[_Sorted, _Sorted]) -> Array:
        return jnp.any(_is_wrong(*places))  # pairs that begin at odd places have just been put right

    def passes(places: tuple[_Sorted, _Sorted]) -> tuple[_Sorted, _Sorted]:
        return _exchange_from_odd_places(*_exchange(*places))

    by_place = pick(x, order), order
    if x.shape[0] % 2:
        # Somebody beyond all others, who stays the last, makes pairs of all.
        by_place = _followed_by(by_place[0], jnp.inf), _followed_by(order, NOBODY)
    even, odd = (jax.tree.map(lambda values, k=k: values[k::2], by_place) for k in (0, 1))
    even, odd = lax.while_loop(is_unsorted, passes, _exchange_from_odd_places(even, odd))
    sorted_ = jnp.stack([even[1], odd[1]], axis=1)
    return sorted_.reshape(-1, *order.shape[1:])[: order.shape[0]]


def _followed_by(values: Array, last: float | int) -> Array:
    """Values of all vehicles and of one more in every scenario."""
    return jnp.pad(values, [(0, 1)] + [(0, 0)] * (values.ndim - 1), constant_values=last)


def _is_wrong(low: _Sorted, high: _Sorted) -> Array:
    """Whether the first of each pair belongs behind the second."""
    return (low[0] > high[0]) | ((low[0] == high[0]) & (low[1] < high[1]))


def _exchange(low: _Sorted, high: _Sorted) -> tuple[_Sorted, _Sorted]:
    """The pairs in the right order."""
    swap = _is_wrong(low, high)
    lower = jax.tree.map(lambda first, second: jnp.where(swap, second, first), low, high)
    higher = jax.tree.map(lambda first, second: jnp.where(swap, first, second), low, high)
    return lower, higher


def _exchange_from_odd_places(even: _Sorted, odd: _Sorted) -> tuple[_Sorted, _Sorted]:
    """Even and odd places after the pairs that begin at odd places; the first place and the last have no partner."""
    between = jax.tree.map(lambda values: values[:-1], odd), jax.tree.map(lambda values: values[1:], even)
    odd_between, even_between = _exchange(*between)
    even = jax.tree.map(lambda values, new: jnp.concatenate([values[:1], new]), even, even_between)
    odd = jax.tree.map(lambda values, new: jnp.concatenate([new, values[-1:]]), odd, odd_between)
    return even, odd


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
