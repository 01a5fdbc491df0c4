"""Arcsine and arctangent in float64, correctly rounded.

Every steering command of the lateral controller passes through both functions, and below 0.1 m/s the controller
amplifies one unit in the last place to 1e-9 m within a minute. XLA's arcsine is wrong in the last place for a quarter
of all arguments and its vectorised arctangent for almost half of them; the C library, which highway-env calls, for two
in a thousand. Therefore XLA's angle is corrected here: its sine is computed in double-double arithmetic and compared
with the argument. A number in this arithmetic is the unevaluated sum of two float64, the second of which holds the
rounding error of the first. That gives about 106 bits, rounded to 53 once at the end.

The error terms below are exact only if every operation is rounded separately. XLA may contract a product and a sum into
a fused multiply-add, or cancel a constant that is added and taken away again; `rounded` and optimisation barriers
forbid both.

Source of the arithmetic: Dekker, Numer. Math. 18 (1971) 224.
"""

import itertools
from fractions import Fraction

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

_DoubleDouble = tuple[Array, Array]
"""Leading part of a number and the rest, both float64."""

_SINE_SERIES = [*itertools.accumulate((Fraction(-1, (2 * k + 2) * (2 * k + 3)) for k in range(13)), Fraction.__mul__)]
"""Taylor coefficients of (sin(a) / a - 1) / a^2 in powers of a^2; 13 are enough up to `ARCTANGENT_RANGE`."""

_N_EXACT = 5
"""Leading terms of the series summed as double-double; rounding errors of the others are too small to matter."""

ARCTANGENT_RANGE = 3.0
"""Largest argument of `arctangent`; the cosine of larger angles would be too inexact."""


def rounded(product: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The product; in float64 a barrier prevents its fusion with a following sum.

    A fused multiply-add rounds once, highway-env rounds twice. This difference of one unit in the last place matters,
    because the lateral controller is unstable below 0.1 m/s and amplifies it to 1e-9 m within a minute.
    """
    return jnp.where(jnp.abs(product) < jnp.inf, product, jnp.nan) if product.dtype == jnp.float64 else product


def arcsine(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Arcsine [rad] of values of at most sin 45 degrees."""
    return _with_sine(jnp.arcsin(value), _exact(value))


def arctangent(value: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Arctangent [rad] of values of at most `ARCTANGENT_RANGE`: the arcsine of v / sqrt(1 + v^2)."""
    unit = lax.optimization_barrier(jnp.ones_like(value))
    cosine = _square_root(_add(unit, _product(value, value)))
    return _with_sine(jnp.arctan(value), _divide(_exact(value), cosine))


def _with_sine(near: Array, sine: _DoubleDouble) -> Array:
    """The angle [rad] of a sine, from an angle next to it: one Newton step.

    The step is smaller than two units in the last place: as good as a constant for derivatives.
    """
    square = _product(near, near)
    rest = jnp.full_like(near, float(_SINE_SERIES[-1]))
    for coefficient in reversed(_SINE_SERIES[_N_EXACT:-1]):
        rest = rest * square[0] + float(coefficient)
    factor = _exact(rest)
    for coefficient in reversed(_SINE_SERIES[:_N_EXACT]):
        high, low = _times(square, factor)
        # With a barrier, because XLA would cancel a constant that is added and subtracted again.
        leading = lax.optimization_barrier(jnp.full_like(high, float(coefficient)))
        factor = _add(leading, (high, low + float(coefficient - Fraction(float(coefficient)))))
    high, low = _times(_times(square, _exact(near)), factor)
    missing = ((sine[0] - near) - high) + (sine[1] - low)
    return near + lax.stop_gradient(missing / jnp.cos(near))


def _exact(value: Array) -> _DoubleDouble:
    """A float64 as double-double."""
    return value, jnp.zeros_like(value)


def _add(large: Array, small: _DoubleDouble) -> _DoubleDouble:
    """Sum of a float64 and a double-double, by Dekker's fast two-sum. The first is the larger one, or 1."""
    total = large + small[0]
    return total, (small[0] - (total - large)) + small[1]


def _product(a: Array, b: Array) -> _DoubleDouble:
    """Exact product of two float64, by Veltkamp's split into halves of 26 bits, whose products are exact."""
    split = 2.0**27 + 1
    a_high = rounded(split * a) - rounded(rounded(split * a) - a)
    b_high = rounded(split * b) - rounded(rounded(split * b) - b)
    a_low, b_low, product = a - a_high, b - b_high, rounded(a * b)
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _times(a: _DoubleDouble, b: _DoubleDouble) -> _DoubleDouble:
    """Product of two double-doubles."""
    product, lost = _product(a[0], b[0])
    return product, lost + (a[0] * b[1] + a[1] * b[0])


def _divide(a: _DoubleDouble, b: _DoubleDouble) -> _DoubleDouble:
    """Quotient of two double-doubles: that of the leading parts, corrected by its exact remainder."""
    quotient = a[0] / b[0]
    high, low = _product(quotient, b[0])
    return quotient, (((a[0] - high) - low) + (a[1] - quotient * b[1])) / b[0]


def _square_root(value: _DoubleDouble) -> _DoubleDouble:
    """Square root of a positive double-double: one Newton step from that of the leading part."""
    root = jnp.sqrt(value[0])
    high, low = _product(root, root)
    return root, (((value[0] - high) - low) + value[1]) / (2 * root)
