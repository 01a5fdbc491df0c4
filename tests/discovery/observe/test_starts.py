"""Calibration from two starts: a driver whose free-road response hides how it follows is found all the same."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config.driver import record_of
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.fit_state import new_state, replaced
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP
from rearl_jax.discovery.observe.noise import USUAL
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.observe.starts import from_best_start

NOISE = 0.02
"""Of the measured positions [m]."""

DRIVERS = {"desired_speed": 32.6, "time_gap": 1.86, "jam_gap": 4.9, "max_accel": 1.5, "comfort_decel": 0.9}
"""Parameters of the drivers."""

SLOW = {"desired_speed": 0.5, "max_accel": 0.3, "time_gap": 0.5, "jam_gap": 0.4, "comfort_decel": 3.0}
"""Factors of the parameters at the start [-]: the free-road response is the smaller one everywhere."""


@pytest.fixture(scope="module")
def gentle(measured_of):
    """The solver of Gipps' model, gentle drivers who drive by it behind measured leaders, and their true parameters."""
    data, prior = measured_of(), prior_of(record_of("gipps")())
    solver = solver_of(data, prior)
    state = new_state(data, solver.layout, USUAL)
    mean = np.log(np.array([[DRIVERS[name] for name in prior.names]]) / prior.usual) / prior.spread
    state.z = mean[state.truck] + 0.3 * np.random.default_rng(2).normal(size=state.z.shape)
    (left,) = solver.innovations([state], CLOSED_LOOP)
    places = data.y - np.asarray(left, float) + NOISE * np.random.default_rng(3).normal(size=data.y.shape)
    return solver, replace(data, y=places, noise=NOISE), state


def test_drivers_leave_the_start_in_which_they_never_respond_to_their_leader(gentle):
    solver, data, true = gentle
    prior = solver.layout.prior
    slow = np.array([DRIVERS[name] * SLOW.get(name, 1.0) for name in prior.names])
    start = new_state(data, solver.layout, replace(USUAL, position=NOISE))
    start.mean[:] = np.log(slow / prior.usual) / prior.spread
    start.z = start.mean[start.truck]
    alone = replaced(start)
    solver.solve([alone], iterations=10, tolerance=1.0)
    found = from_best_start(solver, start, iterations=10)
    place = prior.names.index("time_gap")
    errors = [np.abs(state.z - true.z)[:, place].max() for state in (alone, found)]
    assert errors[0] > 1.0  # one start is not enough
    assert errors[1] < 0.3
    assert found.objective < alone.objective - 20.0
