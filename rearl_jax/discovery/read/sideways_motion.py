"""Beginning of lane changes: the moment at which a vehicle starts to move sideways."""

import numpy as np
import pandas as pd
from jaxtyping import Int

LONGEST_LEAD = 5.0
"""Longest time from the beginning of a lane change to the change of the lane column, and longest time before it from
which a driver may respond to the next leader [s]; lane changes take 3 to 6 s.

Source: Toledo & Zohar, Transp. Res. Rec. 1999 (2007) 71.
"""

SIDEWAYS_SPEED = 0.2
"""Speed towards the target lane below which a lane change has not begun [m/s]; a vehicle that keeps its lane reaches it
for moments only. A lane change of 3.5 m in 5 s has a mean of 0.7 m/s.
"""

SIDEWAYS_TIME = 1.0
"""Time over which the sideways speed is averaged [s]."""


def has_lateral_positions(table: pd.DataFrame) -> bool:
    """Whether the lateral positions of a canonical table are recorded, not all equal or unknown."""
    lateral = table["lateral"].to_numpy()
    known = lateral[np.isfinite(lateral)]
    return bool(known.size and known.max() > known.min())


def sideways_starts(table: pd.DataFrame, bounds: tuple[np.ndarray, np.ndarray], dt: float) -> Int[np.ndarray, " rows"]:
    """Row in which the vehicle begins to move sideways, for each row in which its lane column changes; every other row
    itself, and all rows if no lateral positions are recorded.

    Args:
        table: Canonical table, sorted by track and frame.
        bounds: First row of each track, and one past its last.
        dt: Time between the rows of a track [s].
    """
    rows = np.arange(len(table))
    if not has_lateral_positions(table):
        return rows
    lateral = table["lateral"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    begin, end = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    step = np.r_[0.0, np.diff(lane)]
    longest, half = round(LONGEST_LEAD / dt), max(1, round(SIDEWAYS_TIME / 2 / dt))
    for change in np.flatnonzero((rows != begin) & np.isfinite(step) & (step != 0)):
        before = np.arange(max(begin[change], change - longest), change + 1)
        later, earlier = np.minimum(before + half, end[change] - 1), np.maximum(before - half, begin[change])
        speed = np.sign(step[change]) * (lateral[later] - lateral[earlier]) / ((later - earlier) * dt)
        at_rest = np.flatnonzero(~(speed >= SIDEWAYS_SPEED))  # unknown positions too
        rows[change] = before[at_rest[-1]] if len(at_rest) else before[0]
    return rows
