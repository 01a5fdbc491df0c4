"""Elementary functions: vector code in float32, the reference's rounding in float64.

On a CPU, XLA calls the C library once per element for these functions: 1.6 ns for a sine and 8 ns for an arcsine, where
a whole vehicle may cost 30 ns per tick. In float32 they are short polynomials here, found by Chebyshev interpolation
when the module is loaded and good to about one unit in the last place. In float64, where agreement with highway-env
counts and speed does not, they are the C library's, which is what NumPy calls too.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.experimental.buffer_callback import buffer_callback
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
_ARCSINE_TAYLOR = [
    *itertools.accumulate(((2 * k + 1) ** 2 / ((2 * k + 2) * (2 * k + 3)) for k in range(50)), float.__mul__)
]
_ARCSINE_FIT = _power_series(lambda s: np.polynomial.polynomial.polyval(s, _ARCSINE_TAYLOR), ARCSINE_RANGE**2, 8)


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
    """Arcsine [rad] of a value cut to +-ARCSINE_RANGE.

    In float32 within 0.6 units in the last place; in float64 rounded as the C library rounds it where it runs on a CPU.
    The last place matters: the lateral controller, unstable below 0.7 m/s, makes centimetres of it within a minute.
    """
    value = jnp.clip(value, -ARCSINE_RANGE, ARCSINE_RANGE)
    if value.dtype == jnp.float64:
        return _ARCSINE(value)
    square = value * value
    return value + value * square * _polynomial(_ARCSINE_FIT, square)


def arctangent(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Arctangent [rad], float64 only, rounded as the C library rounds it where it runs on a CPU.

    XLA's own is wrong by up to 2 rad in jaxlib 0.10.2 where vectors have 512 bits (issue 39352 of jax-ml/jax).
    """
    return _ARCTANGENT(value)


def _of_c_library(function: Callable[[float], float], otherwise: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """A function of float64 arrays that asks the C library for every element; on other platforms XLA's `otherwise`.

    XLA takes most functions from the C library itself, but not the arcsine, of which its own misses the last place for
    every fourth argument. No other algorithm reproduces it either: the C library's is not always the nearest number.
    """
    each = np.frompyfunc(function, 1, 1)

    def fill(_: object, result: Any, values: Any) -> None:
        np.asarray(result)[...] = each(np.asarray(values))

    def on_cpu(values: Array) -> Array:
        # It works on the buffers themselves. `jax.pure_callback` copies them first and then waits for a free thread.
        call = buffer_callback(fill, jax.ShapeDtypeStruct(values.shape, values.dtype), vmap_method="expand_dims")
        return cast(Array, call(values))

    return lambda values: lax.platform_dependent(values, cpu=on_cpu, default=otherwise)


_ARCSINE = jax.custom_jvp(_of_c_library(math.asin, jnp.arcsin))
_ARCSINE.defjvps(lambda change, _, value: change / jnp.sqrt(1 - value * value))
_ARCTANGENT = jax.custom_jvp(_of_c_library(math.atan, jnp.arctan))
_ARCTANGENT.defjvps(lambda change, _, value: change / (1 + value * value))


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


def sum_of_products(
    a: Float[Array, "*n"], b: Float[Array, "*n"], c: Float[Array, "*n"], d: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """a b + c d; in float64 rounded as a dot product of BLAS: the first product, then its sum with the second."""
    return rounded(a * b) + c * d
