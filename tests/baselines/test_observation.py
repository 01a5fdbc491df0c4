"""Observations against a plain reading, and against highway-env's own."""

import numpy as np
from highway_env.envs.common.observation import KinematicObservation

from rearl_jax.baselines.observation import RANGES, observe_neighbours
from rearl_jax.core.state import make_state
from tests.highway_env_twins import put_on_road, road_of_four_lanes


def plain_observation(state, vehicle, scenario):
    """The same, vehicle by vehicle."""
    x, y, v, h = (np.asarray(values)[:, scenario] for values in (state.x, state.y, state.speed, state.heading))
    is_there = np.asarray(state.controller)[:, scenario] != 0
    vx, vy = v * np.cos(h), v * np.sin(h)
    found = [[1.0, 0.0, y[vehicle] / 16, vx[vehicle] / 30, vy[vehicle] / 30]]
    others = []
    for other in range(len(x)):
        near = np.hypot(x[other] - x[vehicle], y[other] - y[vehicle]) < 200
        if other != vehicle and is_there[other] and near:
            others.append((abs(x[other] - x[vehicle]), other))
    for _, other in sorted(others)[:4]:
        dx, dy = x[other] - x[vehicle], y[other] - y[vehicle]
        found.append([1.0, dx / 100, dy / 16, (vx[other] - vx[vehicle]) / 30, (vy[other] - vy[vehicle]) / 30])
    found += [[0.0] * 5] * (5 - len(found))
    return np.clip(found, -1, 1).ravel()


def test_against_a_plain_reading(wild):
    observation = np.asarray(observe_neighbours(wild))
    assert observation.shape == (25, *wild.x.shape)
    assert observation.dtype == np.float32
    rows = observation.reshape(5, 5, *wild.x.shape)
    n_seen = rows[:, 0].sum(axis=0)
    assert set(np.unique(n_seen)) >= {2, 3, 4, 5}  # some see few
    assert (np.abs(rows[1:, 1]) == 1).any()  # some are beyond the range
    assert (rows[1:, 1] < 0).any()
    for scenario in range(wild.x.shape[1]):
        for vehicle in np.flatnonzero(np.asarray(wild.controller)[:, scenario] != 0):
            expected = plain_observation(wild, vehicle, scenario)
            np.testing.assert_allclose(observation[:, vehicle, scenario], expected, atol=1e-6)


def test_against_highway_env(wild):
    """highway-env's Kinematics with our ranges, but for the observer's x, which it gives from the start of the road."""
    env = road_of_four_lanes()
    observation = np.asarray(observe_neighbours(wild))
    ranges = {name: [-reach, reach] for name, reach in RANGES.items()}
    n_compared = 0
    for scenario in range(wild.x.shape[1]):
        for vehicle, twin in put_on_road(env, wild, scenario):
            theirs = KinematicObservation(env, features_range=ranges, see_behind=True)
            theirs.observer_vehicle = twin
            expected = theirs.observe()
            expected[0, 1] = 0.0
            ours = observation[:, vehicle, scenario].reshape(5, 5)
            np.testing.assert_allclose(ours, expected, atol=1e-6)
            n_compared += 1
    assert n_compared > 80


def test_nobody_else(model):
    state = make_state(np.array([[50.0]]), np.array([[8.0]]), np.array([[15.0]]), model)
    np.testing.assert_allclose(observe_neighbours(state)[:, 0, 0], [1, 0, 0.5, 0.5, 0, *[0] * 20])
