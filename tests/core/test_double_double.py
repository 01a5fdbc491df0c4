"""Arcsine and arctangent against the exact value, taken from Python's C library with an exact correction."""

from fractions import Fraction

import jax
import numpy as np
import pytest

from rearl_jax.core.double_double import ARCTANGENT_RANGE, arcsine, arctangent
from tests.core.simulation import WIDTH

LIMITS = {arcsine: (1e-6, 0.1, 0.7071), arctangent: (1e-6, 0.1, 1.0, 2.0, ARCTANGENT_RANGE)}


def exact_error(function, value, result):
    """Error [units in the last place] of an angle, by Taylor series in fractions: sin(angle + e) = sin(angle) + ..."""
    angle = Fraction(float(result))
    sine = cosine = Fraction(0)
    term = Fraction(1)
    for n in range(40):
        part = term if n % 4 < 2 else -term
        if n % 2:
            sine += part
        else:
            cosine += part
        term = term * angle / (n + 1)
        term = Fraction(int(term * 2**300), 2**300)
    value = Fraction(float(value))
    excess = (value - sine) / cosine if function is arcsine else (value * cosine - sine) / (cosine + value * sine)
    return float(abs(excess) / Fraction(float(np.spacing(abs(result)))))


@pytest.mark.parametrize("shape", [(10, WIDTH), (4000,)], ids=["filled vectors", "flat"])
@pytest.mark.parametrize(
    ("function", "limit"), [(function, limit) for function, limits in LIMITS.items() for limit in limits]
)
def test_correctly_rounded(function, limit, shape):
    """Also where XLA turns its own arctangent into vector code, which misses the last place for every second value."""
    values = np.random.default_rng(0).uniform(-limit, limit, shape)
    results = np.asarray(jax.jit(function)(values))
    library = {arcsine: np.arcsin, arctangent: np.arctan}[function](values)
    np.testing.assert_allclose(results, library, rtol=1e-15)
    for value, result in zip(values.flat[:60], results.flat[:60], strict=True):
        assert exact_error(function, value, result) < 0.5001


@pytest.mark.parametrize(
    ("function", "slope"), [(arcsine, lambda v: (1 - v * v) ** -0.5), (arctangent, lambda v: 1 / (1 + v * v))]
)
def test_slopes(function, slope):
    steepness = jax.jit(jax.grad(function))
    for value in (-0.6, -0.1, 0.0, 1e-9, 0.3, 0.7):
        assert steepness(value) == pytest.approx(slope(value), rel=1e-13)


def test_arctangent_beyond_one():
    values = np.array([-ARCTANGENT_RANGE, -1.5, -1.0, 0.0, 1.0, 1.0 + 1e-15, 2.0, ARCTANGENT_RANGE])
    np.testing.assert_allclose(jax.jit(arctangent)(values), np.arctan(values), rtol=1e-15)
    assert jax.grad(arctangent)(2.0) == pytest.approx(1 / 5, rel=1e-13)
