"""Sets as bits of 32-bit numbers: membership, size, and the n-th member."""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int, UInt32

BITS = 32
"""Members of a set that fit into one number."""


def pack(members: Bool[Array, "bits *numbers"]) -> UInt32[Array, "*numbers"]:
    """Numbers whose bits are the first axis, at most BITS of them, the lowest bit first."""
    numbers = jnp.zeros(members.shape[1:], jnp.uint32)
    for bit in range(members.shape[0]):
        numbers = numbers | (members[bit].astype(jnp.uint32) << bit)
    return numbers


def count(numbers: UInt32[Array, "*numbers"]) -> Int[Array, "*numbers"]:
    """Number of bits set."""
    return lax.population_count(numbers).astype(jnp.int32)


def position(numbers: UInt32[Array, "*numbers"], rank: Int[Array, "*numbers"]) -> Int[Array, "*numbers"]:
    """Position of the set bit that has `rank` set bits below it, by halving the range it may be in."""
    lowest = jnp.zeros_like(rank)
    width = BITS // 2
    while width:
        n_low = count((numbers >> lowest.astype(jnp.uint32)) & jnp.uint32((1 << width) - 1))
        is_above = rank >= n_low
        rank = rank - jnp.where(is_above, n_low, 0)
        lowest = lowest + jnp.where(is_above, width, 0)
        width //= 2
    return lowest
