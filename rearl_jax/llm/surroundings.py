"""Neighbours of the given vehicles in one frame, ahead and behind, on their lane and the two adjacent ones."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.core.model import ROAD_END_MARGIN, TrafficModel
from rearl_jax.core.neighbours import LANE_MARGIN
from rearl_jax.core.rollout import Frames

PLACES = ("same lane ahead", "same lane behind", "left ahead", "left behind", "right ahead", "right behind")
"""Order of the places in `Surroundings`."""


class Surroundings(NamedTuple):
    """The nearest vehicle at each of the `PLACES` around some vehicles.

    Attributes:
        gap: Bumper-to-bumper gap [m], negative if the two are side by side; inf without a vehicle.
        speed: Speed of the neighbour [m/s].
        relative_speed: Speed of the neighbour minus that of the vehicle [m/s].
    """

    gap: Float[np.ndarray, "places asked"]
    speed: Float[np.ndarray, "places asked"]
    relative_speed: Float[np.ndarray, "places asked"]


def look_around(
    frame: Frames,
    length: np.ndarray | float,
    vehicle: Int[np.ndarray, " asked"],
    scenario: Int[np.ndarray, " asked"],
    model: TrafficModel,
) -> Surroundings:
    """The nearest vehicles around the given ones: those with the smallest gaps.

    For vehicles of equal length they are those of the traffic model (`core.neighbours`), which compares the distances
    of centres. As there, a vehicle between two lanes is on both, the same position counts as ahead, and vehicles beyond
    the road are left out.

    Lengths [m] broadcast to `[n_vehicles, n_scenarios]`, `vehicle` and `scenario` are rows and columns.
    """
    length = np.broadcast_to(np.asarray(length, frame.x.dtype), frame.x.shape)
    own_x, own_lane, own_length = (values[vehicle, scenario] for values in (frame.x, frame.lane, length))
    gap = np.full((len(PLACES), len(vehicle)), np.inf, frame.x.dtype)
    speed = np.zeros_like(gap)
    lanes = [own_lane + side for side in (0, -1, 1)]
    exists = [(lane >= 0) & (lane < model.n_lanes) for lane in lanes]
    for other in range(len(frame.x)):
        x, y = frame.x[other, scenario], frame.y[other, scenario]
        is_visible = (x >= -ROAD_END_MARGIN) & (x < model.road_length + ROAD_END_MARGIN) & (vehicle != other)
        distance = x - own_x
        other_gap = np.abs(distance) - (length[other, scenario] + own_length) / 2
        for number, (lane, there) in enumerate(zip(lanes, exists, strict=True)):
            is_on = is_visible & there & (np.abs(y - lane * model.lane_width) <= model.lane_width / 2 + LANE_MARGIN)
            for place, is_that_way in ((2 * number, distance >= 0), (2 * number + 1, distance < 0)):
                is_nearer = is_on & is_that_way & (other_gap < gap[place])
                gap[place] = np.where(is_nearer, other_gap, gap[place])
                speed[place] = np.where(is_nearer, frame.speed[other, scenario], speed[place])
    return Surroundings(gap, speed, speed - frame.speed[vehicle, scenario])
