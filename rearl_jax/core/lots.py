"""Work for the few vehicles it concerns, a lot at a time.

Of all vehicles of all scenarios one in sixteen decides about its lane in a tick, and a handful touches somebody. They
are listed without looking at each of them: 32 vehicles make one number, of which a bit is a vehicle, and which vehicle
comes how far down the list follows from how many bits are set in the numbers before its own. Lots of fixed size are
taken from the list until it is done, so nothing depends on how many there are.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int, UInt32

from rearl_jax.core import bits

Work = TypeVar("Work")


class Lot(NamedTuple):
    """Some members of a list.

    Attributes:
        number: The number of each; that of the last of the list for places left empty.
        bit: Its bit of the number.
        is_there: Which places are not empty.
        n_numbers: How many numbers there are.
    """

    number: Int[Array, " lot"]
    bit: Int[Array, " lot"]
    is_there: Bool[Array, " lot"]
    n_numbers: int

    @property
    def place(self) -> Int[Array, " lot"]:
        """Where vehicles listed by `list_vehicles` are among those of all scenarios in a row."""
        return self.bit * self.n_numbers + self.number


class Listed(NamedTuple):
    """A list, as the bits of numbers.

    Attributes:
        numbers: The numbers.
        end: How many are listed up to and with each number.
    """

    numbers: UInt32[Array, " numbers"]
    end: Int[Array, " numbers"]

    @property
    def count(self) -> Int[Array, ""]:
        """How many are listed."""
        return self.end[-1]

    def lot(self, first: Int[Array, ""] | int, size: int) -> Lot:
        """So many of the list from one of them on."""
        wanted = first + lax.iota(jnp.int32, size)
        rank = jnp.minimum(wanted, self.count - 1)
        # How many numbers end before: counted where they end, and summed up along the lot.
        ended = jnp.zeros(size, jnp.int32).at[jnp.maximum(self.end - first, 0)].add(1, mode="drop")
        number = jnp.minimum(jnp.cumsum(ended), len(self.end) - 1)
        members = self.numbers[number]
        bit = bits.position(members, rank - (self.end[number] - bits.count(members)))
        return Lot(number, bit, wanted < self.count, len(self.end))


def list_bits(numbers: UInt32[Array, " numbers"]) -> Listed:
    """The list of all bits that are set."""
    return Listed(numbers, jnp.cumsum(bits.count(numbers)))


def list_vehicles(is_listed: Bool[Array, "vehicles *scenarios"]) -> Listed:
    """The list of the vehicles chosen; their `Lot.place` says which they are."""
    in_a_row = is_listed.ravel()
    return list_bits(bits.pack(jnp.pad(in_a_row, (0, -in_a_row.size % bits.BITS)).reshape(bits.BITS, -1)))


def in_lots(listed: Listed, size: int, treat: Callable[[Lot, Work], Work], work: Work) -> Work:
    """What comes out after all that is listed has been treated, so many at a time."""

    def is_unfinished(progress: tuple[Array, Work]) -> Array:
        return progress[0] < listed.count

    def treat_next(progress: tuple[Array, Work]) -> tuple[Array, Work]:
        first, work = progress
        return first + size, treat(listed.lot(first, size), work)

    return lax.while_loop(is_unfinished, treat_next, (jnp.int32(0), work))[1]


def take(values: Array, place: Int[Array, "*lot"], shape: tuple[int, ...]) -> Array:
    """A lot's own of all vehicles' values; what is one for all stays so.

    Args:
        values: Of all vehicles and scenarios; axes may have length 1.
        place: Of the lot.
        shape: Of arrays in which no axis is one for all.
    """
    if values.size == 1:
        return values.reshape((1,) * place.ndim)
    return jnp.broadcast_to(values, shape).ravel().at[place].get(mode="promise_in_bounds")


def put(values: Array, place: Int[Array, " lot"], is_there: Bool[Array, " lot"], otherwise: Array) -> Array:
    """A lot's values among those of all vehicles.

    Args:
        values: Of the lot.
        place: Of the lot.
        is_there: Which of its places are not empty.
        otherwise: Of all vehicles.
    """
    in_a_row = otherwise.ravel()
    # Each empty place has one of its own beyond the end, so that no two are the same.
    place = jnp.where(is_there, place, in_a_row.size + lax.iota(jnp.int32, place.size))
    return in_a_row.at[place].set(values, mode="drop", unique_indices=True).reshape(otherwise.shape)
