"""Speeds that were measured by themselves, and positions that take their fast part from them."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import savgol_filter

from rearl_jax.discovery.read.kernels import FORMS, UNSMOOTHED, Kernel
from rearl_jax.discovery.read.smoothing import position_noise, track_bounds
from rearl_jax.discovery.read.smoothness import smoothing_kernel
from rearl_jax.discovery.read.speed_sensor import has_speed_sensor, with_fast_speeds

POSITION_NOISE, SPEED_NOISE = 0.5, 0.03


def measured(tables, seed=1, *, speeds):
    """Tables with noisy positions [m], and speeds [m/s] of a sensor or computed from these positions."""
    rng, made = np.random.default_rng(seed), []
    for table, dt in tables:
        position = table["position"].to_numpy() + POSITION_NOISE * rng.standard_normal(len(table))
        speed = table["speed"].to_numpy() + SPEED_NOISE * rng.standard_normal(len(table))
        if speeds == "computed":
            for start, stop in zip(*track_bounds(table), strict=True):
                smooth = gaussian_filter1d(position[start:stop], 0.5 / dt)
                speed[start:stop] = np.gradient(smooth, dt)
        made.append((table.assign(position=position, speed=speed), dt))
    return made


@pytest.fixture
def true_tables(tables_of):
    return tables_of(position_noise=0.0)


def test_a_sensor_is_told_from_speeds_that_were_computed(true_tables, tables_of):
    assert has_speed_sensor(measured(true_tables, speeds="sensor"))
    assert not has_speed_sensor(measured(true_tables, speeds="computed"))
    assert not has_speed_sensor(tables_of())


@pytest.mark.parametrize("n_coefficients", [0, 5, 11])
def test_a_filter_of_positions_once_a_second_is_no_sensor(n_coefficients):
    rng, tracks = np.random.default_rng(0), []
    for track in range(12):
        true = 20.0 + np.cumsum(0.5 * rng.standard_normal(120)) * 0.3
        position = np.cumsum(true) + 0.3 * rng.standard_normal(120)
        computed = savgol_filter(position, n_coefficients, 2, deriv=1) if n_coefficients else true
        tracks.append(
            pd.DataFrame({"track_id": track, "frame": np.arange(120), "position": position, "speed": computed})
        )
    assert has_speed_sensor([(pd.concat(tracks), 1.0)]) == (not n_coefficients)


def test_fast_motion_comes_from_the_sensor_and_the_place_from_the_position(true_tables):
    (raw, dt), (truth, _) = measured(true_tables, speeds="sensor")[0], true_tables[0]
    fused, _ = with_fast_speeds((raw, dt))
    bounds = track_bounds(raw)
    before, after = (position_noise(one["position"].to_numpy(), *bounds) for one in (raw, fused))
    assert before == pytest.approx(POSITION_NOISE, rel=0.1)
    assert after < 0.05 * before
    error = (fused["position"] - truth["position"]).to_numpy()
    assert np.sqrt(np.mean(error**2)) < 0.4 * POSITION_NOISE


def test_a_speed_that_is_wrong_by_a_little_does_not_drift_away(true_tables):
    (raw, dt), (truth, _) = measured(true_tables, speeds="sensor")[0], true_tables[0]
    fused, _ = with_fast_speeds((raw.assign(speed=raw["speed"] + 0.1), dt))
    assert np.abs(fused["position"] - truth["position"]).max() < 3 * POSITION_NOISE


@pytest.mark.parametrize("name", FORMS)
def test_a_kernel_of_the_sensor_is_found_in_the_speeds_and_not_in_the_positions(true_tables, name):
    used, smoothed = Kernel(name, 0.35), []
    for table, dt in measured(true_tables, speeds="sensor"):
        speed = table["speed"].to_numpy(copy=True)
        for start, stop in zip(*track_bounds(table), strict=True):
            speed[start:stop] = used.smoothed(speed[start:stop], dt)
        smoothed.append((table.assign(speed=speed), dt))
    rate = 1.0 / smoothed[0][1]
    found = smoothing_kernel(smoothed, rate, is_of_speeds=True)
    assert found.name == name
    assert found.deviation == pytest.approx(used.deviation, rel=0.35 if name == "exponential" else 0.2)
    assert smoothing_kernel(smoothed, rate) == UNSMOOTHED


def test_fusion_smooths_and_is_no_kernel_of_the_recording(true_tables):
    raw = measured(true_tables, speeds="sensor")
    rate = 1.0 / raw[0][1]
    assert smoothing_kernel(raw, rate, is_of_speeds=True) == UNSMOOTHED
    assert smoothing_kernel([with_fast_speeds(table) for table in raw], rate) != UNSMOOTHED
