"""Elementary functions: fast vector code in float32, the rounding of highway-env in float64.

On a CPU, XLA calls the C library once per element for these functions: 1.6 ns for a sine and 8 ns for an arcsine, where
a whole vehicle may cost 30 ns per time step. In float32 they are short polynomials here, found by Chebyshev
interpolation when the module is loaded and good to about one unit in the last place. In float64, agreement with
highway-env matters more than speed, so JAX's functions are used where they are as exact as the C library's, and
double-double arithmetic (`rearl_jax.core.double_double`) otherwise.
"""

import itertools
from collections.abc import Callable
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from rearl_jax.core import double_double

HALF_PI_HIGH = float(np.float32(np.pi / 2))
HALF_PI_LOW = np.pi / 2 - HALF_PI_HIGH
"""pi / 2 as the sum of a float32 and the rest, so that the reduction of an angle loses no digits."""

ARCSINE_RANGE = float(np.sqrt(0.5))
"""Largest argument of `arcsine`: the sine of 45 degrees, the largest heading commanded by the lateral controller."""


def _power_series(function: Callable[[np.ndarray], np.ndarray], upper: float, degree: int) -> list[float]:
    """Coefficients in rising powers of the polynomial that interpolates a function at the Chebyshev points of [0,
    upper].
    """
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=[0.0, upper])
    return fit.convert(kind=np.polynomial.Polynomial, domain=[-1, 1]).coef.tolist()


# Functions of the squared argument, so that odd and even symmetry is exact.
_SINE_OVER_ARGUMENT = _power_series(lambda s: np.sinc(np.sqrt(s) / np.pi), (np.pi / 4) ** 2 * 1.01, 4)
_COSINE = _power_series(lambda s: np.cos(np.sqrt(s)), (np.pi / 4) ** 2 * 1.01, 5)


_ARCSINE_SERIES = [
    *itertools.accumulate((Fraction((2 * k + 1) ** 2, (2 * k + 2) * (2 * k + 3)) for k in range(50)), Fraction.__mul__)
]
"""Taylor coefficients of (arcsin(v) / v - 1) / v^2 in powers of v^2; 50 are enough up to `ARCSINE_RANGE`."""

_ARCSINE_EXCESS = _power_series(
    lambda s: np.polynomial.polynomial.polyval(s, [float(c) for c in _ARCSINE_SERIES]), ARCSINE_RANGE**2, 8
)
"""The relative difference of the arcsine from its argument v, divided by v^2."""


def _polynomial(coefficients: list[float], square: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Value of a polynomial by Horner's rule."""
    total = jnp.full_like(square, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * square + coefficient
    return total


def _reduce(angle: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Int[Array, "*n"]]:
    """The angle minus the nearest multiple of a quarter turn, and that multiple."""
    quarter = jnp.round(angle * (2 / np.pi))
    return (angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_LOW, quarter.astype(jnp.int32)


def _sine_of_quarters(angle: Float[Array, "*n"], shift: int) -> Float[Array, "*n"]:
    """sin(angle + shift * pi / 2)."""
    rest, quarter = _reduce(angle)
    square = rest * rest
    quarter = quarter + shift
    sine_part = rest * _polynomial(_SINE_OVER_ARGUMENT, square)
    value = jnp.where((quarter & 1) == 1, _polynomial(_COSINE, square), sine_part)
    return jnp.where((quarter & 2) == 2, -value, value)


def sine(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Sine; in float32 within 1.2e-7 for angles up to 1000 rad."""
    return _sine_of_quarters(angle, 0) if angle.dtype == jnp.float32 else jnp.sin(angle)


def cosine(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Cosine; in float32 within 1.2e-7 for angles up to 1000 rad."""
    return _sine_of_quarters(angle, 1) if angle.dtype == jnp.float32 else jnp.cos(angle)


def arcsine(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Arcsine [rad] of a value clipped to +-ARCSINE_RANGE; in float32 within 1e-7, in float64 correctly rounded."""
    value = jnp.clip(value, -ARCSINE_RANGE, ARCSINE_RANGE)
    if value.dtype == jnp.float64:
        return double_double.arcsine(value)
    square = value * value
    return value + value * square * _polynomial(_ARCSINE_EXCESS, square)


SMALLEST_BASE = 1e-30
"""Lower bound of the base of `power` in float32, where the power is practically 0; it keeps the logarithm finite."""


def power(base: Float[Array, "*n"], exponent: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """base^exponent for base >= 0 and an exponent well above zero; in float32 as exp(exponent ln base)."""
    if base.dtype != jnp.float32:
        return jnp.power(base, exponent)
    return jnp.exp(exponent * jnp.log(jnp.maximum(base, SMALLEST_BASE)))


def not_zero(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The value, moved away from zero to +-0.01 with its sign (zero counts as positive).

    Source: highway-env 1.12.1, `utils.not_zero`.
    """
    return jnp.where(jnp.abs(value) > 0.01, value, jnp.where(value >= 0, 0.01, -0.01))
