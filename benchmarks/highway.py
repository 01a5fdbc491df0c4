"""highway-env as the subject of a measurement: its road and its vehicles, without the environment around them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle

from rearl_jax.timing.measurement import TICKS_PER_SECOND, Measurement, Stopwatch

N_LANES = 4
SPEED_LIMIT = 30.0
"""Speed limit [m/s]. Source: highway-env 1.12.1, `HighwayEnv`."""


class HighwayRoads:
    """Scenes drawn as `highway-v0` draws its traffic; `Road.act` and `Road.step` are measured."""

    facts: Mapping[str, float | int] = {"unit": 1}

    def __init__(self, n_vehicles: int, seconds: int, density: float, cpu_s: float) -> None:
        """Nothing is simulated yet; arguments as in `HighJaxRoads`."""
        self._n_vehicles, self._seconds, self._density, self._cpu_s = n_vehicles, seconds, density, cpu_s

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of `n_scenarios` scenes, simulated for fewer seconds if they would take longer than `cpu_s`."""
        watch = Stopwatch()
        roads = [self._draw(np.random.default_rng([seed, number])) for number in range(n_scenarios)]
        lanes = [_lanes(road) for road in roads]
        lane_changes = seconds = 0
        while seconds < self._seconds and watch.cpu_s < self._cpu_s:
            with watch:
                for road in roads:
                    for _ in range(TICKS_PER_SECOND):
                        road.act()
                        road.step(1 / TICKS_PER_SECOND)
            seconds += 1
            earlier_lanes, lanes = lanes, [_lanes(road) for road in roads]
            if seconds > 1:
                lane_changes += int(np.count_nonzero(np.not_equal(earlier_lanes, lanes)))
        vehicles = [vehicle for road in roads for vehicle in road.vehicles]
        return Measurement(
            n_scenarios=n_scenarios,
            seconds=seconds,
            n_substeps=len(vehicles) * seconds * TICKS_PER_SECOND,
            cpu_s=watch.cpu_s,
            wall_s=watch.wall_s,
            mean_speed=float(np.mean([vehicle.speed for vehicle in vehicles])),
            lane_changes=lane_changes,
            crashed=sum(vehicle.crashed for vehicle in vehicles),
        )

    def _draw(self, random: Any) -> Road:
        """A road as `HighwayEnv` fills it; `random` is a `np.random.Generator`, which highway-env accepts."""
        network = RoadNetwork.straight_road_network(N_LANES, speed_limit=SPEED_LIMIT)
        road = Road(network=network, np_random=random, record_history=False)
        for _ in range(self._n_vehicles):
            vehicle: Any = IDMVehicle.create_random(road, spacing=1 / self._density)
            vehicle.randomize_behavior()
            road.vehicles.append(vehicle)
        return road


def _lanes(road: Road) -> list[int]:
    return [vehicle.lane_index[2] for vehicle in road.vehicles]
