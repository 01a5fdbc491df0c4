"""The reward on hand values and against highway-env's own."""

import numpy as np
import pytest


@pytest.mark.parametrize(
    ("speed", "lane", "changes", "expected"),
    [
        (20.0, 0, {}, 1.0 / 1.5),  # nothing earned: R = 0
        (30.0, 3, {}, 1.0),  # all: R = 0.5
        (25.0, 0, {}, 1.2 / 1.5),
        (40.0, 0, {}, 1.4 / 1.5),
        (20.0, 3, {}, 1.1 / 1.5),
        (20.0, 0, {"target_lane": 3}, 1.1 / 1.5),  # the lane it steers to counts
        (10.0, 0, {"crashed": True}, 0.0),
        (30.0, 3, {"crashed": True}, 0.5 / 1.5),
        (25.0, 0, {"heading": np.pi / 3}, 1.0 / 1.5),  # 12.5 m/s along the road
    ],
)
def test_hand_values(model, speed, lane, changes, expected):
    from rearl_jax.core.state import make_state
    from rearl_jax.decision.reward import reward

    column = {name: np.array([[value]]) for name, value in changes.items()}
    state = make_state(np.array([[100.0]]), np.array([[4.0 * lane]]), np.array([[speed]]), model, **column)
    assert float(reward(state, model)[0, 0]) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("x", "y", "pays"), [(5.0, 13.9, True), (5.0, 14.1, False), (5.0, -2.1, False)])
def test_nothing_off_the_road(model, x, y, pays):
    from rearl_jax.core.state import make_state
    from rearl_jax.decision.reward import reward

    state = make_state(np.array([[x]]), np.array([[y]]), np.array([[30.0]]), model)
    assert (float(reward(state, model)[0, 0]) > 0) == pays


def test_against_highway_env(wild, model):
    from highway_env.envs.highway_env import HighwayEnv
    from highway_env.vehicle.controller import MDPVehicle

    from rearl_jax.decision.reward import reward

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
