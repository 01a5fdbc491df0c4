"""The reward against highway-env's own."""

import numpy as np
from highway_env.envs.highway_env import HighwayEnv
from highway_env.vehicle.controller import MDPVehicle

from rearl_jax.decision.reward import reward


def test_against_highway_env(wild, model):
    env = HighwayEnv({"lanes_count": 4, "vehicles_count": 1})
    env.reset(seed=0)
    ours = np.asarray(reward(wild, model))
    theirs = np.full(ours.shape, np.nan)
    for i, j in np.argwhere(np.asarray(wild.controller) != 0):
        vehicle = MDPVehicle(
            env.road,
            [float(wild.x[i, j]), float(wild.y[i, j])],
            heading=float(wild.heading[i, j]),
            speed=float(wild.speed[i, j]),
            target_lane_index=("0", "1", int(wild.target_lane[i, j])),
        )
        vehicle.crashed = bool(wild.crashed[i, j])
        env.vehicle = vehicle
        theirs[i, j] = env._reward(1)
    is_there = np.isfinite(theirs)
    assert 0 < (theirs[is_there] == 0).sum() < 30  # off the road
    assert len(np.unique(theirs[is_there])) > 25
    np.testing.assert_allclose(ours[is_there], theirs[is_there], atol=1e-12)
