"""The observer and the derivatives of what it fails to predict."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from rearl_jax.discovery.observe.candidates import LENS, Term
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP, DAMPING, STIFFNESS, Gain, Noise, steady_state
from rearl_jax.discovery.observe.noise import ACCELERATIONS, TIMES, best_noise, spread_of, under_best_noise
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.fused_errors import FusedErrors
from rearl_jax.discovery.search.simulated_drives import driver_noise, simulate_again


@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize(("acceleration", "position"), [(0.2, 0.1), (0.01, 1.0), (2.0, 0.001)])
def test_gain_is_that_of_the_steady_state_filter(acceleration, position, stride):
    noise, dt = Noise(acceleration, 1.5, position), 0.1
    kept = np.exp(-dt / noise.time)
    step = np.array([[1, dt, dt * dt / 2], [-STIFFNESS * dt, 1 - DAMPING * dt, dt], [0, 0, kept]])
    shock = np.diag([0.0, 0.0, noise.acceleration**2 * (1 - kept**2)])
    shocks = sum(np.linalg.matrix_power(step, n) @ shock @ np.linalg.matrix_power(step, n).T for n in range(stride))
    seen = np.array([[1.0, 0.0, 0.0]])
    period = np.linalg.matrix_power(step, stride)
    ahead = solve_discrete_are(period.T, seen.T, shocks, np.array([[noise.position**2]]))
    variance = ahead[0, 0] + noise.position**2
    gain = noise.gain(dt, stride)
    np.testing.assert_allclose(gain[:3], ahead[:, 0] / variance, rtol=1e-6)
    assert gain.kept_o == pytest.approx(kept)
    assert gain.variance == pytest.approx(variance, rel=1e-6)


@pytest.mark.parametrize(
    "noise", [Noise(1e-9, 1.5, 1e-9), Noise(0.0, 1.5, 0.0, 0.3, 5.0, True), Noise(50.0, 0.05, 20.0)]
)
def test_there_is_a_gain_where_nearly_all_noise_is_of_one_kind(noise):
    steady = steady_state(noise, 0.033, 3)
    assert len(steady.covariance) == 3
    assert all(np.linalg.eigvalsh(covariance).min() > -1e-9 for covariance in steady.covariance)
    assert np.isfinite(steady.gain).all()


def test_drivers_noise_has_the_deviation_and_the_memory_it_is_asked_for():
    values = driver_noise(Noise(0.3, 2.0, 0.1), (4000, 30), 0.1, np.random.default_rng(0))
    assert values.std() == pytest.approx(0.3, rel=0.05)
    assert (values[1:] * values[:-1]).mean() / values.var() == pytest.approx(np.exp(-0.05), abs=0.01)


def test_innovations_of_the_right_model_are_white_and_of_the_wrong_gain_are_not(solver, calibrated):
    state, _ = calibrated
    noise = Noise(0.2, 1.5, 0.1)
    again = simulate_again(solver, state, noise, np.random.default_rng(1))
    again.z, again.mean = state.z, state.mean

    def lag_one(gain: Gain) -> float:
        (errors,) = solver.innovations([again], gain)
        weight = state.data.weight
        pair = weight[1:] * weight[:-1]
        return float((errors[1:] * errors[:-1] * pair).sum() / (errors**2 * weight).sum())

    # The gain is that of a driver who reacts as is usual: a little is left of the reaction.
    assert abs(lag_one(noise.gain(state.data.dt))) < 0.1
    assert lag_one(CLOSED_LOOP) > 0.9


def test_a_closed_loop_of_its_own_drive_errs_nowhere(solver, calibrated):
    state, _ = calibrated
    still = Noise(1e-9, 1.5, 1e-9)
    again = simulate_again(solver, state, still, np.random.default_rng(0))
    pieces = replace(again.pieces, start=state.pieces.start)
    again = replace(again, pieces=pieces, z=state.z, mean=state.mean)
    (errors,) = solver.innovations([again], CLOSED_LOOP)
    assert np.abs(errors).max() < 1e-6
    assert np.abs(np.diff(again.pieces.y, axis=0)).max() > 0.5, "nobody drove"


@pytest.mark.parametrize("name", ["leader_acceleration", "lens"])
def test_derivatives_are_those_of_finite_differences(solver, calibrated, name):
    # At a camera that already bends the picture: where drives begin depends on it too.
    state, _ = calibrated
    step = 1e-5 if name != "lens" else 1e-3
    layout = solver.layout
    look = layout.candidates[Term(name)].directions
    start = layout.reference.copy()
    start[list(look)] += 2.0 * np.sin(np.arange(len(look))) if name == "lens" else 0.0
    place = look[min(4, len(look) - 1)]

    def errors(change: float) -> np.ndarray:
        theta = start.copy()
        theta[place] += change
        moved = replace(state, theta=theta, active=(Term(name),))
        return solver.innovations([moved])[0]

    slope = (errors(step) - errors(-step)) / (2 * step) * state.pieces.weight**0.5
    here = replace(state, theta=start, active=(Term(name),))
    solver.sums([here])
    k = 5 + layout.candidates[Term(name)].free.index(place)
    square = np.bincount(state.data.driver, (slope**2).sum(axis=0))
    gradient = np.bincount(state.data.driver, (slope * errors(0.0) * state.pieces.weight**0.5).sum(axis=0))
    assert square.min() > 0
    np.testing.assert_allclose(here.sums.gram[:, k, k], square, rtol=1e-4)
    np.testing.assert_allclose(here.sums.gradient[:, k], gradient, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("levels", [ACCELERATIONS, ACCELERATIONS[:1], ACCELERATIONS[-2:]])
@pytest.mark.parametrize("begin", [0.03, 0.2, 1.0])
def test_the_most_likely_noise_is_found_from_any_level(solver, calibrated, begin, levels):
    state, noise = calibrated
    _, found = under_best_noise(solver, state, replace(noise, acceleration=begin, time=TIMES[1]), levels, iterations=0)
    tried = [replace(noise, acceleration=sd, time=time) for sd in levels for time in TIMES]
    likeliest, _ = best_noise(solver, state, tried)
    assert found == likeliest


def test_no_camera_distorts_positions_that_every_vehicle_measures_itself(calibrated):
    data = calibrated[0].data
    assert LENS in solver_of(data).layout.candidates
    measured_by_vehicles = replace(data, fused_errors=FusedErrors(0.1, 0.5, 20.0, 0.03, 0.0, 0.3))
    assert LENS not in solver_of(measured_by_vehicles).layout.candidates


def test_a_driver_whose_observer_is_unstable_does_not_stop_the_others(solver, calibrated):
    state, _ = calibrated
    overflowed = state.pieces.y.copy()
    overflowed[:, state.data.driver == 0] = np.inf
    start = replaced(state, z=np.zeros_like(state.z), pieces=replace(state.pieces, y=overflowed))
    solver.solve([start], iterations=3, tolerance=0.1)
    assert np.isfinite(start.objective)
    assert np.isfinite(spread_of(start)).all()
    assert np.abs(start.z[1:]).max() > 0.1, "the others were calibrated"
    assert start.log_likelihood()[0] < start.log_likelihood()[1:].min()
