"""Drivers' parameters: those that are known, and the likely ones by their accelerations."""

import numpy as np

from rearl_jax.discovery.lane_changes.incentives import KnownDrivers, acceleration, likely_parameters
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.observe.fit_state import new_state
from rearl_jax.discovery.observe.noise import USUAL


def test_calibrated_drivers_keep_their_own_parameters_and_others_get_their_populations(measured_of, solver):
    data = measured_of()
    state = new_state(data, solver.layout, USUAL)
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


def test_time_gaps_are_found_and_those_who_follow_nobody_stay_usual():
    rng, car, spread = np.random.default_rng(2), np.array(IDM_PRIOR.usual_car), IDM_PRIOR.spread
    n, each = 40, 200
    driver = np.repeat(np.arange(n), each)
    truth = car[:, None] * np.exp(spread[:, None] * rng.normal(size=(5, n)))
    speed = rng.uniform(15, 28, n * each)
    gap = truth[1][driver] * speed * rng.uniform(0.8, 1.6, n * each)
    leader = speed + rng.normal(0, 1.0, n * each)
    led = driver > 0
    rows = acceleration("idm", truth[:, driver], speed, gap, leader, led) + 0.1 * rng.normal(size=n * each)
    usual = np.tile(car[:, None], (1, n * each))
    found = likely_parameters(usual, driver, speed, gap, leader, rows, led, 0.5, IDM_PRIOR)[:, ::each]
    np.testing.assert_allclose(found[:, 0], car)
    error = np.log(found[1, 1:] / truth[1, 1:])
    assert error.std() < 0.08 < np.log(truth[1]).std()
    # How hard all respond is the population's; who responds harder than others is seen.
    assert abs(np.log(found[3, 1:] / car[3]).mean()) < 0.01
    assert np.corrcoef(np.log(found[3, 1:]), np.log(truth[3, 1:]))[0, 1] > 0.7
