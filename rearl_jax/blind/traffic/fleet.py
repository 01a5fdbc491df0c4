"""Vehicles and drivers of a data set: parameters, sizes, ranks in the platoons.

All arrays are over the vehicles of all recordings, one recording after the other, lane by lane, front to back.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario


@dataclass(frozen=True)
class Fleet:
    """Drivers and vehicles.

    Attributes:
        recording: Number of the recording.
        rank: Rank in the platoon; 0 is the platoon leader.
        lane: Lane at the start; 0 is the leftmost.
        is_truck: Whether the vehicle is a truck.
        length, width: Length and width of the vehicle [m].
        desired_speed, time_gap, jam_gap, max_accel, comfort_decel: v0 [m/s], T [s], s0 [m], a, b [m/s^2].
        further: Further parameters of the car-following model, by name.
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
    further: Mapping[str, np.ndarray]

    def parameter(self, name: str) -> np.ndarray:
        """Values of a parameter of the drivers."""
        return self.further[name] if name in self.further else getattr(self, name)


def draw_fleet(scenario: Scenario, rng: np.random.Generator) -> Fleet:
    """The vehicles of all recordings."""
    per_lane = scenario.n_vehicles // scenario.n_lanes
    shape = (scenario.n_recordings, scenario.n_lanes, per_lane)
    recording, lane, rank = (axis.ravel() for axis in np.indices(shape))
    n = recording.size
    is_truck = (rng.random(n) < scenario.population.truck_share) & (rank > 0)
    values = scenario.population.draw(is_truck, scenario.spread, rng)
    length = np.where(is_truck, rng.uniform(8.0, 17.0, n), np.clip(4.6 + 0.45 * rng.standard_normal(n), 3.4, 6.0))
    width = np.where(is_truck, 2.5, 1.85 + 0.08 * rng.standard_normal(n))
    further = {name: values.pop(name) for name in tuple(values) if name not in _NAMES}
    sizes = np.round(length, 2), np.round(width, 2)
    return Fleet(recording, rank, lane, is_truck, *sizes, **values, further=further)


_NAMES = {item.name for item in fields(Fleet)}
"""Parameters with a field of their own; all others are in `Fleet.further`."""
