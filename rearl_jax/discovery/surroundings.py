"""Who is around each vehicle in every moment of a recording, as rows of its table."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.core.effects.stimulus import BESIDE_RANGE
from rearl_jax.core.order import NOBODY

MOST_BESIDE = 8
"""Vehicles on one lane that are looked at within BESIDE_RANGE."""


@dataclass(frozen=True)
class Around:
    """Rows of the vehicles around, NOBODY where there is none.

    Attributes:
        leader: Next ahead on the same lane; where the source states a leader, that one.
        follower: Next behind on the same lane.
        beside_speed: Slowest speed within BESIDE_RANGE on the lanes beside [m/s]; inf without one.
        n_beside: Number of vehicles within BESIDE_RANGE on the lanes beside.
    """

    leader: np.ndarray
    follower: np.ndarray
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
    street = (frame - frame.min()) * 64 + table["direction"].to_numpy(np.int64) * 16 + lane + 1
    order = np.lexsort((position, street))
    ahead = np.full(len(table), NOBODY)
    same = (street[order][1:] == street[order][:-1]) & (lane[order][1:] >= 0)
    ahead[order[:-1][same]] = order[1:][same]
    stated = table["leader_id"].to_numpy(dtype=np.float64, na_value=np.nan)
    if np.isfinite(stated).any():
        ahead = _stated_leader(table, stated)
    follower = np.full(len(table), NOBODY)
    followed = ahead != NOBODY
    follower[ahead[followed]] = np.flatnonzero(followed)
    slowest, number = _beside(street[order], position[order], speed[order], street, position, lane)
    return Around(ahead, follower, slowest, number)


def _stated_leader(table: pd.DataFrame, stated: np.ndarray) -> np.ndarray:
    """Row of the leader that the source names, at the same frame."""
    frame, track = table["frame"].to_numpy(), table["track_id"].to_numpy()
    span = int(frame.max()) + 1
    keys = track * span + frame
    order = np.argsort(keys)
    wanted = np.where(np.isfinite(stated), np.nan_to_num(stated, nan=-1.0), -1.0).astype(np.int64) * span + frame
    place = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    found = np.isfinite(stated) & (keys[order][place] == wanted)
    return np.where(found, order[place], NOBODY)


def _beside(
    streets: np.ndarray,
    positions: np.ndarray,
    speeds: np.ndarray,
    street: np.ndarray,
    position: np.ndarray,
    lane: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Slowest speed and number of vehicles beside each row; the first three arguments are sorted."""
    slowest, number = np.full(len(street), np.inf), np.zeros(len(street))
    # One sortable number: streets apart by more than any road is long.
    length = positions.max() - positions.min() + 4 * BESIDE_RANGE
    line = streets * length + (positions - positions.min())
    for side in (-1, 1):
        here = (street + side) * length + (position - positions.min())
        first = np.searchsorted(line, here - BESIDE_RANGE, side="left")
        last = np.searchsorted(line, here + BESIDE_RANGE, side="right")
        known = (lane >= 0) & (lane + side >= 0)
        for k in range(MOST_BESIDE):
            row = np.minimum(first + k, len(line) - 1)
            there = known & (first + k < last) & (streets[row] == street + side)
            slowest = np.where(there, np.minimum(slowest, speeds[row]), slowest)
            number += there
    return slowest, number
