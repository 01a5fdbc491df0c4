"""Functions of one scenario that become one call for all scenarios under `jax.vmap`."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree


def in_lockstep(function: Callable[..., PyTree]) -> Callable[..., PyTree]:
    """A function of one scenario that `jax.vmap` turns into one call for all scenarios, with the scenario axis last.

    vmap alone would put the axis first, where the core's loops over vehicles run over strided memory, and would compute
    both branches of every condition for all scenarios.

    Args:
        function: Function of pytrees whose arrays have the scenario axis last, of length 1 for common values.
    """

    @jax.custom_batching.custom_vmap
    def single(*arguments: PyTree) -> PyTree:
        batch = jax.tree.map(lambda leaf: leaf[..., None], arguments)
        return jax.tree.map(lambda leaf: leaf[..., 0], function(*batch))

    @single.def_vmap
    def batched(axis_size: int, in_batched: list[PyTree], *arguments: PyTree) -> tuple[PyTree, PyTree]:
        def scenarios_last(leaf: Array, is_batched: bool) -> Array:
            if is_batched:
                return jnp.moveaxis(leaf, 0, -1)
            return jnp.broadcast_to(leaf[..., None], (*leaf.shape, axis_size))

        results = function(*jax.tree.map(scenarios_last, arguments, tuple(in_batched)))
        is_common = jax.tree.map(lambda leaf: leaf.shape[-1] != axis_size, results)
        results = jax.tree.map(
            lambda leaf, common: leaf[..., 0] if common else jnp.moveaxis(leaf, -1, 0), results, is_common
        )
        return results, jax.tree.map(lambda common: not common, is_common)

    return single
