"""Sets as bits of 32-bit words: membership, size, and the n-th member."""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int, UInt32

BITS_PER_WORD = 32
"""Number of bits of a word."""


def pack(members: Bool[Array, "bits *words"]) -> UInt32[Array, "*words"]:
    """Words whose bits are the first axis, at most BITS_PER_WORD of them, the lowest bit first."""
    words = jnp.zeros(members.shape[1:], jnp.uint32)
    for bit in range(members.shape[0]):
        words = words | (members[bit].astype(jnp.uint32) << bit)
    return words


def count(words: UInt32[Array, "*words"]) -> Int[Array, "*words"]:
    """Number of bits set."""
    return lax.population_count(words).astype(jnp.int32)


def position(words: UInt32[Array, "*words"], rank: Int[Array, "*words"]) -> Int[Array, "*words"]:
    """Position of the set bit that has `rank` set bits below it, by halving the range it may be in."""
    lowest = jnp.zeros_like(rank)
    width = BITS_PER_WORD // 2
    while width:
        n_low = count((words >> lowest.astype(jnp.uint32)) & jnp.uint32((1 << width) - 1))
        is_above = rank >= n_low
        rank = rank - jnp.where(is_above, n_low, 0)
        lowest = lowest + jnp.where(is_above, width, 0)
        width //= 2
    return lowest
