"""A few vehicles of each scenario, treated by themselves.

In large traffic a few per cent are on their way to another lane. They are copied next to each other, treated there, and
what comes out is put back; where there are more of them than places, everybody is to be treated.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int

from rearl_jax.core.order import own_places, pick, running_count

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
        return otherwise.at[own_places(self.who)].set(values, mode="drop")


def single_out(is_chosen: Bool[Array, "vehicles *scenarios"], one_in: int) -> Few:
    """The vehicles that are chosen.

    Args:
        is_chosen: Which.
        one_in: There are places for one vehicle in so many, and for what chance adds.
    """
    n_vehicles, others = is_chosen.shape[0], is_chosen.shape[1:]
    places = places_for(n_vehicles, one_in)

    before = running_count(is_chosen)
    suffices = jnp.all(before[-1] + is_chosen[-1].astype(jnp.int32) <= places)
    place = jnp.where(is_chosen, before, places)
    index = lax.broadcasted_iota(jnp.int32, is_chosen.shape, 0)
    nobody = jnp.full((places, *others), n_vehicles, jnp.int32)
    who = nobody.at[own_places(place)].set(index, mode="drop")
    return Few(who, suffices, n_vehicles)
