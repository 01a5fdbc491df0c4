"""Predictions improve with knowledge of a driver, and not with knowledge of another one."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.closed_loop import calibrated_to_gap, simulated_error
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.read.training import halves, left_out_runs
from rearl_jax.discovery.report.protocols import IN_SAMPLE, PROTOCOLS, protocol_errors


@pytest.fixture(scope="module")
def fit(calibrated):
    state, noise = calibrated
    return Fit(None, state, noise)


@pytest.fixture(scope="module")
def state(solver, fit, measured_of):
    return recalibrated(solver, measured_of(), fit)


def errors(solver, state, fit, runs=()):
    deviation = simulated_error(solver, calibrated_to_gap(solver, state))
    found = protocol_errors(solver, state, fit, deviation, runs)
    assert found.keys() == PROTOCOLS.keys()
    return found


def test_the_more_is_known_of_drivers_the_smaller_is_the_error(solver, fit, state):
    found = errors(solver, state, fit)
    population, half, own = (found[name].by_driver for name in ("population", "first_half", IN_SAMPLE))
    population = found["first_half"].population
    assert population["gap_rmse"].mean() > 3.0  # drivers differ
    for measure in half:
        assert half[measure].mean() < 0.85 * population[measure].mean()
        assert own[measure].mean() < half[measure].mean() < population[measure].mean()
    assert (half["gap_rmse"] < population["gap_rmse"]).mean() > 0.5
    assert found["other_runs"] is None


def test_other_runs_help_only_where_they_are_of_the_same_driver(solver, fit, state):
    split = halves(state.data)
    runs, n = split.training.with_drivers(split.test), state.data.n_drivers

    def mean_errors(identity):
        known = replace(runs, identity=identity[runs.driver])
        found = errors(solver, state, fit, left_out_runs(known))["other_runs"]
        assert len(found.driver) == n
        return found.by_driver["gap_rmse"].mean(), found.population["gap_rmse"].mean()

    known, population = mean_errors(np.tile(np.arange(n), 2))
    mistaken, as_usual = mean_errors(np.concatenate([np.arange(n), (np.arange(n) + n // 2) % n]))
    assert known < 0.7 * population
    assert mistaken > 1.5 * known
    assert mistaken > 0.9 * as_usual
