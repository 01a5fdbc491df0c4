"""Stream compaction: operations on few vehicles or scenarios run on a dense copy of their values.

Arrays in JAX have fixed shapes. Four functions restrict an operation to the elements that need it, with the same result
as the operation on all elements:

- `if_any`: skip the computation if no vehicle needs it;
- `apply_where`: copy the scenarios concerned into a small batch, process them and copy them back, until none is left;
- `process_in_blocks`: list the vehicles concerned and process blocks of fixed size until the list is finished;
- `compact`: copy a few vehicles of every scenario next to each other, up to a fixed number.

In a time step one vehicle in sixteen decides about its lane, a few per cent are changing lanes, and a handful touch
another vehicle. Two lane changes conflict in a handful of a thousand scenarios.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Int, UInt32

from rearl_jax.core import bits
from rearl_jax.core.order import flat_index, take_flat, take_vehicles

Operands = TypeVar("Operands")
Result = TypeVar("Result")
Value = TypeVar("Value")
Work = TypeVar("Work")

SCENARIOS_AT_ONCE = 32
"""Number of scenarios that `apply_where` treats at a time."""

VEHICLES_PER_LANE_CHANGER = 16
"""A subset of lane-changing vehicles has room for one of this many vehicles, plus a margin for random variation."""


def if_any(is_needed: Bool[Array, "*n"], compute: Callable[[], Value], otherwise: Value) -> Value:
    """`compute()` if any vehicle in the batch needs it, else `otherwise`.

    A large batch seldom skips the branch. The branch is still useful, because it is compiled separately and computed
    once, whereas XLA on a CPU would fuse the computation into each of its uses and repeat it.
    """
    return lax.cond(jnp.any(is_needed), compute, lambda: otherwise)


def apply_where(
    is_affected: Bool[Array, "*scenarios"],
    function: Callable[[Operands], Result],
    operands: Operands,
    otherwise: Result,
) -> Result:
    """`function(operands)` for the scenarios affected, `otherwise` for all others.

    Args:
        is_affected: Scenarios to treat.
        function: From arrays `[vehicles, *scenarios]` to such arrays, without mixing scenarios.
        operands: Argument of the function; leaves may have a scenario axis of length 1.
        otherwise: Result of the scenarios not affected.
    """
    if is_affected.ndim == 0:
        return lax.cond(is_affected, function, lambda _: otherwise, operands)
    n_scenarios = is_affected.shape[0]
    size = min(SCENARIOS_AT_ONCE, n_scenarios)

    def has_remaining(progress: tuple[Array, Result]) -> Array:
        return jnp.any(progress[0])

    def treat_next(progress: tuple[Array, Result]) -> tuple[Array, Result]:
        remaining, result = progress
        (columns,) = jnp.nonzero(remaining, size=size, fill_value=n_scenarios)

        def gathered(values: Array | np.ndarray) -> Array | np.ndarray:
            return values if values.shape[-1] == 1 else take_columns(values, columns)

        treated = function(jax.tree.map(gathered, operands))
        result = jax.tree.map(
            lambda new, old: old.at[..., columns].set(new, mode="drop", unique_indices=False), treated, result
        )
        return remaining.at[columns].set(False, mode="drop"), result

    return lax.while_loop(has_remaining, treat_next, (is_affected, otherwise))[1]


class Block(eqx.Module):
    """A block of members of a list of set bits.

    Attributes:
        word: Index of the word that contains each bit; in empty places the last word.
        bit: Position of the bit within its word.
        is_filled: Whether a place contains a member.
        n_words: Number of words.
    """

    word: Int[Array, " block"]
    bit: Int[Array, " block"]
    is_filled: Bool[Array, " block"]
    n_words: int = eqx.field(static=True)

    @property
    def index(self) -> Int[Array, " block"]:
        """Flat index, among all vehicles of all scenarios, of members listed by `list_vehicles`."""
        return self.bit * self.n_words + self.word


class SetBits(NamedTuple):
    """The set bits of 32-bit words as a list that is never stored.

    The k-th set bit is found by its rank: prefix sums of the population counts give the word that contains it, and
    bisection finds its position there. So listing costs one pass over 1/32 as many words as there are vehicles.

    Attributes:
        words: The words.
        end: Number of set bits up to and including each word.
    """

    words: UInt32[Array, " words"]
    end: Int[Array, " words"]

    @property
    def count(self) -> Int[Array, ""]:
        """Length of the list."""
        return self.end[-1]

    def block(self, first: Int[Array, ""] | int, size: int) -> Block:
        """The next `size` members of the list, from the one with index `first`."""
        wanted = first + lax.iota(jnp.int32, size)
        rank = jnp.minimum(wanted, self.count - 1)
        # The index of a member's word is the number of words that end at or before its rank: ends are counted by rank
        # and summed along the block.
        n_ends = jnp.zeros(size, jnp.int32).at[jnp.maximum(self.end - first, 0)].add(1, mode="drop")
        word = jnp.minimum(jnp.cumsum(n_ends), len(self.end) - 1)
        members = self.words[word]
        bit = bits.position(members, rank - (self.end[word] - bits.count(members)))
        return Block(word, bit, wanted < self.count, len(self.end))


def list_bits(words: UInt32[Array, " words"]) -> SetBits:
    """The list of all set bits."""
    return SetBits(words, jnp.cumsum(bits.count(words)))


def list_vehicles(is_listed: Bool[Array, "vehicles *scenarios"]) -> SetBits:
    """The list of the vehicles chosen; `Block.index` is their flat index."""
    flat = is_listed.ravel()
    return list_bits(bits.pack(jnp.pad(flat, (0, -flat.size % bits.BITS_PER_WORD)).reshape(bits.BITS_PER_WORD, -1)))


def process_in_blocks(members: SetBits, size: int, process: Callable[[Block, Work], Work], work: Work) -> Work:
    """The result after all blocks of a list have been processed in turn, starting from `work`.

    Args:
        members: The list.
        size: Number of members of a block.
        process: Function from a block and the result so far to the result after it.
        work: Result before the first block.
    """

    def is_unfinished(progress: tuple[Array, Block, Work]) -> Array:
        return progress[0] < members.count

    def process_next(progress: tuple[Array, Block, Work]) -> tuple[Array, Block, Work]:
        first, block, work = progress
        return first + size, members.block(first + size, size), process(block, work)

    # The block is part of the progress, so that it is stored: XLA would otherwise find its members again for every
    # value that is gathered.
    return lax.while_loop(is_unfinished, process_next, (jnp.int32(0), members.block(0, size), work))[2]


def take_columns(values: Array | np.ndarray, columns: Int[Array, " some"]) -> Array:
    """Values at some indices of the last axis, such as scenarios; indices outside take the first or the last value.

    Taken by flat index, because XLA on a CPU needs twice the time along an axis.
    """
    *axes, n_scenarios = values.shape
    rows = lax.iota(jnp.int32, math.prod(axes))[:, None] * n_scenarios
    index = rows + jnp.clip(columns.astype(jnp.int32), 0, n_scenarios - 1)[None]
    return take_flat(values, index).reshape(*axes, len(columns))


def gather(values: Array, index: Int[Array, "*block"], shape: tuple[int, ...]) -> Array:
    """Values at flat indices; a single value for all vehicles is unchanged.

    Args:
        values: Values of all vehicles and scenarios; axes may have length 1.
        index: Flat indices.
        shape: `(n_vehicles, *n_scenarios)` of values whose axes all have full length.
    """
    if values.size == 1:
        return values.reshape((1,) * index.ndim)
    return take_flat(jnp.broadcast_to(values, shape), index)


def scatter(values: Array, index: Int[Array, " block"], is_filled: Bool[Array, " block"], otherwise: Array) -> Array:
    """All vehicles' values with those of a block written in.

    Args:
        values: Values of the block.
        index: Flat indices of the block.
        is_filled: Mask of its places that are not empty.
        otherwise: Values of all vehicles.
    """
    flat = otherwise.ravel()
    # Each empty place has its own index beyond the end, so that all indices differ.
    index = jnp.where(is_filled, index, flat.size + lax.iota(jnp.int32, index.size))
    return flat.at[index].set(values, mode="drop", unique_indices=True).reshape(otherwise.shape)


class Subset(eqx.Module):
    """A few vehicles of each scenario, in the order of the list.

    Attributes:
        vehicle: Index of each vehicle in its scenario; `n_vehicles` in empty places.
        suffices: Whether there is room for every vehicle chosen, in all scenarios.
        n_vehicles: Number of vehicles that the subset is chosen from.
    """

    vehicle: Int[Array, "places *scenarios"]
    suffices: Bool[Array, ""]
    n_vehicles: int = eqx.field(static=True)

    @property
    def index(self) -> Int[Array, "places *scenarios"]:
        """Index of each vehicle; in empty places that of the last vehicle."""
        return jnp.minimum(self.vehicle, self.n_vehicles - 1)

    @property
    def is_filled(self) -> Bool[Array, "places *scenarios"]:
        """True if a place is not empty."""
        return self.vehicle < self.n_vehicles

    def gather(self, values: Array) -> Array:
        """Values of the subset, from those of all vehicles; a single value for all vehicles is unchanged."""
        return take_vehicles(values, self.index)

    def scatter(self, values: Array, otherwise: Array) -> Array:
        """All vehicles' values with those of the subset written in."""
        index, is_filled = flat_index(self.vehicle), self.is_filled
        return scatter(values.ravel(), index.ravel(), is_filled.ravel(), otherwise)


def room_for(n_vehicles: int, vehicles_per_place: int) -> int:
    """Number of places of a subset: one for every `vehicles_per_place` vehicles, plus a margin for random variation."""
    return n_vehicles // vehicles_per_place + math.isqrt(n_vehicles) + 2


def compact(is_chosen: Bool[Array, "vehicles *scenarios"], vehicles_per_place: int) -> Subset:
    """The vehicles that are chosen, next to each other.

    Args:
        is_chosen: True for the chosen vehicles.
        vehicles_per_place: There is room for one of this many vehicles, plus a margin for random variation.
    """
    n_vehicles, scenario_axes = is_chosen.shape[0], is_chosen.shape[1:]
    places, n_words = room_for(n_vehicles, vehicles_per_place), -(-n_vehicles // bits.BITS_PER_WORD)
    filled = jnp.pad(is_chosen, [(0, n_words * bits.BITS_PER_WORD - n_vehicles)] + [(0, 0)] * len(scenario_axes))
    words = bits.pack(filled.reshape(n_words, bits.BITS_PER_WORD, *scenario_axes).swapaxes(0, 1))
    counts = bits.count(words)
    rank = lax.iota(jnp.int32, places).reshape(places, *(1,) * len(scenario_axes))
    rank = jnp.broadcast_to(rank, (places, *scenario_axes))

    def locate(word: Array, located: tuple[Array, ...]) -> tuple[Array, ...]:
        """For every place: the word that contains its rank, the word's first vehicle, and the rank within the word."""
        begin, members, first, rank_in_word = located
        n_bits = counts[word][None]
        is_in = (rank >= begin) & (rank < begin + n_bits)
        new = words[word][None], word * bits.BITS_PER_WORD, rank - begin
        old = members, first, rank_in_word
        return begin + n_bits, *(jnp.where(is_in, a, b) for a, b in zip(new, old, strict=True))

    zeros = jnp.zeros_like(rank)
    start = jnp.zeros((1, *scenario_axes), jnp.int32), zeros.astype(jnp.uint32), zeros, zeros
    total, members, first, rank_in_word = lax.fori_loop(0, n_words, locate, start, unroll=min(n_words, 8))
    vehicle = jnp.where(rank < total, first + bits.position(members, rank_in_word), n_vehicles)
    return Subset(vehicle, jnp.all(total <= places), n_vehicles)
