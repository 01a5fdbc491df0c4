"""Huber's loss: beyond OUTLYING standard deviations an error counts linearly, so that no single time step decides.

Source: Huber, Ann. Math. Stat. 35 (1964) 73.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

OUTLYING = 4.0
"""Standard deviations beyond which an innovation is an outlier; Gaussian noise hardly ever exceeds them."""


def kept_share(error: Float[Array, "*n"], deviation: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """Weight of an error with this standard deviation in a least-squares step [-]: 1, and less for an outlier."""
    size, bound = jnp.abs(error), OUTLYING * deviation
    return jnp.where(size <= bound, 1.0, bound / jnp.maximum(size, 1e-12))


def robust_square(error: Float[Array, "*n"], deviation: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """The square of an error with this standard deviation, growing linearly for an outlier."""
    size, bound = jnp.abs(error), OUTLYING * deviation
    return jnp.where(size <= bound, error * error, bound * (2 * size - bound))
