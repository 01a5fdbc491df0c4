"""Errors of positions that are correlated in time: what the observer assumes, and what is estimated of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from rearl_jax.discovery.observe.kalman import MEASURED, Noise, steady_state
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.read.kernels import Kernel
from rearl_jax.discovery.read.lasting import lasting, smooth_lasting
from rearl_jax.discovery.search.simulated_drives import measured_again

DT = 0.1
SMOOTH = Noise(0.15, 1.5, 0.05, lasting=0.2, lasting_time=0.6, is_smooth=True)
ROUGH = Noise(0.15, 1.5, 0.02, lasting=0.2, lasting_time=0.6)


@pytest.mark.parametrize("noise", [SMOOTH, ROUGH])
def test_the_observer_has_the_gain_of_the_filter_of_these_errors(noise):
    steady = steady_state(noise, DT, 1)
    errors = noise.lasting**2 * (np.array([[1.0, 1.0], [1.0, 2.0]]) if noise.is_smooth else np.diag([1.0, 0.0]))
    kept = np.exp(-DT / noise.lasting_time)
    step = np.array([[kept, kept * DT / noise.lasting_time * noise.is_smooth], [0.0, kept]])
    np.testing.assert_allclose(steady.step[3:, 3:], step)
    shock = np.zeros((5, 5))
    shock[2, 2] = noise.acceleration**2 * (1 - np.exp(-2 * DT / noise.time))
    shock[3:, 3:] = errors - step @ errors @ step.T
    ahead = solve_discrete_are(steady.step.T, MEASURED[:, None], shock, np.array([[noise.position**2]]))
    variance = MEASURED @ ahead @ MEASURED + noise.position**2
    assert steady.gain.variance == pytest.approx(variance, rel=1e-4)
    np.testing.assert_allclose(steady.gain[:5], ahead @ MEASURED / variance, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("series", [lasting, smooth_lasting])
def test_drawn_errors_have_their_size_from_the_beginning(series):
    drawn = series(0.2, 0.6, (600, 4000), DT, np.random.default_rng(0))
    assert drawn.shape == (600, 4000)
    assert drawn[0].std() == pytest.approx(0.2, rel=0.05)
    assert drawn[-1].std() == pytest.approx(0.2, rel=0.05)


def test_only_smooth_errors_are_smooth():
    rough, smooth = (series(0.2, 0.6, (600, 400), DT, np.random.default_rng(0)) for series in (lasting, smooth_lasting))
    assert np.diff(smooth, 2, axis=0).std() < 0.3 * np.diff(rough, 2, axis=0).std()
    lag = round(0.6 / DT)
    # Correlation of two equal low passes in series after their time constant: 2 / e.
    assert (smooth[lag:] * smooth[:-lag]).mean() / smooth.var() == pytest.approx(2 / np.e, abs=0.05)


@pytest.mark.parametrize("kernel", [0.0, 0.3])
def test_smooth_errors_are_told_from_driving(solver, calibrated, kernel):
    """Also where a kernel smoothed the positions: it leaves smooth errors of their white ones."""
    state, noise = calibrated
    assert not noise.lasting, "there are only white errors to begin with"
    errors = smooth_lasting(0.2, 0.5, state.data.y.shape, state.data.dt, np.random.default_rng(1))
    _, found = calibrate(solver, replace(state.data, y=state.data.y + errors, kernel=Kernel("gaussian", kernel)))
    assert found.is_smooth
    assert found.lasting == pytest.approx(0.2, rel=0.25)
    assert found.lasting_time == pytest.approx(0.5, rel=0.35)
    assert found.acceleration == pytest.approx(noise.acceleration, abs=0.1)


def test_other_vehicles_are_measured_with_such_errors_too(calibrated):
    state, _ = calibrated
    data = state.data

    def moved(noise: Noise, **choice: bool) -> np.ndarray:
        again = measured_again(data, data.smooth, noise, np.random.default_rng(0), **choice)
        return again.surroundings.leader_rear - data.surroundings.leader_rear

    led = data.surroundings.has_leader > 0
    errors = moved(SMOOTH)
    assert errors[led].std() == pytest.approx(SMOOTH.lasting, rel=0.2)
    assert (errors[~led] == 0).all()
    assert (moved(SMOOTH, with_others=False) == 0).all()
    assert (moved(replace(SMOOTH, lasting=0.0)) == 0).all()


def test_speed_and_acceleration_of_the_leader_have_the_derivatives_of_its_errors(calibrated):
    data = calibrated[0].data
    again = measured_again(data, data.smooth, SMOOTH, np.random.default_rng(0)).surroundings
    inner = (slice(5, -5), data.surroundings.has_leader.all(axis=0))
    position, speed, acceleration = (
        (getattr(again, name) - getattr(data.surroundings, name))[inner]
        for name in ("leader_rear", "leader_speed", "leader_acceleration")
    )
    assert position.shape[1] > 5
    np.testing.assert_allclose(speed[1:-1], np.gradient(position, data.dt, axis=0)[1:-1], atol=1e-9)
    np.testing.assert_allclose(acceleration[1:-1], np.gradient(speed, data.dt, axis=0)[1:-1], atol=1e-9)
