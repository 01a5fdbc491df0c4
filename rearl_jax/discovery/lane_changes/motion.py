"""Smooth motion in every row of a recording, the time since the last lane change, and the time to the next one.

A lane change begins when the vehicle starts to move sideways; the lane column changes seconds later. In between, the
driver already responds to the leader on the target lane, so what the driver decided by is what was before.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from rearl_jax.discovery.read.next_leaders import LONGEST_LEAD
from rearl_jax.discovery.read.smoothing import cut_off, position_noise, smoothed_tracks, track_bounds

SIDEWAYS_SPEED = 0.2
"""Speed towards the target lane below which a lane change has not begun [m/s]; a vehicle that keeps its lane reaches it
for moments only. A lane change of 3.5 m in 5 s has a mean of 0.7 m/s.
"""

SIDEWAYS_TIME = 1.0
"""Time over which the sideways speed is averaged [s]."""

USUAL_LEAD = 2.0
"""Time from the beginning of a lane change to the middle of its motion [s], used if no lateral position is recorded.
Source: half of 4 s, the mean duration in Thiemann, Treiber & Kesting, Transp. Res. Rec. 2088 (2008) 90.
"""


def with_motion(table: pd.DataFrame, dt: float) -> pd.DataFrame:
    """The table with smooth motion, the time since the lane last changed, the time until the next lane change begins
    (0 or negative while the vehicle moves sideways), and its side.

    Args:
        table: A canonical table, its rows sorted by track and time.
        dt: Time between the rows of a track [s].
    """
    position, bounds = table["position"].to_numpy(), track_bounds(table)
    x, v, a = smoothed_tracks(position, *bounds, dt, cut_off(position_noise(position, *bounds), dt))
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    step = np.r_[0.0, np.diff(lane)]
    row, n = np.arange(len(table)), len(table)
    begin, end = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    changed = (row != begin) & np.isfinite(step) & (step != 0)
    last = np.maximum.accumulate(np.where(changed, row, -1))
    since = np.where(last >= begin, (row - last) * dt, np.inf)
    # The row of the next change: of all later rows the first whose lane differs from that of the row before it.
    next_row = np.r_[np.minimum.accumulate(np.where(changed, row, n)[::-1])[::-1][1:], n] if n else row
    has_next = next_row < end
    departure = np.append(row, n)
    departure[:-1][changed] = departures(table["lateral"].to_numpy(), np.flatnonzero(changed), step, begin, end, dt)
    return table.assign(
        position=x,
        speed=v,
        acceleration=a,
        since_change=since,
        to_departure=np.where(has_next, (departure[next_row] - row) * dt, np.inf),
        next_step=np.where(has_next, step[np.minimum(next_row, n - 1)], 0.0),
        time_to_track_end=(end - 1 - row) * dt,
    )


def departures(
    lateral: Float[np.ndarray, " rows"],
    changes: Int[np.ndarray, " changes"],
    step: Float[np.ndarray, " rows"],
    begin: Int[np.ndarray, " rows"],
    end: Int[np.ndarray, " rows"],
    dt: float,
) -> Int[np.ndarray, " changes"]:
    """Row in which the vehicle begins to move sideways, for each change of the lane column.

    Args:
        lateral: Lateral position [m], positive to the right.
        changes: First rows on another lane.
        step: Change of the lane number from the row before.
        begin, end: First row of each row's track, and one past its last.
        dt: Time between the rows of a track [s].
    """
    longest, usual = round(LONGEST_LEAD / dt), round(USUAL_LEAD / dt)
    half = max(1, round(SIDEWAYS_TIME / 2 / dt))
    is_recorded = np.isfinite(lateral).any() and np.nanmax(lateral) > np.nanmin(lateral)
    rows = np.empty(len(changes), np.int64)
    for number, change in enumerate(changes):
        first = max(begin[change], change - longest)
        if not is_recorded:
            rows[number] = max(first, change - usual)
            continue
        before = np.arange(first, change + 1)
        later, earlier = np.minimum(before + half, end[change] - 1), np.maximum(before - half, begin[change])
        speed = np.sign(step[change]) * (lateral[later] - lateral[earlier]) / ((later - earlier) * dt)
        at_rest = np.flatnonzero(~(speed >= SIDEWAYS_SPEED))  # unknown positions too
        rows[number] = before[at_rest[-1]] if len(at_rest) else first
    return rows


def count_changes(table: pd.DataFrame) -> int:
    """Number of lane changes in a canonical table; rows with an unknown lane are skipped."""
    known = table["lane"].notna().to_numpy()
    track = table["track_id"].to_numpy()[known]
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)[known]
    return int(((track[1:] == track[:-1]) & (lane[1:] != lane[:-1])).sum())
