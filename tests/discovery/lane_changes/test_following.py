"""Drivers' parameters from their accelerations."""

import numpy as np

from rearl_jax.discovery.lane_changes.following import likely_parameters
from rearl_jax.discovery.lane_changes.incentives import acceleration
from rearl_jax.discovery.observe.drivers import IDM_PRIOR

CAR, SPREAD = np.array(IDM_PRIOR.usual_car), IDM_PRIOR.spread


def test_time_gaps_are_found_and_those_who_follow_nobody_stay_usual():
    rng = np.random.default_rng(2)
    n, each = 40, 200
    driver = np.repeat(np.arange(n), each)
    truth = CAR[:, None] * np.exp(SPREAD[:, None] * rng.normal(size=(5, n)))
    speed = rng.uniform(15, 28, n * each)
    gap = truth[1][driver] * speed * rng.uniform(0.8, 1.6, n * each)
    leader = speed + rng.normal(0, 1.0, n * each)
    led = driver > 0
    rows = acceleration("idm", truth[:, driver], speed, gap, leader, led) + 0.1 * rng.normal(size=n * each)
    usual = np.tile(CAR[:, None], (1, n * each))
    found = likely_parameters(usual, driver, speed, gap, leader, rows, led, 0.5, IDM_PRIOR)[:, ::each]
    np.testing.assert_allclose(found[:, 0], CAR)
    error = np.log(found[1, 1:] / truth[1, 1:])
    assert error.std() < 0.08 < np.log(truth[1]).std()
    # How hard all respond is the population's; who responds harder than others is seen.
    assert abs(np.log(found[3, 1:] / CAR[3]).mean()) < 0.01
    assert np.corrcoef(np.log(found[3, 1:]), np.log(truth[3, 1:]))[0, 1] > 0.7
