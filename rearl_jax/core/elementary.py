"""Elementary functions: vector code in float32, the reference's rounding in float64.

On a CPU, XLA calls the C library once per element for these functions: 1.6 ns for a sine and 8 ns for an arcsine, where
a whole vehicle may cost 30 ns per tick. In float32 they are short polynomials here, found by Chebyshev interpolation
when the module is loaded and good to about one unit in the last place. In float64, where agreement with highway-env
counts and speed does not, they are JAX's own functions.
"""

import itertools
from collections.abc import Callable
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

HALF_PI_HIGH = float(np.float32(np.pi / 2))
HALF_PI_LOW = np.pi / 2 - HALF_PI_HIGH

ARCSINE_RANGE = float(np.sqrt(0.5))
"""Largest argument of `arcsine`: the sine of 45 degrees, the steepest heading the lateral controller asks for."""


def _power_series(function: Callable[[np.ndarray], np.ndarray], upper: float, degree: int) -> list[float]:
    """Coefficients in rising powers of the polynomial that interpolates a function at the Chebyshev points of [0,
    upper].
    """
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=[0.0, upper])
    return fit.convert(kind=np.polynomial.Polynomial, domain=[-1, 1]).coef.tolist()


# As functions of the squared argument, so that odd and even symmetry is exact.
_SINE_OVER_ARGUMENT = _power_series(lambda s: np.sinc(np.sqrt(s) / np.pi), (np.pi / 4) ** 2 * 1.01, 4)
_COSINE = _power_series(lambda s: np.cos(np.sqrt(s)), (np.pi / 4) ** 2 * 1.01, 5)


# (arcsin(v) / v - 1) / v^2, what the arcsine adds to its argument: the Taylor series, and a short fit for float32.
_ARCSINE_SERIES = [
    *itertools.accumulate((Fraction((2 * k + 1) ** 2, (2 * k + 2) * (2 * k + 3)) for k in range(50)), Fraction.__mul__)
]
_ARCSINE_TAYLOR = [float(coefficient) for coefficient in _ARCSINE_SERIES]
_ARCSINE_FIT = _power_series(lambda s: np.polynomial.polynomial.polyval(s, _ARCSINE_TAYLOR), ARCSINE_RANGE**2, 8)

_N_EXACT = 12
"""Leading terms of the series summed in two parts; of the others, rounding errors are too small to matter."""


def _polynomial(coefficients: list[float], square: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Value by Horner's rule."""
    total = jnp.full_like(square, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * square + coefficient
    return total


def _reduce(angle: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Int[Array, "*n"]]:
    """The angle less the nearest multiple of a quarter turn, and that multiple."""
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
    """Arcsine [rad] of a value cut to +-ARCSINE_RANGE, within 0.6 units in the last place.

    In float64 it is rounded correctly, as the C library does but for two arguments in a thousand. XLA's own arcsine,
    2 arctan2(v, 1 + sqrt(1 - v^2)), misses the last place for every fourth, which the lateral controller amplifies
    below 0.1 m/s.
    """
    value = jnp.clip(value, -ARCSINE_RANGE, ARCSINE_RANGE)
    square = value * value
    if value.dtype != jnp.float64:
        return value + value * square * _polynomial(_ARCSINE_FIT, square)
    zero = jnp.zeros_like(value)
    exact_square = _product_in_two_parts(value, value)
    factor = _polynomial(_ARCSINE_TAYLOR[_N_EXACT:], square), zero
    for coefficient in reversed(_ARCSINE_SERIES[:_N_EXACT]):
        high, low = _times(exact_square, factor)
        # Behind a barrier, as XLA would cancel a constant that is added and taken away again.
        first = lax.optimization_barrier(jnp.full_like(value, float(coefficient)))
        total, lost = _sum_in_two_parts(first, high)
        factor = total, lost + (low + float(coefficient - Fraction(float(coefficient))))
    high, low = _times(_times(exact_square, (value, zero)), factor)
    total, lost = _sum_in_two_parts(value, high)
    return total + (lost + low)


def _sum_in_two_parts(a: Float[Array, "*n"], b: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """The rounded sum and what rounding lost, for |a| >= |b|. Source: Dekker, Numer. Math. 18 (1971) 224."""
    total = a + b
    return total, b - (total - a)


def _product_in_two_parts(
    a: Float[Array, "*n"], b: Float[Array, "*n"]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """The rounded product and what rounding lost. Source: Dekker, Numer. Math. 18 (1971) 224."""
    split = 2.0**27 + 1
    a_high = rounded(split * a) - rounded(rounded(split * a) - a)
    b_high = rounded(split * b) - rounded(rounded(split * b) - b)
    a_low, b_low, product = a - a_high, b - b_high, rounded(a * b)
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _times(
    a: tuple[Float[Array, "*n"], Float[Array, "*n"]], b: tuple[Float[Array, "*n"], Float[Array, "*n"]]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Product of two numbers in two parts each."""
    product, lost = _product_in_two_parts(a[0], b[0])
    return product, lost + (a[0] * b[1] + a[1] * b[0])


SMALLEST_BASE = 1e-30
"""Base below which `power` is zero in float32, so that the logarithm stays finite."""


def power(base: Float[Array, "*n"], exponent: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """base^exponent for base >= 0 and an exponent well above zero; in float32 as exp(exponent ln base)."""
    if base.dtype != jnp.float32:
        return jnp.power(base, exponent)
    return jnp.exp(exponent * jnp.log(jnp.maximum(base, SMALLEST_BASE)))


def rounded(product: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The product, in float64 kept from being fused with the sum it goes into.

    A fused multiply-add rounds once where highway-env rounds twice. One unit in the last place of a lateral position is
    enough to tell: the lateral controller is unstable below 0.1 m/s and amplifies it to 1e-9 m within a minute.
    """
    return jnp.where(jnp.abs(product) < jnp.inf, product, jnp.nan) if product.dtype == jnp.float64 else product
