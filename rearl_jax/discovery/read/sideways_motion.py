"""Beginning of lane changes: the moment at which a vehicle starts to move sideways."""

import numpy as np
import pandas as pd
from jaxtyping import Int

from rearl_jax.data.vehicle_rows import lane_steps

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

CROSSING_SPEED = 0.5
"""Least mean sideways speed over SIDEWAYS_TIME before the lane column changes if it changes halfway [m/s]: on a path of
minimum jerk over 3.5 m in 7 s it is 0.9 m/s. Below it, the column changes as the motion begins.
"""

BEFORE_SEEN = 0.4
"""Time from the beginning of the motion until its mean speed reaches SIDEWAYS_SPEED [s]: on a path of minimum jerk over
3.5 m, 0.3 s of 4 s, 0.5 s of 5 s and 0.7 s of 6 s. Source of the path: Flash & Hogan, J. Neurosci. 5 (1985) 1688.
"""


def sideways_starts(
    table: pd.DataFrame, bounds: tuple[np.ndarray, np.ndarray], dt: float, *, otherwise: float
) -> tuple[Int[np.ndarray, " changes"], Int[np.ndarray, " changes"]]:
    """Rows in which the lane column changes, ascending, and those in which the vehicles begin to move sideways: at most
    LONGEST_LEAD earlier, and not before the lane change before.

    Args:
        table: Canonical table, sorted by track and frame.
        bounds: First row of each track, and one past its last.
        dt: Time between the rows of a track [s].
        otherwise: Time from beginning to change of the column if no lateral positions are recorded [s].
    """
    lateral = table["lateral"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    begin, end = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    step = lane_steps(lane, np.arange(len(lane)) != begin)
    changes = np.flatnonzero(step)
    earliest = np.maximum(begin[changes], np.r_[0, changes[:-1]] if len(changes) else changes)
    known = lateral[np.isfinite(lateral)]
    if not known.size or known.max() == known.min():
        return changes, np.maximum(changes - round(otherwise / dt), earliest)
    longest, half, unseen = (round(time / dt) for time in (LONGEST_LEAD, SIDEWAYS_TIME / 2, BEFORE_SEEN))
    half = max(half, 1)
    starts = np.empty_like(changes)
    for number, change in enumerate(changes):
        before = np.arange(max(earliest[number], change - longest), change + 1)
        later, earlier = np.minimum(before + half, end[change] - 1), np.maximum(before - half, begin[change])
        speed = np.sign(step[change]) * (lateral[later] - lateral[earlier]) / ((later - earlier) * dt)
        if not speed[max(len(speed) - 1 - half, 0)] >= CROSSING_SPEED:
            starts[number] = change
            continue
        at_rest = np.flatnonzero(~(speed >= SIDEWAYS_SPEED))  # unknown positions too
        last_at_rest = before[at_rest[-1]] if len(at_rest) else before[0]
        starts[number] = max(last_at_rest - unseen, earliest[number])
    return changes, starts
