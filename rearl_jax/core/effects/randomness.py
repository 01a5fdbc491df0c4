"""Random numbers of effects, from a seed per scenario, a stream per purpose and a count of time steps."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Key


def no_seed() -> Int[Array, ""]:
    """The default seed of effects: the same numbers in every scenario."""
    return jnp.zeros((), jnp.int32)


def standard_normal(
    seed: Int[Array, "*#seeds"], stream: int, count: Int[Array, ""], like: Float[Array, "vehicles *scenarios"]
) -> Float[Array, "vehicles *scenarios"]:
    """Independent standard normal numbers, one per vehicle.

    A vehicle's number depends on its scenario's seed, its own index, stream and count, not on the other simulated
    vehicles.

    Args:
        seed: One per scenario, or one for all.
        stream: Separates numbers for different purposes.
        count: Separates numbers of different time steps.
        like: An array of the wanted shape and type.
    """
    return _drawn(seed, stream, count, like, jax.random.normal)


def standard_uniform(
    seed: Int[Array, "*#seeds"], stream: int, count: Int[Array, ""], like: Float[Array, "vehicles *scenarios"]
) -> Float[Array, "vehicles *scenarios"]:
    """Independent numbers from [0, 1), one per vehicle; arguments as in `standard_normal`."""
    return _drawn(seed, stream, count, like, jax.random.uniform)


def _drawn(seed: Array, stream: int, count: Array, like: Array, draw: Callable[..., Array]) -> Array:
    n_vehicles, scenarios = like.shape[0], like.shape[1:]

    def of_scenario(seed: Int[Array, ""]) -> Float[Array, " vehicles"]:
        key: Key[Array, ""] = jax.random.fold_in(jax.random.fold_in(jax.random.key(seed), stream), count)
        return draw(key, (n_vehicles,), like.dtype)

    if not scenarios:
        return of_scenario(seed.reshape(()))
    return jax.vmap(of_scenario, out_axes=-1)(jnp.broadcast_to(seed.reshape(-1), scenarios))
