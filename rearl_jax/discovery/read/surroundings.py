"""Vehicles around each vehicle in every frame of a recording, as rows of its table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.checks.leaders import leader_rows
from rearl_jax.discovery.read.sorted_lanes import SortedLanes


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
    leader = leader_rows(table)
    follower = np.full(len(table), NO_VEHICLE)
    has_leader = leader != NO_VEHICLE
    follower[leader[has_leader]] = np.flatnonzero(has_leader)
    lanes = SortedLanes(table)
    return Around(leader, follower, lanes.ahead(-1), *lanes.beside(speed))
