"""Elementary functions against NumPy in float64, with error bounds."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.double_double import rounded
from rearl_jax.core.elementary import ARCSINE_RANGE, arcsine, cosine, power, sine

TYPES = (np.float32, np.float64)


def samples(low, high, dtype, n=200_001):
    return np.concatenate([np.linspace(low, high, n), np.random.default_rng(0).uniform(low, high, n)]).astype(dtype)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize(("function", "exact"), [(sine, np.sin), (cosine, np.cos)])
@pytest.mark.parametrize("largest", [np.pi / 4, 10.0, 1000.0])
def test_sine_and_cosine(function, exact, largest, dtype):
    """Within 1.2e-7 in float32 up to 1000 rad; in float64 within 2.5e-16."""
    angle = samples(-largest, largest, dtype)
    value = np.asarray(jax.jit(function)(jnp.asarray(angle)))
    assert value.dtype == dtype
    error = abs(value.astype(float) - exact(angle.astype(float))).max()
    assert error < (1.2e-7 if dtype == np.float32 else 2.5e-16)


@pytest.mark.parametrize("dtype", TYPES)
def test_sine_is_odd_and_cosine_even(dtype):
    angle = jnp.asarray(samples(0.0, 40.0, dtype, 5000))
    np.testing.assert_array_equal(sine(-angle), -sine(angle))
    np.testing.assert_array_equal(cosine(-angle), cosine(angle))
    assert sine(jnp.zeros((), dtype)) == 0
    assert cosine(jnp.zeros((), dtype)) == 1


@pytest.mark.parametrize("dtype", TYPES)
def test_arcsine(dtype):
    """Within 0.65 units in the last place; in float64 nearly always the C library's number."""
    value = samples(-ARCSINE_RANGE, ARCSINE_RANGE, dtype)
    value = np.clip(value, dtype(-ARCSINE_RANGE), dtype(ARCSINE_RANGE))
    result = np.asarray(jax.jit(arcsine)(jnp.asarray(value)))
    assert result.dtype == dtype
    exact = np.arcsin(value.astype(np.longdouble))
    assert (abs(result - exact) / np.spacing(abs(result))).max() < 0.65
    if dtype == np.float64:
        some = slice(None, None, 20)
        c_library = np.array([math.asin(v) for v in value[some]])
        assert (result[some] != c_library).mean() < 0.02


@pytest.mark.parametrize("dtype", TYPES)
def test_arcsine_is_cut_at_45_degrees(dtype):
    """The one steepest heading the lateral controller asks for, from whatever it is given."""
    value = np.array([0.7072, 1.0, 5.0, 1e30, np.inf], dtype)
    result = np.asarray(arcsine(jnp.asarray(np.concatenate([value, -value]))))
    np.testing.assert_allclose(result[:5], np.pi / 4, rtol=np.finfo(dtype).eps)
    np.testing.assert_array_equal(result[5:], -result[:5])


@pytest.mark.parametrize("dtype", TYPES)
def test_power(dtype):
    """In float32 the relative error is that of the logarithm times the exponent; in float64 that of the last place."""
    rng = np.random.default_rng(0)
    base = np.concatenate([rng.uniform(0.01, 3.0, 100_000), 10 ** rng.uniform(-2, 3, 100_000)]).astype(dtype)
    exponent = rng.uniform(3.5, 4.5, base.size).astype(dtype)
    value = np.asarray(jax.jit(power)(jnp.asarray(base), jnp.asarray(exponent)))
    assert value.dtype == dtype
    exact = base.astype(float) ** exponent.astype(float)
    error = abs(value / exact - 1)
    bound = np.finfo(dtype).eps * (4 + 2 * abs(exponent * np.log(base.astype(float))))
    assert (error < bound).all()


@pytest.mark.parametrize("dtype", TYPES)
def test_power_of_zero_and_its_slope(dtype):
    """A standing vehicle: zero, and a finite slope in base and exponent."""
    base, exponent = jnp.zeros((), dtype), jnp.asarray(4.0, dtype)
    assert power(base, exponent) <= 1e-30
    assert power(base + 1, exponent) == 1
    slopes = jax.grad(power, argnums=(0, 1))(base, exponent)
    assert all(np.isfinite(slope) and abs(slope) < 1e-20 for slope in slopes)
    slope = jax.grad(power)(jnp.asarray(0.8, dtype), exponent)
    np.testing.assert_allclose(slope, 4 * 0.8**3, rtol=1e-5)


@pytest.mark.parametrize("dtype", TYPES)
def test_rounded_is_the_identity(dtype):
    rng = np.random.default_rng(0)
    value = np.concatenate([rng.normal(0, 1, 1000) * 10.0 ** rng.integers(-30, 30, 1000), [0.0, -0.0]])
    value = value.astype(dtype)
    result = np.asarray(jax.jit(rounded)(jnp.asarray(value)))
    np.testing.assert_array_equal(result.view(np.uint8), value.view(np.uint8))
    assert jax.grad(rounded)(jnp.asarray(3.0, dtype)) == 1


def test_rounded_keeps_a_product_from_being_fused_with_a_sum():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 10_000))
    c = -a * b
    fused_away = np.asarray(jax.jit(lambda a, b, c: rounded(a * b) + c)(*map(jnp.asarray, (a, b, c))))
    np.testing.assert_array_equal(fused_away, 0)
