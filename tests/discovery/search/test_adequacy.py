"""Tests whether drivers' deviations from the model are noise or a response to what the model wants."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config import DiscoverConfig
from rearl_jax.discovery.observe.fit_state import with_noise
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.parts import measured_drivers
from rearl_jax.discovery.observe.residuals import residuals_of
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.search.adequacy import (
    by_noise_alone,
    misjudgement,
    neighbour_autocorrelation,
    staleness,
)
from rearl_jax.discovery.search.simulated_drives import noise_alone
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.discovery.search.searches import ADEQUATE


def growth_in(data, solver, calibrated):
    state, noise = calibrated
    parts, chance = [residuals_of(solver, state, noise)], by_noise_alone(solver, [state], noise, 7)
    assert np.abs(parts[0].acceleration).max() > 0.01, "drivers did nothing beside the model"
    return misjudgement(parts, chance), staleness(parts, chance)


def test_noise_does_not_ask_what_the_model_wants(measured_of, solver, calibrated):
    assert max(growth_in(measured_of(), solver, calibrated)) < THRESHOLDS.growth_z_score


@pytest.mark.parametrize("name", ["action_points", "perception_noise"])
def test_old_decisions_and_misjudged_gaps_do(measured_of, name):
    data = measured_of(name)
    solver = solver_of(data)
    assert max(growth_in(data, solver, calibrate(solver, data))) > 2.0


@pytest.mark.slow
def test_every_driver_has_a_vote_whichever_part_they_are_in(measured_of):
    data = measured_of("action_points")
    solver = solver_of(data)
    state, noise = calibrate(solver, data)
    left = residuals_of(solver, state, noise)
    chance = [again for (again,) in by_noise_alone(solver, [state], noise, 7)]
    for ask in (misjudgement, staleness):
        alone = ask([left], [[again] for again in chance])
        assert alone != 0.0
        assert ask([left, left], [[again, again] for again in chance]) == pytest.approx(np.sqrt(2) * alone)


def test_restless_drivers_are_not_taken_for_late_ones(solver, calibrated):
    """The speed that noise leaves changes what drivers want, just where the noise has been large."""
    state, noise = calibrated
    restless = replace(noise, acceleration=1.0)
    (again,) = next(noise_alone(solver, state, restless, 1, 3))
    again = with_noise(again, restless)
    solver.solve([again])
    left = residuals_of(solver, again, restless)
    chance = [parts for seed in (7, 8) for parts in by_noise_alone(solver, [again], restless, seed)]
    silent = [[replace(left, acceleration=np.zeros_like(left.acceleration))]]
    by_chance = [staleness(parts, silent) for parts in chance]
    assert np.mean(by_chance) > 3 * np.std(by_chance) / np.sqrt(len(by_chance))
    assert abs(staleness([left], chance)) < staleness([left], silent)


@pytest.mark.slow
def test_the_right_model_of_smoothed_drives_leaves_correlated_innovations(recordings_of):
    """Noise alone, smoothed alike, correlates them as much: that is no misfit."""
    _, data = measured_drivers(recordings_of("smoothing"), DiscoverConfig())
    assert data.kernel.deviation > 0.2
    solver = solver_of(data)
    state, noise = calibrate(solver, data)
    measured = neighbour_autocorrelation(residuals_of(solver, state, noise))
    by_noise = np.mean([neighbour_autocorrelation(again) for (again,) in by_noise_alone(solver, [state], noise, 7)])
    assert measured > THRESHOLDS.most_autocorrelation
    assert abs(measured - by_noise) < THRESHOLDS.most_autocorrelation


def test_innovations_of_sharp_drives_are_independent(solver, many):
    state, noise = many
    solver.sums([state])
    for again in ([residuals_of(solver, state, noise)], *by_noise_alone(solver, [state], noise, 7)):
        assert abs(neighbour_autocorrelation(again[0])) < 0.5 * THRESHOLDS.most_autocorrelation


@pytest.mark.parametrize(
    ("figures", "expected"),
    [
        ({}, True),
        ({"autocorrelation": 0.3}, False),
        ({"autocorrelation": -0.3}, False),
        ({"autocorrelation": 0.3, "autocorrelation_by_noise": 0.28}, True),
        ({"autocorrelation": 0.01, "autocorrelation_by_noise": 0.28}, True),
        ({"autocorrelation": -0.11, "autocorrelation_by_noise": 0.28}, False),
        ({"autocorrelation": 0.04, "autocorrelation_by_noise": -0.15}, True),
        ({"autocorrelation": 0.14, "autocorrelation_by_noise": -0.08}, False),
        ({"autocorrelation": -0.3, "autocorrelation_by_noise": -0.15}, False),
        ({"misjudgement": 3.6}, False),
        ({"staleness": 3.6}, False),
        ({"staleness": 5.2, "driver_minutes": 700.0}, True),
        ({"staleness": 9.0, "driver_minutes": 700.0}, False),
        ({"kurtosis": 0.5}, False),
        ({"kurtosis": 0.5, "kurtosis_before": 2.0}, True),
    ],
)
def test_what_is_left_is_adequate_only_if_it_is_noise(figures, expected):
    assert replace(ADEQUATE, **figures).is_adequate is expected
