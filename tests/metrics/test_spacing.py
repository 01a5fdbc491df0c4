"""Mean spacing and its three relative errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.scenes import SpacingConfig, SpacingMetric
from rearl_jax.metrics.spacing import mean_spacing, spacing_errors, vehicle_spacing
from tests.metrics import reference
from tests.metrics.conftest import cast, make_scene

SPACING = jax.jit(vehicle_spacing, static_argnums=2)
MEAN = jax.jit(mean_spacing)
ERRORS = jax.jit(spacing_errors)
EUCLIDEAN = SpacingConfig(metric=SpacingMetric.euclid2d)


@pytest.mark.parametrize("metric", list(SpacingMetric), ids=lambda metric: metric.name)
@pytest.mark.parametrize("kind", ["random", "one_place", "one_vehicle"])
def test_spacing_equals_the_reference(kind, metric):
    scene = make_scene(5, kind)
    mean, vehicle = reference.spacings(scene["x"], scene["y"], metric is SpacingMetric.longitudinal)
    found = SPACING(jnp.asarray(scene["x"]), jnp.asarray(scene["y"]), SpacingConfig(metric=metric))
    np.testing.assert_allclose(found, vehicle, rtol=1e-11)
    np.testing.assert_allclose(MEAN(found), mean, rtol=1e-11)


def test_errors_equal_the_reference(dtype, rtol):
    scenes = [cast(make_scene(seed), dtype) for seed in (6, 7)]
    (mean, _), (real_mean, real_vehicle) = [reference.spacings(s["x"], s["y"]) for s in scenes]
    mean[3] = real_mean[5] = 0.0
    found = ERRORS(*(jnp.asarray(d, dtype) for d in (mean, real_mean, real_vehicle)))
    expected = reference.spacing_errors(mean, real_mean, real_vehicle)
    assert [t for t, row in enumerate(expected) if row is None] == [3, 5]
    assert found.valid.tolist() == [row is not None for row in expected]
    table = np.array([row or (0, 0, 0, 0) for row in expected])
    assert np.ptp(table[:, 0]) > 0.01
    np.testing.assert_allclose(np.stack([found.a, found.b, found.c, found.ratio], 1), table, rtol=10 * rtol)


def test_hand_values(dtype):
    real_vehicle = jnp.asarray([[120.0, 180.0, 90.0, 210.0]], dtype)
    real = MEAN(real_vehicle)
    errors = ERRORS(jnp.asarray([100.0], dtype), real, real_vehicle)
    assert float(real[0]) == 150
    assert float(errors.a[0]) == pytest.approx(0.5)
    assert float(errors.b[0]) == pytest.approx(1 / 3)
    assert float(errors.c[0]) == pytest.approx((20 + 80 + 10 + 110) / 4 / 150)
    assert float(errors.c[0]) >= float(errors.b[0])
    exact = ERRORS(real, real, real_vehicle)
    assert (float(exact.a[0]), float(exact.b[0])) == (0, 0)
    assert float(exact.c[0]) == pytest.approx(45 / 150), "C has a floor above 0"


def test_order_of_vehicles_and_origin_of_the_road_do_not_matter():
    scene = make_scene(8)
    x, y = scene["x"], scene["y"]
    order = np.random.default_rng(0).permutation(10)
    d = np.asarray(SPACING(x, y, EUCLIDEAN))
    np.testing.assert_allclose(SPACING(x[:, order], y[:, order], EUCLIDEAN), d[:, order], rtol=1e-12)
    np.testing.assert_allclose(SPACING(x + 512.0, y - 8.0, EUCLIDEAN), d, rtol=1e-12)


@pytest.mark.parametrize("kind", ["random", "one_place", "one_vehicle"])
def test_gradient_is_finite_and_right(kind):
    scene = make_scene(9, kind)
    x, y = scene["x"], jnp.asarray(scene["y"])

    def total(x):
        return mean_spacing(vehicle_spacing(x, y, EUCLIDEAN)).sum()

    both = jax.jit(jax.value_and_grad(total))
    gradient = both(x)[1]
    assert np.isfinite(gradient).all()
    if kind == "random":
        step = np.zeros_like(x)
        step[4, 2] = 1e-4
        slope = (both(x + step)[0] - both(x - step)[0]) / 2e-4
        assert abs(float(slope)) > 1e-3
        assert float(gradient[4, 2]) == pytest.approx(float(slope), rel=1e-5)
