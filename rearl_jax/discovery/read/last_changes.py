"""The last change of leader before each row of a table of trajectories."""

import numpy as np

from rearl_jax.core.leader_history import (
    MAX_GAP_IN_SIGHT,
    MAX_GAP_LOST,
    MAX_TIME_SINCE_CHANGE,
    MIN_SPEED,
    TIME_GAP_RANGE,
)
from rearl_jax.core.order import NO_VEHICLE


def last_changes(
    starts: np.ndarray, stops: np.ndarray, leader: np.ndarray, gap: np.ndarray, speed: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time since the last change of leader [s], the gap lost at it [m], the time gap right after it [s].

    Args:
        starts, stops: First row of each track, and one past its last.
        leader: Row of the leader, NO_VEHICLE if there is none.
        gap: Gap to the leader [m].
        speed: Speed [m/s].
        dt: Time step [s].
    """
    n = len(leader)
    since, lost, time_gap = np.full(n, MAX_TIME_SINCE_CHANGE), np.zeros(n), np.full(n, TIME_GAP_RANGE[1])
    for start, stop in zip(starts, stops, strict=True):
        changes = start + 1 + np.flatnonzero(leader[start + 1 : stop] != leader[start : stop - 1])
        for k in changes:
            if leader[k] == NO_VEHICLE:
                since[k:stop], lost[k:stop] = MAX_TIME_SINCE_CHANGE, 0.0
                continue
            since[k:stop] = np.minimum(np.arange(stop - k) * dt, MAX_TIME_SINCE_CHANGE)
            near = min(gap[k - 1], gap[k]) < MAX_GAP_IN_SIGHT
            lost[k:stop] = np.clip(gap[k - 1] - gap[k], 0.0, MAX_GAP_LOST) if near else 0.0
            time_gap[k:stop] = np.clip(gap[k] / max(speed[k], MIN_SPEED), *TIME_GAP_RANGE)
    return since, lost, time_gap
