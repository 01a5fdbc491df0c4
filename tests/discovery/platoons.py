"""Platoons of highway-env's IDM drivers: a generator that shares nothing with ours, and has calm leaders.

`python -m tests.discovery.platoons FOLDER WHAT [SEED [DRIVER_NOISE [POSITION_NOISE]]]` writes plain tables.

WHAT is one of `nothing`, `leader_acceleration` (.4 of it) and `speed_limit` (17 m/s from 900 to 1,300 m). Noises are
standard deviations, of the acceleration [m/s^2] (.15) and of positions [m] (.1).
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

HIDDEN = ("nothing", "leader_acceleration", "speed_limit")
LANES, FOLLOWERS, RECORDINGS = 3, 12, 3
DURATION, WARM_UP, STEP = 60.0, 20.0, 1 / 15
NOISE_TIME = 1.0
"""Correlation time of the drivers' noise [s]."""


def write_platoons(folder: Path, what: str, seed: int = 21, driver_noise: float = 0.15, position_noise: float = 0.1):
    """Tables of platoons that follow first vehicles whose speed swings slowly about 20 m/s."""
    if what not in HIDDEN:
        raise ValueError(f"{what!r} is none of {', '.join(HIDDEN)}")
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    for recording in range(RECORDINGS):
        rows = _rows(what, driver_noise, rng)
        _measured(rows, position_noise, rng).assign(recording=f"r{recording}").to_csv(
            folder / f"r{recording}.csv", index=False
        )


def _driver(what: str, driver_noise: float, rng: np.random.Generator):
    """highway-env's IDM driver with parameters of its own, noise, and what is hidden."""
    from highway_env.vehicle.behavior import IDMVehicle

    class Driver(IDMVehicle):
        def __init__(self, road, position, speed):
            usual_speed = float(np.clip(rng.normal(28, 3), 18, 40))
            super().__init__(road, position, speed=speed, target_speed=usual_speed, enable_lane_change=False)
            self.usual_speed, self.push = usual_speed, 0.0
            self.TIME_WANTED = np.clip(rng.normal(1.4, 0.3), 0.7, 2.5)
            self.COMFORT_ACC_MAX = np.clip(rng.normal(1.3, 0.3), 0.6, 2.5)
            self.COMFORT_ACC_MIN = -np.clip(rng.normal(2.0, 0.4), 1, 4)
            self.DISTANCE_WANTED = self.LENGTH + np.clip(rng.normal(2.2, 0.5), 1, 4)

        def acceleration(self, ego_vehicle, front_vehicle=None, rear_vehicle=None):
            wanted = super().acceleration(ego_vehicle, front_vehicle, rear_vehicle)
            if what == "leader_acceleration" and front_vehicle is not None:
                wanted += 0.4 * front_vehicle.action["acceleration"]
            shock = driver_noise * np.sqrt(2 * STEP / NOISE_TIME) * rng.standard_normal()
            self.push += shock - self.push * STEP / NOISE_TIME
            return wanted + self.push

        def act(self, action=None):
            limited = what == "speed_limit" and 900 < self.position[0] < 1300
            self.target_speed = min(self.usual_speed, 17.0) if limited else self.usual_speed
            return super().act(action)

    return Driver


def _rows(what: str, driver_noise: float, rng: np.random.Generator) -> pd.DataFrame:
    """Every vehicle at every step after the warm-up, exact."""
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.kinematics import Vehicle

    network = RoadNetwork.straight_road_network(LANES, length=20_000, speed_limit=60)
    road = Road(network, np_random=np.random.RandomState(rng.integers(1 << 30)))
    driver, first = _driver(what, driver_noise, rng), []
    for lane in range(LANES):
        x = 600.0
        first.append(
            (
                Vehicle(road, [x, 4.0 * lane], speed=20),
                *rng.uniform([[0], [0.12], [0.1]], [[6.3], [0.7], [0.35]], (3, 6)),
            )
        )
        road.vehicles.append(first[-1][0])
        for _ in range(FOLLOWERS):
            x -= rng.uniform(28, 45)
            road.vehicles.append(driver(road, [x, 4.0 * lane], 20 + rng.normal()))
    rows = []
    for step in range(round((WARM_UP + DURATION) / STEP)):
        for vehicle, phase, frequency, size in first:
            swing = (size * np.sin(frequency * step * STEP + phase)).sum()
            vehicle.action = {"acceleration": float(swing - 0.1 * (vehicle.speed - 20)), "steering": 0}
        for vehicle in road.vehicles:
            if isinstance(vehicle, driver):
                vehicle.act()
        frame = step - round(WARM_UP / STEP)
        if frame >= 0:
            rows += [
                (k, frame, *one.position, one.speed, one.action["acceleration"]) for k, one in enumerate(road.vehicles)
            ]
        for vehicle in road.vehicles:  # `road.step` without its test for collisions, of which there are none
            vehicle.step(STEP)
    return pd.DataFrame(rows, columns=["track_id", "frame", "x", "y", "speed", "acceleration"])


def _measured(rows: pd.DataFrame, noise: float, rng: np.random.Generator) -> pd.DataFrame:
    """The released table of a camera: positions with noise, speeds and accelerations derived from them."""
    table = rows.sort_values(["track_id", "frame"], ignore_index=True)
    if noise > 0:
        table["x"] += noise * rng.standard_normal(len(table))
        for name, order in (("speed", 1), ("acceleration", 2)):
            table[name] = table.groupby("track_id")["x"].transform(lambda x, n=order: savgol_filter(x, 15, 2, n, STEP))
    lane = (table["y"] / 4.0).round().astype(int)
    return table.assign(
        time=table["frame"] * STEP, position=table["x"], lateral=table["y"], lane=lane, direction=1,
        length=5.0, width=2.0, vehicle_class="car",
    )  # fmt: skip


if __name__ == "__main__":
    write_platoons(Path(sys.argv[1]), sys.argv[2], *map(int, sys.argv[3:4]), *map(float, sys.argv[4:6]))
