"""Whose parameters are known."""

import numpy as np

from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.observe.noise import USUAL
from rearl_jax.discovery.observe.solver import new_state


def test_calibrated_drivers_keep_their_own_parameters_and_others_get_their_populations(measured_of, solver):
    data = measured_of()
    state = new_state(data, solver.layout, USUAL.gain(data.dt))
    rng = np.random.default_rng(1)
    state.z, state.mean = rng.normal(size=state.z.shape), rng.normal(size=state.mean.shape)
    known = KnownDrivers.of([state], IDM_PRIOR)
    expected = IDM_PRIOR.drivers(state.z[data.driver].T, data.is_truck.astype(float))
    found = known.of_vehicles(data.vehicle, data.is_truck)
    np.testing.assert_allclose(found[1], np.asarray(expected.time_gap))
    np.testing.assert_allclose(found[4], np.asarray(expected.comfort_decel))
    assert known.is_known(data.vehicle).all()
    strangers = np.array([90_001, 90_002])
    assert not known.is_known(strangers).any()
    population = IDM_PRIOR.drivers(state.mean.T, np.array([0.0, 1.0]))
    found = known.of_vehicles(strangers, np.array([False, True]))
    np.testing.assert_allclose(found[0], np.asarray(population.desired_speed))


def test_nobody_calibrated_means_usual_values():
    found = KnownDrivers.of([], IDM_PRIOR).of_vehicles(np.array([1, 2]), np.array([False, True]))
    np.testing.assert_allclose(found, IDM_PRIOR.usual.T)
