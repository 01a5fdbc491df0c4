"""Our vehicles once more, on a road of highway-env's."""

import numpy as np


def road_of_four_lanes():
    """An environment of highway-env whose vehicles may be exchanged."""
    from highway_env.envs.highway_env import HighwayEnv

    env = HighwayEnv({"lanes_count": 4, "vehicles_count": 1})
    env.reset(seed=0)
    return env


def put_on_road(env, state, scenario):
    """The vehicles that are present in a scenario, put on the road: number and twin of each."""
    from highway_env.vehicle.controller import MDPVehicle

    present = np.flatnonzero(np.asarray(state.controller)[:, scenario] != 0)
    env.road.vehicles = [
        MDPVehicle(
            env.road,
            [float(state.x[i, scenario]), float(state.y[i, scenario])],
            heading=float(state.heading[i, scenario]),
            speed=float(state.speed[i, scenario]),
        )
        for i in present
    ]
    return list(zip(present, env.road.vehicles, strict=True))
