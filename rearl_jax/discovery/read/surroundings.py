"""Vehicles around each vehicle in every frame of a recording, as rows of its table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.core.effects.stimulus import BESIDE_RANGE
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.checks.leaders import states_all_leaders
from rearl_jax.data.vehicle_rows import VehicleRows

MOST_BESIDE = 8
"""Largest number of vehicles within BESIDE_RANGE on one adjacent lane that is evaluated."""


@dataclass(frozen=True)
class Around:
    """Vehicles around each row of a table of trajectories: their rows in it, NO_VEHICLE if there is none.

    Attributes:
        leader: Next ahead on the same lane. A leader stated by the data source takes precedence; if the source states
            all leaders (see `leaders.states_all_leaders`), no other leader is used.
        follower: Next behind on the same lane.
        left: Next ahead on the lane to the left; the same position counts as ahead.
        beside_speed: Lowest speed within BESIDE_RANGE on adjacent lanes [m/s]; inf without a vehicle.
        n_beside: Number of vehicles within BESIDE_RANGE on adjacent lanes.
    """

    leader: np.ndarray
    follower: np.ndarray
    left: np.ndarray
    beside_speed: np.ndarray
    n_beside: np.ndarray


def look_around(table: pd.DataFrame, speed: np.ndarray) -> Around:
    """Vehicles around each row.

    Args:
        table: Canonical table, sorted by track and frame.
        speed: Speed of every row [m/s].
    """
    frame = table["frame"].to_numpy()
    position = table["position"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=-1.0).astype(np.int64)
    # One number per frame, direction (fewer than 4) and lane (fewer than 15); adjacent lanes have adjacent numbers.
    lane_key = (frame - frame.min()) * 64 + table["direction"].to_numpy(np.int64) * 16 + lane + 1
    order = np.lexsort((position, lane_key))
    leader = np.full(len(table), NO_VEHICLE)
    is_ahead = (lane_key[order][1:] == lane_key[order][:-1]) & (lane[order][1:] >= 0)  # next in the order, on the lane
    leader[order[:-1][is_ahead]] = order[1:][is_ahead]
    stated = VehicleRows(table).leaders(table)
    if states_all_leaders(leader, stated):
        leader = stated
    else:
        leader = np.where(stated == NO_VEHICLE, leader, stated)
    follower = np.full(len(table), NO_VEHICLE)
    has_leader = leader != NO_VEHICLE
    follower[leader[has_leader]] = np.flatnonzero(has_leader)
    lanes_in_order = _SortedLanes(lane_key, position, order)
    left = lanes_in_order.ahead_on_left(lane)
    beside_speed, n_beside = lanes_in_order.beside(speed, lane)
    return Around(leader, follower, left, beside_speed, n_beside)


class _SortedLanes:
    """The vehicles of all frames and lanes along one line, on which the lanes of all frames follow one another."""

    def __init__(self, lane_key: np.ndarray, position: np.ndarray, order: np.ndarray) -> None:
        """`lane_key` is the lane of each row (unique over all frames, adjacent lanes consecutive), `position` its
        position [m]; `order` sorts rows by both.
        """
        self.lane_key, self.position, self.order = lane_key, position - position.min(), order
        self.length = self.position.max() + 4 * BESIDE_RANGE
        self.sorted = self.on_line(0)[order]

    def on_line(self, side: int) -> np.ndarray:
        """Position of each row's vehicle on the line [m] if moved to the lane on the left (side -1) or right (1)."""
        return (self.lane_key + side) * self.length + self.position

    def ahead_on_left(self, lane: np.ndarray) -> np.ndarray:
        """Row of the next vehicle ahead on the lane to the left."""
        row = self.order[np.minimum(np.searchsorted(self.sorted, self.on_line(-1), side="left"), len(lane) - 1)]
        is_there = (lane > 0) & (self.lane_key[row] == self.lane_key - 1) & (self.position[row] >= self.position)
        return np.where(is_there, row, NO_VEHICLE)

    def beside(self, speed: np.ndarray, lane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest speed [m/s] and number of vehicles within BESIDE_RANGE on the lanes beside each row's vehicle."""
        slowest, n_beside = np.full(len(lane), np.inf), np.zeros(len(lane))
        for side in (-1, 1):
            here = self.on_line(side)
            first = np.searchsorted(self.sorted, here - BESIDE_RANGE, side="left")
            stop = np.searchsorted(self.sorted, here + BESIDE_RANGE, side="right")
            has_lane = (lane >= 0) & (lane + side >= 0)
            for k in range(MOST_BESIDE):
                row = self.order[np.minimum(first + k, len(lane) - 1)]
                is_beside = has_lane & (first + k < stop) & (self.lane_key[row] == self.lane_key + side)
                slowest = np.where(is_beside, np.minimum(slowest, speed[row]), slowest)
                n_beside += is_beside
        return slowest, n_beside
