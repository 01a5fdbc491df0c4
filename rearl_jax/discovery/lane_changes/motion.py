"""Smooth motion of every row of a recording, and when its vehicle has changed lanes and will again."""

import numpy as np
import pandas as pd

from rearl_jax.discovery.read.smoothing import cut_off, position_noise, smoothed


def with_motion(table: pd.DataFrame, dt: float) -> pd.DataFrame:
    """The table with smooth motion, the time since the last change of lanes and that to the next one, and its side."""
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    first = np.r_[True, (track[1:] != track[:-1]) | (frame[1:] != frame[:-1] + 1)]
    starts = np.flatnonzero(first)
    stops = np.r_[starts[1:], len(track)]
    position = table["position"].to_numpy()
    frequency = cut_off(position_noise(position, starts, stops), dt)
    x, v, a = np.empty(len(track)), np.empty(len(track)), np.empty(len(track))
    for start, stop in zip(starts, stops, strict=True):
        x[start:stop], v[start:stop], a[start:stop] = smoothed(position[start:stop], dt, frequency)
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    step = np.r_[0.0, np.diff(lane)]
    changed = ~first & np.isfinite(step) & (step != 0)
    row, n = np.arange(len(track)), len(track)
    begin, end = np.repeat(starts, stops - starts), np.repeat(stops, stops - starts)
    last = np.maximum.accumulate(np.where(changed, row, -1))
    since = np.where(last >= begin, (row - last) * dt, np.inf)
    # The next change after each row: of all later rows the first that differs from the one before it.
    later = np.r_[np.minimum.accumulate(np.where(changed, row, n)[::-1])[::-1][1:], n] if n else row
    found = later < end
    return table.assign(
        position=x,
        speed=v,
        acceleration=a,
        since_change=since,
        to_change=np.where(found, (later - row) * dt, np.inf),
        next_step=np.where(found, step[np.minimum(later, n - 1)], 0.0),
        left_in_record=(end - 1 - row) * dt,
    )


def count_changes(table: pd.DataFrame) -> int:
    """Number of lane changes in a canonical table; moments of an unknown lane are skipped."""
    known = table["lane"].notna().to_numpy()
    track = table["track_id"].to_numpy()[known]
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)[known]
    return int(((track[1:] == track[:-1]) & (lane[1:] != lane[:-1])).sum())
