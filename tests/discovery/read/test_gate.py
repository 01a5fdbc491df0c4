"""Findings in the columns before any model."""

import numpy as np
import pytest
from scipy.ndimage import convolve1d
from scipy.signal import lfilter

from rearl_jax.discovery.read.gate import gate, smoothed_release
from rearl_jax.discovery.read.kernels import FORMS, UNSMOOTHED
from rearl_jax.discovery.read.smoothness import smoothing_kernel

RATE = 10.0
"""Frames per second of the recordings."""


def test_a_clean_data_set_shows_nothing(tables_of):
    assert gate(tables_of()) == []


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("speed_lag", "lag", 0.5),
        ("position_lag", "lag", 0.5),
        ("speed_scale", "factor", 1.05),
        ("position_noise", "sd", 0.4),
    ],
)
def test_faults_between_columns_are_named_and_measured(tables_of, name, parameter, value):
    (found,) = gate(tables_of(name))
    assert (found.name, found.parameter) == (name, parameter)
    assert found.value == pytest.approx(value, rel=0.1)


def released(tables, kernel, deviation, errors):
    """Tables whose positions have white errors [m] and were smoothed over a standard deviation [s], as released to a
    millimetre.
    """
    rng, smoothed = np.random.default_rng(0), []
    for table, dt in tables:
        reach = round(5 * deviation / dt) + 1
        x = np.arange(-reach, reach + 1) * dt / deviation
        weights = {
            "gaussian": np.exp(-0.5 * x**2),
            "exponential": np.exp(-np.sqrt(2) * np.abs(x)),
            "moving average": np.clip((np.sqrt(3) - np.abs(x)) * deviation / dt + 0.5, 0, 1),
            "triangular": np.maximum(0, np.sqrt(6) - np.abs(x)),
        }[kernel]

        def one(position, weights=weights):
            measured = position + errors * rng.standard_normal(len(position))
            return convolve1d(measured, weights / weights.sum(), mode="nearest").round(3)

        smoothed.append((table.assign(position=table.groupby("track_id")["position"].transform(one)), dt))
    return smoothed


def test_smoothed_tracks_are_noticed(tables_of):
    kernel = smoothing_kernel(tables_of("smoothing"), RATE)
    assert 0.4 < kernel.deviation < 0.9
    assert smoothed_release(kernel, is_of_speeds=False).value == kernel.deviation
    assert smoothing_kernel(tables_of(), RATE) == UNSMOOTHED


@pytest.mark.parametrize(("deviation", "errors"), [(0.2, 0.1), (0.4, 0.05), (0.6, 0.1), (0.65, 0.3)])
@pytest.mark.parametrize("name", FORMS)
def test_the_kernel_and_its_width_are_found_whatever_else_was_smoothed(tables_of, name, deviation, errors):
    kernel = smoothing_kernel(released(tables_of(), name, deviation, errors), RATE)
    assert kernel.name == name
    assert kernel.deviation == pytest.approx(deviation, rel=0.35 if name == "exponential" else 0.2)


@pytest.mark.parametrize("n_averaged", [1, 3])
@pytest.mark.parametrize("errors", [0.05, 0.3])
@pytest.mark.parametrize("noise_time", [0.0, 0.3, 1.0])
def test_errors_that_are_large_or_correlated_are_no_kernel(tables_of, errors, noise_time, n_averaged):
    rng, noisy = np.random.default_rng(1), []
    for table, dt in tables_of():
        decay = np.exp(-dt / n_averaged / noise_time) if noise_time else 0.0
        drawn = errors * np.sqrt(1 - decay**2) * rng.standard_normal(n_averaged * len(table))
        averaged = lfilter([1.0], [1.0, -decay], drawn).reshape(-1, n_averaged).mean(axis=1)
        noisy.append((table.assign(position=table["position"] + averaged), dt))
    assert smoothing_kernel(noisy, n_averaged * RATE) == UNSMOOTHED


def test_smooth_errors_count_as_smoothed_positions(tables_of):
    kernel = smoothing_kernel(tables_of(noise_time=0.3), RATE)
    assert kernel.deviation == pytest.approx(0.3, rel=0.2)


def test_who_never_accelerates_says_nothing_of_smoothing(tables_of):
    (table, dt), *_ = tables_of()
    assert smoothing_kernel([(table.assign(position=16.0 * table["frame"]), dt)], RATE) == UNSMOOTHED
