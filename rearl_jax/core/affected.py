"""Work done only where it is needed: skipped where nobody does, or done on the few scenarios it concerns.

A conflict between two lane changes concerns a handful of a thousand scenarios per tick. They are copied
into a small batch, treated there in full, and copied back; repeated until none is left, so the result does not depend
on how many there were.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool

Operands = TypeVar("Operands")
Result = TypeVar("Result")

Value = TypeVar("Value")


def if_any(is_needed: Bool[Array, "*n"], compute: Callable[[], Value], otherwise: Value) -> Value:
    """`compute()` where anybody in the batch needs it, else `otherwise`.

    A large batch seldom skips anything. But what is behind a branch is compiled as a program of its own and computed
    once, where XLA on a CPU would weave it into each of its uses and compute it there again.
    """
    return lax.cond(jnp.any(is_needed), compute, lambda: otherwise)


BATCH = 32
"""Scenarios treated at a time."""


def on_affected(
    is_affected: Bool[Array, "*scenarios"],
    function: Callable[[Operands], Result],
    operands: Operands,
    otherwise: Result,
) -> Result:
    """`function(operands)` for the scenarios affected, `otherwise` for all others.

    Args:
        is_affected: Scenarios to treat.
        function: From arrays `[n_vehicles, *n_scenarios]` to such arrays, without mixing scenarios.
        operands: Its argument; leaves may have a scenario axis of length 1.
        otherwise: Result of the scenarios not affected.
    """
    if is_affected.ndim == 0:
        return lax.cond(is_affected, function, lambda _: otherwise, operands)
    n_scenarios = is_affected.shape[0]
    size = min(BATCH, n_scenarios)

    def some_left(work: tuple[Array, Result]) -> Array:
        return jnp.any(work[0])

    def treat_some(work: tuple[Array, Result]) -> tuple[Array, Result]:
        left, result = work
        (columns,) = jnp.nonzero(left, size=size, fill_value=n_scenarios)

        def take(values: Array) -> Array:
            return values if values.shape[-1] == 1 else jnp.take(values, columns, axis=-1, mode="clip")

        treated = function(jax.tree.map(take, operands))
        result = jax.tree.map(
            lambda new, old: old.at[..., columns].set(new, mode="drop", unique_indices=False), treated, result
        )
        return left.at[columns].set(False, mode="drop"), result

    return lax.while_loop(some_left, treat_some, (is_affected, otherwise))[1]
