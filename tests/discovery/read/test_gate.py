"""Findings in the columns before any model."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from rearl_jax.discovery.read.gate import gate, smoothed_positions
from rearl_jax.discovery.read.smoothness import Smoothness, smoothness


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


def test_smoothed_tracks_are_noticed(tables_of):
    smooth = smoothness(tables_of("smoothing"))
    assert 0.4 < smooth.drives < 0.9
    assert smooth.errors == 0.0
    assert smoothed_positions(smooth.drives).value == smooth.drives


@pytest.mark.parametrize(("kernel", "errors"), [(0.4, 0.05), (0.65, 0.05), (0.65, 0.3)])
def test_errors_that_were_smoothed_too_do_not_hide_the_width_of_the_kernel(tables_of, kernel, errors):
    rng, smoothed = np.random.default_rng(0), []
    for table, dt in tables_of():

        def released(position, dt=dt):
            measured = position + errors * rng.standard_normal(len(position))
            return gaussian_filter1d(measured, kernel / dt, mode="nearest").round(3)

        smoothed.append((table.assign(position=table.groupby("track_id")["position"].transform(released)), dt))
    assert smoothness(smoothed).drives == pytest.approx(kernel, rel=0.15)


def test_smooth_errors_are_not_taken_for_smoothed_drives(tables_of):
    smooth = smoothness(tables_of(noise_time=0.3))
    assert smooth.drives == 0.0
    assert smooth.errors == pytest.approx(0.3, rel=0.2)
    # What has 0.1 m over a kernel of 0.3 s was white before, and larger.
    assert smooth.size == pytest.approx(0.1 * np.sqrt(2 * np.sqrt(np.pi) * 0.3 / 0.1), rel=0.2)
    assert smoothness(tables_of()) == Smoothness()


def test_who_never_accelerates_says_nothing_of_smoothing(tables_of):
    (table, dt), *_ = tables_of()
    assert smoothness([(table.assign(position=16.0 * table["frame"]), dt)]) == Smoothness()


def test_the_complement_makes_errors_white():
    smooth, rng = Smoothness(errors=0.3, size=0.35), np.random.default_rng(0)
    errors = gaussian_filter1d(0.35 * rng.standard_normal(20_000), 3.0) + smooth.complement(20_000, 0.1, rng)
    assert errors.std() == pytest.approx(0.35, rel=0.03)
    power = np.abs(np.fft.rfft(errors)) ** 2 / len(errors)
    assert power[1:500].mean() == pytest.approx(power[5_000:].mean(), rel=0.2)
    assert (Smoothness().complement(10, 0.1, rng) == 0.0).all()
