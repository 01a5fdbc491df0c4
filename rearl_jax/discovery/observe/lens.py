"""Distortion of measured positions by the camera: a smooth function of the true position.

A distortion must be smooth, because a kink would look like a jerk of every vehicle that passes; cubic B-splines are
smooth enough.

Source: de Boor, A Practical Guide to Splines (1978), chapter IX.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class Lens(eqx.Module):
    """A distortion as the values of a cubic B-spline at its knots.

    Attributes:
        values: Displacements at the knots [m].
        knots: Equidistant positions [m].
    """

    values: Float[Array, "knots *#n"]
    knots: Float[Array, " knots"]

    def weights(self, x: Float[Array, "*n"]) -> Float[Array, "knots *n"]:
        """Weight of each knot's value at a position [-]."""
        u = jnp.abs(self._from_knots(x))
        return jnp.where(u < 1, 2 / 3 - u**2 + u**3 / 2, jnp.maximum(2 - u, 0.0) ** 3 / 6)

    def bend(self, x: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Measured minus true position [m]."""
        return jnp.sum(self.values * self.weights(x), axis=0)

    def slope(self, x: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Derivative of the distortion by position [-]."""
        signed = self._from_knots(x)
        u = jnp.abs(signed)
        slope = jnp.where(u < 1, -2 * u + 1.5 * u**2, -(jnp.maximum(2 - u, 0.0) ** 2) / 2)
        return jnp.sum(self.values * slope * jnp.sign(signed), axis=0) / (self.knots[1] - self.knots[0])

    def _from_knots(self, x: Array) -> Array:
        """Signed distance of positions from each knot, in distances between knots [-]."""
        knots = self.knots.reshape(-1, *(1,) * x.ndim)
        return (x[None] - knots) / (self.knots[1] - self.knots[0])
