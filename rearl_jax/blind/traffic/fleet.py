"""Vehicles and drivers of a data set: parameters of the Intelligent Driver Model, sizes, places in the platoons.

All arrays are over the vehicles of all recordings, one recording after the other, lane by lane, front to back.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario

# Median and standard deviation of the logarithm over drivers. Source: values and spreads as in calibrations on
# motorway trajectories (Kesting & Treiber, Transp. Res. Rec. 2088 (2008) 148).
CARS = {
    "desired_speed": (32.0, 0.12),
    "time_gap": (1.25, 0.30),
    "jam_gap": (2.5, 0.30),
    "max_accel": (1.4, 0.30),
    "comfort_decel": (2.0, 0.35),
}
TRUCKS = CARS | {"desired_speed": (25.0, 0.06), "time_gap": (1.6, 0.25), "max_accel": (0.9, 0.20)}
TRUCK_SHARE = 0.15
BOUNDS = {
    "desired_speed": (18.0, 50.0),
    "time_gap": (0.5, 3.0),
    "jam_gap": (1.0, 6.0),
    "max_accel": (0.5, 3.0),
    "comfort_decel": (0.8, 5.0),
}


@dataclass(frozen=True)
class Fleet:
    """Drivers and vehicles.

    Attributes:
        recording: Number of the recording.
        rank: Place in the platoon; 0 is the platoon leader.
        lane: Lane at the start; 0 is the leftmost.
        is_truck: Whether the vehicle is a truck.
        length, width: Length and width of the vehicle [m].
        desired_speed, time_gap, jam_gap, max_accel, comfort_decel: v0 [m/s], T [s], s0 [m], a, b [m/s^2].
    """

    recording: np.ndarray
    rank: np.ndarray
    lane: np.ndarray
    is_truck: np.ndarray
    length: np.ndarray
    width: np.ndarray
    desired_speed: np.ndarray
    time_gap: np.ndarray
    jam_gap: np.ndarray
    max_accel: np.ndarray
    comfort_decel: np.ndarray


def draw_fleet(scenario: Scenario, rng: np.random.Generator) -> Fleet:
    """The vehicles of all recordings."""
    per_lane = scenario.n_vehicles // scenario.n_lanes
    shape = (scenario.n_recordings, scenario.n_lanes, per_lane)
    recording, lane, rank = (axis.ravel() for axis in np.indices(shape))
    n = recording.size
    is_truck = (rng.random(n) < TRUCK_SHARE) & (rank > 0)
    values = {}
    for name, (median, sd) in CARS.items():
        truck_median, truck_sd = TRUCKS[name]
        deviation = scenario.spread * rng.standard_normal(n)
        drawn = np.where(is_truck, truck_median * np.exp(truck_sd * deviation), median * np.exp(sd * deviation))
        values[name] = np.clip(drawn, *BOUNDS[name])
    length = np.where(is_truck, rng.uniform(8.0, 17.0, n), np.clip(4.6 + 0.45 * rng.standard_normal(n), 3.4, 6.0))
    width = np.where(is_truck, 2.5, 1.85 + 0.08 * rng.standard_normal(n))
    return Fleet(recording, rank, lane, is_truck, np.round(length, 2), np.round(width, 2), **values)
