"""Changes of leader around each row of a table of trajectories: the last and the next one, the leaders before and after
them, and the gradual transition between these in smoothed recordings.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from rearl_jax.core.leader_history import (
    MAX_GAP_IN_SIGHT,
    MAX_GAP_LOST,
    MAX_TIME_SINCE_CHANGE,
    MIN_SPEED,
    TIME_GAP_RANGE,
)
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.vehicle_rows import VehicleRows
from rearl_jax.discovery.read.kernels import Kernel
from rearl_jax.discovery.read.sideways_motion import sideways_starts


@dataclass(frozen=True)
class Handovers:
    """Changes of leader around each row (vehicle and frame) of a table of trajectories; leaders are rows of this table.

    Attributes:
        following: Row of the leader after the next change, in the same frame; NO_VEHICLE if no change is near.
        time_to: Time until the next change [s]; inf if no change is near.
        lead: Time from the beginning of the lane change that is the cause of the next change of leader until then [s];
            0 if no change is near, or its cause or its beginning is unknown.
        by_own: Whether the driver itself changes lanes at the next change.
        preceding: Row of the leader before the last change, in the same frame; NO_VEHICLE if no change is near.
        time_since: Time since the last change [s]; inf if no change is near.
    """

    following: Int[np.ndarray, " rows"]
    time_to: Float[np.ndarray, " rows"]
    lead: Float[np.ndarray, " rows"]
    by_own: Float[np.ndarray, " rows"]
    preceding: Int[np.ndarray, " rows"]
    time_since: Float[np.ndarray, " rows"]


def handovers(
    table: pd.DataFrame,
    bounds: tuple[np.ndarray, np.ndarray],
    leader: Int[np.ndarray, " rows"],
    dt: float,
    longest: float,
) -> Handovers:
    """Changes from one leader to another.

    Args:
        table: Canonical table, sorted by track and frame.
        bounds: First row of each track, and one past its last.
        leader: Track of the leader of every row, NO_VEHICLE if there is none.
        dt: Time step [s].
        longest: Largest time to the beginning of the lane change, or since the change of leader, for the change to
            count as near [s].
    """
    n = len(table)
    none = (NO_VEHICLE, np.inf, 0.0, 0.0, NO_VEHICLE, np.inf)  # fields of `Handovers` if no change is near
    changes = Handovers(*(np.full(n, value) for value in none))
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=-1.0)
    frame, index = table["frame"].to_numpy(np.int64), VehicleRows(table)
    first, stop = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    row = np.arange(n)
    is_change = (row > first) & (leader != np.r_[NO_VEHICLE, leader[:-1]])
    start = row.copy()
    changed, starts = sideways_starts(table, bounds, dt, otherwise=0.0)
    start[changed] = starts
    reach = max(1, round(longest / dt))
    last_change = 0
    for k in np.flatnonzero(is_change):
        old, new = leader[k - 1], leader[k]
        if old == NO_VEHICLE or new == NO_VEHICLE:
            continue
        # The vehicle that changes lanes: the driver, the new leader, or the old one.
        changer = (k, *(int(index.rows(int(vehicle), frame[k : k + 1])[0]) for vehicle in (new, old)))
        lead = next((place - int(start[place]) for place in changer if place >= 0 and start[place] < place), 0)
        before = row[max(first[k], last_change, k - lead - reach) : k]
        last_change = k
        row_of_new = index.rows(int(new), frame[before])
        is_recorded = row_of_new != NO_VEHICLE
        before = before[is_recorded]
        changes.following[before], changes.time_to[before] = row_of_new[is_recorded], (k - before) * dt
        changes.lead[before] = lead * dt
        changes.by_own[before] = float(lane[k] != lane[k - 1])
        after = row[k : min(stop[k], k + reach)]
        row_of_old = index.rows(int(old), frame[after])
        is_recorded = row_of_old != NO_VEHICLE
        after = after[is_recorded]
        changes.preceding[after], changes.time_since[after] = row_of_old[is_recorded], (after - k) * dt
    return changes


def handed_over(
    values: Float[np.ndarray, " rows"],
    own_values: Float[np.ndarray, " rows"],
    changes: Handovers,
    kernel: Kernel,
    dt: float,
) -> Float[np.ndarray, " rows"]:
    """A quantity of the leader, blended over changes of leader to match the follower's smoothed motion.

    Smoothing a motion turns the response to a step, the change of leader, into the response to a smoothed step.

    Args:
        values: The quantity of the present leader.
        own_values: The quantity of every row's own vehicle.
        changes: Changes of leader near each row.
        kernel: Kernel that the motion was smoothed with.
        dt: Time step [s].
    """
    if not kernel.deviation:
        return values
    to_next = np.where(changes.following != NO_VEHICLE, own_values[changes.following] - values, 0.0)
    to_previous = np.where(changes.preceding != NO_VEHICLE, own_values[changes.preceding] - values, 0.0)
    return (
        values
        + to_next * kernel.share_beyond(changes.time_to - dt / 2)
        + to_previous * kernel.share_beyond(changes.time_since + dt / 2)
    )


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
