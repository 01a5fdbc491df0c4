"""Curves over a variable, which the screen (a score test) tests for effects whose position or functional form is not
known yet.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.dependence import VARIABLES, hat_weights
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus


class _Curve(Effect):
    """A curve over a variable, less its mean over the data, which the driver's own parameters take up. `values` are at
    the `knots`; `centre` are the mean weights of the knots in the data [-].
    """

    values: Float[Array, "knots *#n"]
    knots: Float[Array, " knots"]
    centre: Float[Array, " knots"]
    variable: str = eqx.field(static=True)

    def at(self, seen: Stimulus) -> Array:
        """The curve less its mean."""
        weights = hat_weights(VARIABLES[self.variable][1](seen), self.knots)
        return jnp.sum(self.values * (weights - self.centre.reshape(-1, *(1,) * (weights.ndim - 1))), axis=0)


class DesiredSpeedCurve(_Curve):
    """Desired speed as a curve over position or time; the screen uses it for speed limits and weather."""

    name: ClassVar[str] = "desired_speed_curve"

    def desired_speed(self, value: Array, seen: Stimulus, memory: None) -> Array:
        """Desired speed times exp(curve) [m/s]."""
        return value * jnp.exp(self.at(seen))


class TimeGapCurve(_Curve):
    """Time gap as a curve over a variable."""

    name: ClassVar[str] = "time_gap_curve"

    def time_gap(self, value: Array, seen: Stimulus, memory: None) -> Array:
        """Time gap times exp(curve) [s]."""
        return value * jnp.exp(self.at(seen))


class CentredCurve(_Curve):
    """Acceleration as a curve over a variable."""

    name: ClassVar[str] = "centred_curve"

    def acceleration(self, value: Array, seen: Stimulus, memory: None) -> Array:
        """Acceleration plus the curve [m/s^2]."""
        return value + self.at(seen)
