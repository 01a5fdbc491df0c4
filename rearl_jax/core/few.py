"""A few vehicles of each scenario, treated by themselves.

In large traffic a few per cent are on their way to another lane. They are copied next to each other, treated there, and
what comes out is put back; where there are more of them than places, everybody is to be treated.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int

from rearl_jax.core import bits
from rearl_jax.core.lots import put
from rearl_jax.core.order import in_a_row, pick

ONE_IN_CHANGES_LANES = 16
"""There are places for one vehicle in so many that is on its way to another lane, and for what chance adds."""


def places_for(n_vehicles: int, one_in: int) -> int:
    """Places for one vehicle in so many, and for what chance adds."""
    return n_vehicles // one_in + math.isqrt(n_vehicles) + 2


class Few(eqx.Module):
    """The chosen vehicles of each scenario, in the order of the list.

    Attributes:
        who: Index of each; `n_vehicles` in places that are left empty.
        n_vehicles: Vehicles they are chosen from.
        suffices: Whether there is a place for everybody who was chosen, in all scenarios.
    """

    who: Int[Array, "places *scenarios"]
    suffices: Bool[Array, ""]
    n_vehicles: int = eqx.field(static=True)

    @property
    def index(self) -> Int[Array, "places *scenarios"]:
        """Index of each; in empty places that of the last vehicle."""
        return jnp.minimum(self.who, self.n_vehicles - 1)

    @property
    def is_there(self) -> Bool[Array, "places *scenarios"]:
        """Which places are not empty."""
        return self.who < self.n_vehicles

    def take(self, values: Array) -> Array:
        """Their own of all vehicles' values; what is one for all vehicles stays so."""
        return pick(values, self.index)

    def put(self, values: Array, otherwise: Array) -> Array:
        """Their values among those of all vehicles."""
        place, is_there = in_a_row(self.who), self.is_there
        return put(values.ravel(), place.ravel(), is_there.ravel(), otherwise)


def single_out(is_chosen: Bool[Array, "vehicles *scenarios"], one_in: int) -> Few:
    """The vehicles that are chosen.

    Args:
        is_chosen: Which.
        one_in: There are places for one vehicle in so many, and for what chance adds.
    """
    n_vehicles, others = is_chosen.shape[0], is_chosen.shape[1:]
    places, n_numbers = places_for(n_vehicles, one_in), -(-n_vehicles // bits.BITS)
    filled = jnp.pad(is_chosen, [(0, n_numbers * bits.BITS - n_vehicles)] + [(0, 0)] * len(others))
    numbers = bits.pack(filled.reshape(n_numbers, bits.BITS, *others).swapaxes(0, 1))
    counts = bits.count(numbers)
    rank = jnp.broadcast_to(lax.iota(jnp.int32, places).reshape(places, *(1,) * len(others)), (places, *others))

    def look_into(number: Array, found: tuple[Array, ...]) -> tuple[Array, ...]:
        begin, members, first, rank_in_number = found
        its, n_its = numbers[number][None], counts[number][None]
        is_in = (rank >= begin) & (rank < begin + n_its)
        new = its, number * bits.BITS, rank - begin
        old = members, first, rank_in_number
        return begin + n_its, *(jnp.where(is_in, a, b) for a, b in zip(new, old, strict=True))

    nothing = jnp.zeros_like(rank)
    start = jnp.zeros((1, *others), jnp.int32), nothing.astype(jnp.uint32), nothing, nothing
    total, members, first, rank_in_number = lax.fori_loop(0, n_numbers, look_into, start, unroll=min(n_numbers, 8))
    who = jnp.where(rank < total, first + bits.position(members, rank_in_number), n_vehicles)
    return Few(who, jnp.all(total <= places), n_vehicles)
