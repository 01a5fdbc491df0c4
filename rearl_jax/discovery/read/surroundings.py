"""Vehicles around each vehicle in every frame of a recording, as rows of its table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.core.effects.stimulus import BESIDE_RANGE
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.checks.leaders import states_all_leaders
from rearl_jax.data.vehicle_rows import VehicleRows

MOST_BESIDE = 8
"""Largest number of vehicles on one lane that is evaluated within BESIDE_RANGE."""


@dataclass(frozen=True)
class Around:
    """Rows of the surrounding vehicles; NO_VEHICLE if there is none.

    Attributes:
        leader: Next ahead on the same lane. A leader stated by the data source takes precedence; if the source states
            all leaders (see `leaders.states_all_leaders`), no other leader is used.
        follower: Next behind on the same lane.
        left: Next ahead on the lane to the left; the same position counts as ahead.
        beside_speed: Slowest speed within BESIDE_RANGE on adjacent lanes [m/s]; inf without a vehicle.
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
    # One number per frame, direction and lane; adjacent lanes have adjacent numbers.
    lane_key = (frame - frame.min()) * 64 + table["direction"].to_numpy(np.int64) * 16 + lane + 1
    order = np.lexsort((position, lane_key))
    leader = np.full(len(table), NO_VEHICLE)
    same = (lane_key[order][1:] == lane_key[order][:-1]) & (lane[order][1:] >= 0)
    leader[order[:-1][same]] = order[1:][same]
    stated = VehicleRows(table).leaders(table)
    if states_all_leaders(leader, stated):
        leader = stated
    else:
        leader = np.where(stated == NO_VEHICLE, leader, stated)
    follower = np.full(len(table), NO_VEHICLE)
    followed = leader != NO_VEHICLE
    follower[leader[followed]] = np.flatnonzero(followed)
    lanes_in_order = _SortedLanes(lane_key, position, order)
    left = lanes_in_order.ahead_on_left(lane)
    slowest, n_beside = lanes_in_order.beside(speed, lane)
    return Around(leader, follower, left, slowest, n_beside)


class _SortedLanes:
    """All lanes of all frames in one sorted array, with an offset per lane and frame larger than any road."""

    def __init__(self, lane_key: np.ndarray, position: np.ndarray, order: np.ndarray) -> None:
        """Stores each row's lane number (unique over all frames, adjacent lanes consecutive) and the sorted order."""
        self.lane_key, self.position, self.order = lane_key, position - position.min(), order
        self.length = self.position.max() + 4 * BESIDE_RANGE
        self.sorted = self.places(0)[order]

    def places(self, side: int) -> np.ndarray:
        """Place of each row in the order of the adjacent lane; side -1 is left."""
        return (self.lane_key + side) * self.length + self.position

    def ahead_on_left(self, lane: np.ndarray) -> np.ndarray:
        """Row of the next vehicle ahead on the lane to the left."""
        place = np.minimum(np.searchsorted(self.sorted, self.places(-1), side="left"), len(lane) - 1)
        row = self.order[place]
        is_there = (lane > 0) & (self.lane_key[row] == self.lane_key - 1) & (self.position[row] >= self.position)
        return np.where(is_there, row, NO_VEHICLE)

    def beside(self, speed: np.ndarray, lane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slowest speed and number of vehicles beside each row's vehicle."""
        slowest, n_beside = np.full(len(lane), np.inf), np.zeros(len(lane))
        for side in (-1, 1):
            places = self.places(side)
            first = np.searchsorted(self.sorted, places - BESIDE_RANGE, side="left")
            last = np.searchsorted(self.sorted, places + BESIDE_RANGE, side="right")
            known = (lane >= 0) & (lane + side >= 0)
            for k in range(MOST_BESIDE):
                row = self.order[np.minimum(first + k, len(lane) - 1)]
                is_beside = known & (first + k < last) & (self.lane_key[row] == self.lane_key + side)
                slowest = np.where(is_beside, np.minimum(slowest, speed[row]), slowest)
                n_beside += is_beside
        return slowest, n_beside
