"""Smooth motion and chosen lane in every row of a recording, and the times of the previous and the next lane change.

A lane change is decided when the vehicle starts to move sideways; the lane column changes seconds later. In between,
the driver already responds to the leader on the target lane.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.data.vehicle_rows import follows_row_before, lane_steps
from rearl_jax.discovery.read.sideways_motion import sideways_starts
from rearl_jax.discovery.read.smoothing import cut_off, position_noise, smoothed_tracks, track_bounds

USUAL_LEAD = 2.0
"""Time from the beginning of a lane change to the middle of its motion [s], used if no lateral position is recorded.
Source: half of 4 s, the mean duration in Thiemann, Treiber & Kesting, Transp. Res. Rec. 2088 (2008) 90.
"""


def with_motion(table: pd.DataFrame, dt: float) -> pd.DataFrame:
    """The table, sorted by track and time, with smooth motion, the lane that each vehicle is on or moves to, the time
    since it began its last lane change, the time until it begins the next one, and its side; `dt` is the time between
    the rows of a track [s].
    """
    position, bounds = table["position"].to_numpy(), track_bounds(table)
    x, v, a = smoothed_tracks(position, *bounds, dt, cut_off(position_noise(position, *bounds), dt))
    lane = _chosen_lanes(table, bounds, dt)
    row, n = np.arange(len(table)), len(table)
    begin, end = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    step = lane_steps(lane, row != begin)
    changed = step != 0.0
    last = np.maximum.accumulate(np.where(changed, row, -1))
    since = np.where(last >= begin, (row - last) * dt, np.inf)
    # The row of the next change: of all later rows the first whose lane differs from that of the row before it.
    next_row = np.r_[np.minimum.accumulate(np.where(changed, row, n)[::-1])[::-1][1:], n] if n else row
    has_next = next_row < end
    return table.assign(
        position=x,
        speed=v,
        acceleration=a,
        lane=pd.Series(lane, table.index).astype("Int8"),
        since_change=since,
        to_change=np.where(has_next, (next_row - row) * dt, np.inf),
        next_step=np.where(has_next, step[np.minimum(next_row, n - 1)], 0.0),
        time_to_track_end=(end - 1 - row) * dt,
    )


def _chosen_lanes(table: pd.DataFrame, bounds: tuple[np.ndarray, np.ndarray], dt: float) -> Float[np.ndarray, " rows"]:
    """The lane that each vehicle is on or moves to; NaN if unknown. Arguments as of `sideways_starts`."""
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan).copy()
    changes, starts = sideways_starts(table, bounds, dt, otherwise=USUAL_LEAD)
    for change, start in zip(changes, starts, strict=True):
        lane[start:change] = lane[change]
    return lane


def count_changes(table: pd.DataFrame) -> int:
    """Number of lane changes in a canonical table; rows with an unknown lane are skipped."""
    known = table["lane"].notna().to_numpy()
    track = table["track_id"].to_numpy()[known]
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)[known]
    return int(np.count_nonzero(lane_steps(lane, follows_row_before(track))))
