"""Kernels of smoothing: weights, transfer functions and blending."""

import numpy as np
import pytest

from rearl_jax.discovery.read.kernels import FORMS, UNSMOOTHED, Kernel

DT = 0.1


@pytest.mark.parametrize("name", FORMS)
def test_a_kernel_has_its_deviation_and_its_transfer_function(name):
    kernel, time = Kernel(name, 0.5), DT * (np.arange(401) - 200)
    weights = kernel.smoothed((time == 0.0).astype(float), DT)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ time == pytest.approx(0.0, abs=1e-9)
    assert np.sqrt(weights @ time**2) == pytest.approx(0.5, rel=0.02)
    for frequency in (1.0, 3.0):
        passed = weights @ np.cos(frequency * time)
        assert passed == pytest.approx(FORMS[name].transfer(np.array([frequency * 0.5]))[0], abs=0.01)


@pytest.mark.parametrize("name", FORMS)
def test_the_share_of_a_kernel_beyond_a_time_is_what_is_left_of_a_step(name):
    kernel, time = Kernel(name, 0.5), DT * (np.arange(401) - 200)
    step = (time > 0.5 * DT).astype(float)
    np.testing.assert_allclose(kernel.smoothed(step, DT), kernel.share_beyond(0.5 * DT - time), atol=2e-3)


def test_each_column_is_smoothed_alone_and_nothing_without_a_kernel():
    values = np.random.default_rng(0).standard_normal((50, 3))
    kernel = Kernel("moving average", 0.4)
    np.testing.assert_array_equal(kernel.smoothed(values, DT)[:, 1], kernel.smoothed(values[:, 1], DT))
    assert UNSMOOTHED.smoothed(values, DT) is values
