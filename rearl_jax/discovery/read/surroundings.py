"""Vehicles around each vehicle in every frame of a recording, as rows of its table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from rearl_jax.core.effects.stimulus import BESIDE_RANGE
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.checks.leaders import leader_rows

MOST_BESIDE = 8
"""Largest number of vehicles within BESIDE_RANGE on one adjacent lane that is evaluated."""

_LANES = 64
"""Stride of lane numbers: more lanes than any carriageway has, with room for adjacent lanes."""


class SortedLanes:
    """The vehicles of a table on one line, on which the lanes of all frames and directions follow one another."""

    def __init__(self, table: pd.DataFrame) -> None:
        """The table has `frame`, `direction`, `lane` and `position` [m]; rows may have no lane."""
        frame, position = table["frame"].to_numpy(), table["position"].to_numpy()
        self.lane = table["lane"].to_numpy(dtype=np.float64, na_value=-1.0).astype(np.int64)
        # One number per frame, direction and lane; adjacent lanes have adjacent numbers, and directions are below 4.
        carriageway = (frame - frame.min()) * 4 + table["direction"].to_numpy(np.int64)
        self.lane_key = carriageway * _LANES + self.lane + 1
        self.lane_keys = np.unique(self.lane_key)
        self.position, self.length = position - position.min(), np.ptp(position) + 4 * BESIDE_RANGE
        self.order = np.lexsort((position, self.lane_key))
        self.sorted = self._on_line(0)[self.order]

    def ahead(self, side: int) -> Int[np.ndarray, " rows"]:
        """The next vehicle ahead of each on the lane to the left (-1), the own one (0) or that to the right (1);
        beside counts as ahead; NO_VEHICLE if there is none.
        """
        place = np.searchsorted(self.sorted, self._on_line(side), side="left" if side else "right")
        row = self.order[np.minimum(place, len(self.order) - 1)]
        is_ahead = (place < len(self.order)) & (self.position[row] >= self.position)  # the line is rounded
        return np.where(is_ahead & self._is_on_side(row, side), row, NO_VEHICLE)

    def behind(self, side: int) -> Int[np.ndarray, " rows"]:
        """The next vehicle behind each, as in `ahead`."""
        place = np.searchsorted(self.sorted, self._on_line(side), side="left") - 1
        row = self.order[np.maximum(place, 0)]
        return np.where((place >= 0) & self._is_on_side(row, side), row, NO_VEHICLE)

    def beside(self, speed: Float[np.ndarray, " rows"]) -> tuple[np.ndarray, np.ndarray]:
        """Lowest speed [m/s] and number of vehicles within BESIDE_RANGE on both adjacent lanes; inf and 0 without."""
        slowest, n_beside = np.full(len(speed), np.inf), np.zeros(len(speed))
        for side in (-1, 1):
            here = self._on_line(side)
            first = np.searchsorted(self.sorted, here - BESIDE_RANGE, side="left")
            stop = np.searchsorted(self.sorted, here + BESIDE_RANGE, side="right")
            for k in range(MOST_BESIDE):
                row = self.order[np.minimum(first + k, len(self.order) - 1)]
                is_near = (first + k < stop) & self._is_on_side(row, side)
                slowest = np.where(is_near, np.minimum(slowest, speed[row]), slowest)
                n_beside += is_near
        return slowest, n_beside

    def _on_line(self, side: int) -> Float[np.ndarray, " rows"]:
        """Position of each vehicle on the line [m] if moved to the lane on one side. It is less rounded with ranks of
        lanes than with their numbers, which are large.
        """
        return np.searchsorted(self.lane_keys, self.lane_key + side) * self.length + self.position

    def _is_on_side(self, row: Int[np.ndarray, " rows"], side: int) -> Bool[np.ndarray, " rows"]:
        """True if each vehicle is on a lane and another `row` on the lane on one side of it; side 0 is its own lane."""
        return (self.lane >= 0) & (self.lane + side >= 0) & (self.lane_key[row] == self.lane_key + side)


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
    """Vehicles around each row of a canonical table, sorted by track and frame; `speed` is that of every row [m/s]."""
    leader = leader_rows(table)
    follower = np.full(len(table), NO_VEHICLE)
    has_leader = leader != NO_VEHICLE
    follower[leader[has_leader]] = np.flatnonzero(has_leader)
    lanes = SortedLanes(table)
    return Around(leader, follower, lanes.ahead(-1), *lanes.beside(speed))
