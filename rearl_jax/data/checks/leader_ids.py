"""Ids of leaders that stand for no leader."""

import numpy as np

from rearl_jax.data.checks.placeholders import is_placeholder


def is_absent(leader: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Mask of the ids of leaders that are 0, -1 or another placeholder, and the id of no vehicle."""
    return ((leader == 0.0) | is_placeholder(leader)) & ~np.isin(leader, track)


def without_absent(
    leader: np.ndarray, *, track: np.ndarray, frame: np.ndarray, lane: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Ids of leaders as float64, NaN for 0, -1 or another placeholder that is the id of no vehicle.

    The formats write 0 where there is no leader. If a vehicle has the id 0, it is the leader of the vehicles behind it
    in its lane that state 0; for other rows 0 means no leader.

    Args:
        leader: Stated ids of leaders.
        track: Ids of the vehicles.
        frame: Frames.
        lane: Lanes, with other numbers for the other carriageway.
        position: Positions along the road, rising in driving direction.
    """
    leader = leader.astype(np.float64)
    is_none = is_absent(leader, track)
    rows, zero = np.flatnonzero(leader == 0.0), np.flatnonzero(track == 0)
    if rows.size and zero.size:
        zero = zero[np.argsort(frame[zero], kind="stable")]
        found = zero[np.minimum(np.searchsorted(frame[zero], frame[rows]), len(zero) - 1)]
        is_ahead = (frame[found] == frame[rows]) & (lane[found] == lane[rows]) & (position[found] > position[rows])
        is_none[rows[~is_ahead]] = True
    return np.where(is_none, np.nan, leader)
