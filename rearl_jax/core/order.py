"""The order of the vehicles along the road, kept from one time step to the next.

In large traffic, comparing every vehicle with all others costs too much. Instead the vehicles are sorted by x, starting
from the order of the last time step, which has changed little. `rearl_jax.core.nearest` reads neighbours off it.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

_Keyed = tuple[Array, Array]
"""Sort keys, positions [m] and vehicle indices, by place in the order."""

NO_VEHICLE = -1
"""Index of no vehicle."""


def sort_along_road(
    x: Float[Array, "vehicles *scenarios"], order: Int[Array, "vehicles *scenarios"]
) -> Int[Array, "vehicles *scenarios"]:
    """Vehicle indices by rising x, those of equal x by falling index.

    Odd-even transposition sort from any permutation: neighbours in the wrong order are exchanged, all pairs that begin
    at even places at once, then all that begin at odd places, until no scenario has such a pair. It suits nearly sorted
    input and vector code: a vehicle moves two places at most in a double pass, and hardly any needs to move more in a
    time step, so one double pass mostly suffices; a library sort costs n log n with random access.

    Source: Habermann, Parallel Neighbor-Sort, Carnegie Mellon University (1972).
    """

    def is_unsorted(places: tuple[_Keyed, _Keyed]) -> Array:
        return jnp.any(_is_inverted(*places))  # pairs that begin at odd places have just been sorted

    def double_pass(places: tuple[_Keyed, _Keyed]) -> tuple[_Keyed, _Keyed]:
        return _exchange_from_odd_places(*_exchange(*places))

    by_place = take_vehicles(x, order), order
    if x.shape[0] % 2:
        # A sentinel at the end gives the last place a partner.
        by_place = _append(by_place[0], jnp.inf), _append(order, NO_VEHICLE)
    # Even and odd places are two arrays: a pair is the same row of both, so an exchange is element-wise and nothing
    # is interleaved between passes.
    even, odd = (jax.tree.map(lambda values, k=k: values[k::2], by_place) for k in (0, 1))
    even, odd = lax.while_loop(is_unsorted, double_pass, _exchange_from_odd_places(even, odd))
    sorted_ = jnp.stack([even[1], odd[1]], axis=1)
    return sorted_.reshape(-1, *order.shape[1:])[: order.shape[0]]


def _append(values: Array, last: float | int) -> Array:
    """Values by place with one more value at the end of every scenario."""
    return jnp.pad(values, [(0, 1)] + [(0, 0)] * (values.ndim - 1), constant_values=last)


def _is_inverted(low: _Keyed, high: _Keyed) -> Array:
    """True if a pair is in the wrong order; at equal x the higher index comes first."""
    return (low[0] > high[0]) | ((low[0] == high[0]) & (low[1] < high[1]))


def _exchange(low: _Keyed, high: _Keyed) -> tuple[_Keyed, _Keyed]:
    """The pairs in the right order."""
    swap = _is_inverted(low, high)
    lower = jax.tree.map(lambda first, second: jnp.where(swap, second, first), low, high)
    higher = jax.tree.map(lambda first, second: jnp.where(swap, first, second), low, high)
    return lower, higher


def _exchange_from_odd_places(even: _Keyed, odd: _Keyed) -> tuple[_Keyed, _Keyed]:
    """Even and odd places after the pairs that begin at odd places; the first place and the last have no partner."""
    between = jax.tree.map(lambda values: values[:-1], odd), jax.tree.map(lambda values: values[1:], even)
    odd_between, even_between = _exchange(*between)
    even = jax.tree.map(lambda values, new: jnp.concatenate([values[:1], new]), even, even_between)
    odd = jax.tree.map(lambda values, new: jnp.concatenate([new, values[-1:]]), odd, odd_between)
    return even, odd


def flat_index(index: Int[Array, "places *scenarios"]) -> Int[Array, "places *scenarios"]:
    """Flat index of vehicles among those of all scenarios, given their indices within their scenario."""
    n_scenarios = math.prod(index.shape[1:])
    return index * n_scenarios + lax.iota(jnp.int32, n_scenarios).reshape(1, *index.shape[1:])


def take_flat(values: Array | np.ndarray, index: Int[Array, "*places"]) -> Array:
    """Values at flat indices of existing elements, none of which counts from the end."""
    return jnp.ravel(values).at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)


def take_vehicles(values: Array, index: Int[Array, "places *scenarios"]) -> Array:
    """Each scenario's values at the given vehicle indices; the first vehicle's for NO_VEHICLE.

    By flat indices, which take half the time of indices along two axes on a CPU.
    """
    if values.shape[0] == 1:
        return values
    full = jnp.broadcast_to(values, (values.shape[0], *index.shape[1:]))
    return take_flat(full, flat_index(jnp.maximum(index, 0)))


def inverse(order: Int[Array, "vehicles *scenarios"]) -> Int[Array, "vehicles *scenarios"]:
    """Place of each vehicle in the order."""
    places = lax.broadcasted_iota(jnp.int32, order.shape, 0)
    flat = jnp.zeros(order.size, jnp.int32)
    flat = flat.at[flat_index(order)].set(places, unique_indices=True, mode="promise_in_bounds")
    return flat.reshape(order.shape)
