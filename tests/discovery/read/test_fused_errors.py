"""Errors of positions that were fused with speeds, from their comparison."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rearl_jax.discovery.read.fused_errors import FusedErrors, fused_errors

DT = 0.1
CUT_OFF = 0.3


def measured(
    errors: FusedErrors, n_steps: int = 6000, n_tracks: int = 200
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Position minus integrated speed, and speed, of tracks before they are fused; each speed is also wrong by a
    constant.
    """
    rng = np.random.default_rng(3)
    shape = (n_tracks, n_steps)
    lasting = errors.lasting * lasting_series(errors.time, shape, rng)
    if errors.speed_time:
        speed = errors.walk / np.sqrt(2 * errors.speed_time) * lasting_series(errors.speed_time, shape, rng)
    else:
        speed = errors.walk / np.sqrt(DT) * rng.standard_normal(shape)
    speed += rng.normal(0, 0.1, (n_tracks, 1))
    differences = errors.white * rng.standard_normal(shape) + lasting - DT * np.cumsum(speed, axis=1)
    driving = 20 + 3 * lasting_series(20.0, (n_tracks, 1 + n_steps // 20), rng)  # changes slowly
    coarse, fine = np.arange(driving.shape[1]) * 20 * DT, np.arange(n_steps) * DT
    true = np.stack([np.interp(fine, coarse, track) for track in driving])
    return list(differences), list(true + speed)


def lasting_series(time: float, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Series of unit variance whose correlation falls to 1/e within a time [s]."""
    kept = np.exp(-DT / time)
    shocks = np.sqrt(1 - kept**2) * rng.standard_normal(shape)
    shocks[:, 0] /= np.sqrt(1 - kept**2)
    return lfilter([1.0], [1.0, -kept], shocks, axis=1)


@pytest.mark.parametrize(
    "true",
    [
        FusedErrors(0.3, 0.5, 10.0, 0.0, 0.0, CUT_OFF),
        FusedErrors(0.3, 0.5, 40.0, 0.04, 0.0, CUT_OFF),
        FusedErrors(0.02, 0.0, 40.0, 0.05, 0.0, CUT_OFF),
        FusedErrors(0.02, 0.0, 40.0, 0.05, 0.5, CUT_OFF),
    ],
)
def test_white_lasting_and_integrated_errors_are_told_apart(true):
    found = fused_errors(*measured(true), DT, CUT_OFF)
    assert found is not None
    assert found.cut_off == CUT_OFF
    assert found.white == pytest.approx(true.white, abs=0.03)
    assert found.lasting == pytest.approx(true.lasting, rel=0.25, abs=0.1)
    assert found.walk == pytest.approx(true.walk, abs=0.04)
    if true.white < 0.1:  # otherwise errors of positions hide those of speeds
        assert found.speed_time == pytest.approx(true.speed_time, rel=0.3, abs=0.05)


def test_short_tracks_tell_nothing():
    assert fused_errors([np.zeros(20)], [np.zeros(20)], DT, CUT_OFF) is None
    assert fused_errors([], [], DT, CUT_OFF) is None


def test_drawn_errors_have_the_estimated_size():
    rng = np.random.default_rng(0)
    slow = FusedErrors(0.0, 0.5, 40.0, 0.0, 0.0, CUT_OFF).drawn((4000, 60), DT, rng)
    assert slow.std() == pytest.approx(0.5, rel=0.1)
    assert np.diff(slow, axis=0).std() < 0.01, "the fast part of the position was replaced"
    fast = FusedErrors(0.0, 0.0, 40.0, 0.05, 0.0, CUT_OFF).drawn((4000, 60), DT, rng)
    assert 0.02 < fast.std() < 0.3, "integrated speeds drift away only until the position holds them"
    assert np.diff(fast, axis=0).std() == pytest.approx(0.05 * np.sqrt(DT), rel=0.1)
    smooth = FusedErrors(0.0, 0.0, 40.0, 0.05, 0.5, CUT_OFF).drawn((4000, 60), DT, rng)
    assert smooth.std() == pytest.approx(fast.std(), rel=0.2), "slow errors are the same"
    assert np.diff(smooth, axis=0).std() == pytest.approx(0.05 * DT, rel=0.1)
