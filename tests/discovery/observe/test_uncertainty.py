"""Standard deviations of the parameters of effects."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit_state import CLASSES, replaced, with_prior
from rearl_jax.discovery.observe.uncertainty import covariance


@pytest.fixture(scope="module")
def fitted(solver, calibrated):
    """A state with a fitted effect."""
    state = replaced(calibrated[0], active=(Term("leader_acceleration"), Term("asymmetry")))
    solver.solve([state], iterations=4)
    return state


def standard_deviations(solver, state):
    return np.sqrt(np.diag(covariance(solver, state)))


def joint_information(state, located):
    """Information on all drivers' parameters, the means of the population and theta, without the prior of theta."""
    n_drivers, n_own = state.z.shape
    gram = state.sums.gram / state.variances[:, None, None]
    n_free = gram.shape[1] - n_own
    first_mean, first_theta = n_drivers * n_own, (n_drivers + CLASSES) * n_own
    joint = np.zeros((first_theta + n_free, first_theta + n_free))
    of_theta = slice(first_theta, None)
    for driver, own in enumerate(with_prior(state.own_information, state.precision)):
        of_driver = slice(driver * n_own, (driver + 1) * n_own)
        of_mean = slice(first_mean + state.truck[driver] * n_own, first_mean + (state.truck[driver] + 1) * n_own)
        joint[of_driver, of_driver] = own
        joint[of_driver, of_mean] = joint[of_mean, of_driver] = -state.precision
        joint[of_mean, of_mean] += state.precision
        joint[of_driver, of_theta] = gram[driver, :n_own, n_own:]
        joint[of_theta, of_driver] = gram[driver, n_own:, :n_own]
        joint[of_theta, of_theta] += gram[driver, n_own:, n_own:]
    for mean in range(CLASSES):
        of_mean = slice(first_mean + mean * n_own, first_mean + (mean + 1) * n_own)
        joint[of_mean, of_mean] += np.diag(located)
    return joint


def covariance_of_theta(solver, state):
    """Covariance of the searched elements of theta, from the information on all parameters together."""
    free = solver.free(state)
    joint = joint_information(state, solver.layout.prior.location_precision)
    joint[-len(free) :, -len(free) :] += np.diag(solver.layout.scale[free] ** -2.0)
    return np.linalg.inv(joint)[-len(free) :, -len(free) :]


def test_deviations_are_those_of_all_parameters_together(solver, fitted):
    expected = np.sqrt(np.diag(covariance_of_theta(solver, fitted)))
    assert (expected > 0.0).all()
    # Equal drivers have equal scores, so that only the curvature is left.
    level = replaced(fitted, z=fitted.mean[fitted.truck])
    level.sums = replace(fitted.sums, gradient=np.zeros_like(fitted.sums.gradient))
    np.testing.assert_allclose(standard_deviations(solver, level), expected, rtol=1e-6)
    np.testing.assert_allclose(covariance(solver, level), covariance_of_theta(solver, fitted), rtol=1e-5, atol=1e-12)


def test_nothing_shared_is_free_once_it_is_held(solver, fitted):
    held = replace(fitted, holds_shared=True)
    assert len(solver.free(fitted)) > 0 == len(solver.free(held))
    assert covariance(solver, held).size == 0


def test_the_scatter_of_few_drivers_is_not_multiplied_by_the_number_of_parameters(solver, fitted):
    state = replaced(fitted, z=fitted.mean[fitted.truck])
    n_drivers, n_own = state.z.shape
    gradient = np.zeros_like(fitted.sums.gradient)
    state.sums = replace(fitted.sums, gradient=gradient)
    own_scores = 1e4 * np.random.default_rng(0).normal(size=n_drivers)
    gradient[:, n_own] = own_scores * state.variances  # of the first element of theta, the others do not vary
    found = standard_deviations(solver, state)
    expected = np.abs(covariance_of_theta(solver, state)[:, 0]) * np.sqrt(n_drivers * np.var(own_scores, ddof=1))
    assert len(expected) > 3
    np.testing.assert_allclose(found, expected, rtol=1e-6)
