"""Residuals, maps and the open-ended finder on drives whose missing acceleration is known."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.fit_state import new_state, replace_gain
from rearl_jax.discovery.observe.forcing import (
    DriverScores,
    acceleration_derivatives,
    driver_scores,
    innovation_and_acceleration_scores,
    innovation_change,
)
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP, DAMPING, MEASURED, STIFFNESS, Noise, steady_state
from rearl_jax.discovery.observe.observer import pieces_of
from rearl_jax.discovery.observe.residuals import residuals_of, smoothed_acceleration
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.measured import is_new
from rearl_jax.discovery.report.figures import stretches
from rearl_jax.discovery.report.presentation import residual_table
from rearl_jax.discovery.report.protocols import speed_deviation
from rearl_jax.discovery.search.atlas import grid_of, part_scores
from rearl_jax.discovery.search.finder import Group, forward_selection, stability_selection
from rearl_jax.discovery.search.maps import curve_of
from rearl_jax.discovery.search.shapes import shape_words
from rearl_jax.discovery.search.simulated_drives import driver_noise, position_errors
from rearl_jax.discovery.search.variables import variables_of

NOISE = Noise(0.1, 1.5, 0.05)
SLOPE = 0.6
"""Of the planted acceleration over the offset in the lane [1/s^2]."""


@pytest.fixture(scope="module")
def solver_and_world(measured_of):
    data = measured_of(seed=5, n_recordings=1, n_vehicles=18, duration=30.0, lane_changes=2)
    solver = solver_of(data)
    return solver, new_state(data, solver.layout, NOISE)


def driven(solver, state, known, noise=NOISE):
    """The state with drives that the model itself and a known acceleration made."""
    data = state.data
    start = replace(state, pieces=replace(replace_gain(state.pieces, CLOSED_LOOP), known=known))
    (errors,) = solver.innovations([start], CLOSED_LOOP)
    y = data.y - errors + position_errors(noise, data.y.shape, data.dt, np.random.default_rng(3))
    data = replace(data, y=y)
    return replace(state, data=data, pieces=pieces_of(data, noise))


@pytest.fixture(scope="module")
def planted(solver_and_world):
    """Residuals of drives with drivers' noise and an acceleration that follows the offset in the lane."""
    solver, state = solver_and_world
    noise = driver_noise(NOISE, state.data.y.shape, state.data.dt, np.random.default_rng(2))
    made = driven(solver, state, noise + SLOPE * state.data.surroundings.lateral_offset)
    return solver, residuals_of(solver, made, NOISE)


def test_felt_is_what_the_observer_makes_of_an_acceleration(solver_and_world):
    solver, state = solver_and_world
    push = 0.05 * np.cos(np.arange(state.data.y.shape[0])[:, None] * state.data.dt + np.arange(state.data.y.shape[1]))
    pushed = replace(state, pieces=replace(state.pieces, known=push))
    left = residuals_of(solver, state, NOISE)
    change = solver.innovations([pushed])[0] - left.innovation
    predicted = innovation_change(push[None], left, acceleration_derivatives(left))[0]
    used = state.data.weight > 0
    assert np.abs(change[used]).max() > 1e-3
    assert np.abs(predicted - change)[used].max() < 0.05 * np.abs(change[used]).max()


def test_a_driver_is_where_it_drives_not_where_lasting_errors_put_it(solver_and_world):
    solver, state = solver_and_world
    noise, data = Noise(0.15, 1.5, 0.02, lasting=0.2, lasting_time=0.6), state.data
    made = driven(solver, state, driver_noise(noise, data.y.shape, data.dt, np.random.default_rng(2)), noise)
    left = residuals_of(solver, made, noise)
    true = made.data.y - position_errors(noise, data.y.shape, data.dt, np.random.default_rng(3))
    used = (data.weight > 0)[:-1]
    speed_error = (left.v[:-1] - np.diff(true, axis=0) / data.dt)[used]
    assert np.sqrt(np.mean(speed_error**2)) < 0.2  # it is 0.57 m/s if the change of the errors counts as motion


def test_correlated_innovations_are_less_evidence(planted):
    _, left = planted
    columns, slopes = np.ones((1, *left.x.shape)), acceleration_derivatives(left)
    half = replace(left, noise=replace(left.noise, independent=0.5))
    white, correlated = (driver_scores(columns, residuals, slopes) for residuals in (left, half))
    assert correlated.variance == pytest.approx(2 * white.variance)


def test_map_shows_the_planted_dependence_with_its_size(planted):
    _, left = planted
    grid = grid_of(left)
    basis = next(one for one in grid.bases if one.variable.name == "lateral_offset")
    pair = innovation_and_acceleration_scores(
        basis.columns(basis.variable.values), left, acceleration_derivatives(left)
    )
    curve = curve_of(basis, {"acceleration": pair}, 0.9, 100, 0)
    slope = np.polyfit(curve.basis.knots, curve.value, 1)[0]
    assert slope == pytest.approx(SLOPE, rel=0.2)
    assert curve.gain > 10
    assert curve.share > 0.2
    assert (curve.low <= curve.high).all()
    assert shape_words(curve, pair[0]).startswith("rises")


def test_finder_selects_the_planted_variable_and_none_beside_it(planted):
    _, left = planted
    grid = grid_of(left)
    scores, groups = part_scores(left, grid).curves, grid.groups()
    found = stability_selection(scores, groups, 0)
    (first, *_) = forward_selection(scores, np.arange(len(scores.score)), groups)
    assert (first.variable, first.acts_on) == ("lateral_offset", "acceleration")
    assert found[0].variable == "lateral_offset"
    assert found[0].frequency > 0.9
    assert all(one.frequency < 0.5 for one in found[1:])


def test_nothing_that_drivers_react_to_knows_their_future(planted):
    solver, left = planted
    data, cut = left.state.data, len(left.state.data.y) // 2
    later = replace(data, y=data.y + 5.0 * (np.arange(len(data.y)) > cut)[:, None])
    state = replace(left.state, data=later, pieces=replace(left.state.pieces, y=later.y))
    moved = residuals_of(solver, state, NOISE)
    after = variables_of(moved)
    for name, before in variables_of(left).items():
        # The step that ends with the first moved time step has been predicted before it.
        change = np.abs(before.values - after[name].values)[:cut]
        assert change.max() < 0.05 + 0.02 * np.abs(before.values).max(), name
    assert np.abs(left.v - moved.v)[cut + 2 :].max() > 1.0


def smoothing_error(noise: Noise, dt: float, stride: int) -> float:
    """Standard deviation of the smoothed acceleration around the true one where something new is measured [m/s^2]."""
    steady = steady_state(noise, dt, stride)
    period = np.linalg.matrix_power(steady.step, stride - 1) @ steady.corrected
    information = np.outer(MEASURED, MEASURED) / steady.gain.variance
    ahead = np.linalg.solve(np.eye(25) - np.kron(period.T, period.T), information.ravel()).reshape(5, 5)
    left = steady.covariance[0] - steady.covariance[0] @ ahead @ steady.covariance[0]
    return float(np.sqrt(max(left[2, 2], 0.0)))


@pytest.mark.parametrize("stride", [1, 7])
def test_smoothed_acceleration_errs_as_little_as_it_says(stride):
    rng, dt, shape = np.random.default_rng(0), 0.1, (600, 40)
    known = driver_noise(NOISE, shape, dt, rng)
    place, speed = np.zeros(shape), np.zeros(shape[1])
    for t in range(1, shape[0]):
        place[t] = place[t - 1] + dt * speed + known[t - 1] * dt**2 / 2
        speed = speed + dt * (known[t - 1] - STIFFNESS * place[t - 1] - DAMPING * speed)
    y, gain = place + NOISE.position * rng.standard_normal(shape), NOISE.gain(dt, stride)
    state, innovation = np.zeros((3, shape[1])), np.zeros(shape)
    for t in range(shape[0]):
        innovation[t] = y[t] - state[0]
        if t % stride == 0:
            state = state + np.array(gain[:3])[:, None] * innovation[t]
        answer = state[2] - STIFFNESS * state[0] - DAMPING * state[1]
        place, speed = state[0] + dt * state[1] + dt**2 / 2 * state[2], state[1] + dt * answer
        state = np.stack([place, speed, gain.kept_o * state[2]])
    looked, later = innovation[::stride], innovation[stride // 2 :: stride]
    assert looked[8:].var() == pytest.approx(gain.variance, rel=0.1)
    assert stride == 1 or later[8:].var() < looked[8:].var()  # less time to err
    error = smoothed_acceleration(innovation, np.ones(shape), NOISE, dt, stride) - known
    error = error[7 * stride : -7 * stride : stride]
    assert error.std() == pytest.approx(smoothing_error(NOISE, dt, stride), rel=0.1)
    assert error.std() < (0.75 if stride == 1 else 0.95) * known.std()


def test_where_few_moments_count_all_are_kept_and_stand_at_their_times(planted):
    _, left = planted
    data, stride = left.state.data, 7
    data = replace(data, stride=stride, weight=data.weight * is_new(len(data.y), stride)[:, None])
    few = replace(left, state=replace(left.state, data=data))
    apart, values = few.autocorrelation()
    np.testing.assert_allclose(apart, [0.7, 1.4, 2.1, 2.8])
    assert len(values) == 4
    n_counted = int((data.weight > 0).sum())
    assert n_counted > 100
    assert len(residual_table({"before": [few] * 3})) == 3 * n_counted


def test_lines_are_broken_where_something_is_left_out():
    counts = np.zeros(30, bool)
    counts[[2, 5, 8, 20, 23]] = True
    rows, begins = stretches(counts, 3)
    assert rows.tolist() == [2, 5, 8, 20, 23]
    assert rows[begins].tolist() == [20]


def test_the_speed_error_does_not_feel_what_comes_after_a_drive(planted):
    _, left = planted
    data = left.state.data
    last = len(data.y) - (data.weight[::-1] > 0).argmax(axis=0) - 1
    step = np.arange(len(data.y))[:, None]
    assert (last < len(data.y) - 1).all(), "no padding"
    gone = (data.y - data.smooth) + np.where(step <= last, 0.5 * step * data.dt, 1000.0)
    np.testing.assert_allclose(np.sqrt(data.driver_mean(speed_deviation(gone, data) ** 2)), 0.5)


def noisy_votes(rng, n_drivers=40, n_groups=12, size=5, n=200, planted=None):
    """Scores on random columns; one group may act."""
    gram, score, square = [], [], []
    for _ in range(n_drivers):
        w = rng.standard_normal((n_groups * size, n))
        y = rng.standard_normal(n)
        if planted is not None:
            y = y + 0.15 * w[planted * size : (planted + 1) * size].sum(axis=0)
        gram.append(w @ w.T)
        score.append(w @ y)
        square.append(y @ y)
    groups = [Group(f"g{k}", "acceleration", np.arange(k * size, (k + 1) * size)) for k in range(n_groups)]
    return DriverScores(np.array(gram), np.array(score), np.array(square), 1.0), groups


def test_stability_selection_finds_nothing_in_noise_and_a_planted_group():
    votes_of_noise, groups = noisy_votes(np.random.default_rng(1))
    assert max(one.frequency for one in stability_selection(votes_of_noise, groups, 0)) < 0.2
    votes_of_one, groups = noisy_votes(np.random.default_rng(1), planted=7)
    found = stability_selection(votes_of_one, groups, 0)
    assert found[0].variable == "g7"
    assert found[0].first == found[0].frequency == 1.0
    assert max(one.frequency for one in found[1:]) < 0.2
