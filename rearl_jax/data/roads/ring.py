"""Ring roads of one lane, unrolled: laps become consecutive parts of a straight road, which all models require.

On the ring the foremost vehicle follows the rearmost one. On the straight road its leader is a copy of the rearmost
vehicle, one lap ahead; the copy has no leader, so no driver counts twice.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.vehicle_rows import first_and_last_rows


def unrolled(rows: pd.DataFrame, circumference: float, file: str) -> tuple[pd.DataFrame, list[str]]:
    """The rows with positions that grow from lap to lap and a leader for every vehicle, and notes.

    Positions [m] may restart at 0 in every lap or not; the circumference is the length of one lap [m].

    Raises:
        BadRecordingError: There are several lanes, or vehicles overtake each other or are not on the ring.
    """
    track, frame, stated = (numbers_of(pd.Series(rows[name])) for name in ("track_id", "frame", "position"))
    if "lane" in rows and pd.Series(numbers_of(pd.Series(rows["lane"]))).nunique() > 1:
        text = "a ring road is read with one lane only, and there are several"
        remedy = "give each lane a table of its own, or leave the column out: 'data.columns={lane: null}'"
        raise bad_recording("ring-lanes", text, remedy, file, column="lane")
    known = np.flatnonzero(np.isfinite(track) & np.isfinite(frame) & np.isfinite(stated))
    order = known[np.lexsort((frame[known], track[known]))]
    along = _along(track[order].astype(np.int64), frame[order].astype(np.int64), stated[order], circumference)
    position = stated.copy()
    position[order] = along
    rows = rows.assign(position=position, x=position, y=0.0, lane=0)
    rearmost = _rearmost(frame[order].astype(np.int64), along, circumference, file)
    source = order[rearmost]
    copies = rows.iloc[source].assign(position=position[source] + circumference, x=position[source] + circumference)
    first_free = int(np.max(track[known], initial=0.0)) + 1
    copied, number = np.unique(track[source], return_inverse=True)
    copies = copies.assign(track_id=first_free + number)
    rows = pd.concat([rows, copies])
    note = f"ring of {circumference:g} m unrolled: {len(copied)} of {len(np.unique(track[known]))} vehicles"
    return rows.drop(columns="leader_id", errors="ignore"), [f"{note} are copied one lap ahead, as leaders"]


def _along(
    track: Int[np.ndarray, " rows"], frame: Int[np.ndarray, " rows"], stated: Float[np.ndarray, " rows"], lap: float
) -> Float[np.ndarray, " rows"]:
    """Positions that grow from lap to lap [m]; every vehicle begins less than a lap behind the longest track."""
    starts, ends = first_and_last_rows(track)
    counts = ends - starts + 1
    # 1 where the stated position restarts at 0, -1 where noise takes it back.
    seams = -np.rint(np.diff(stated, prepend=0.0) / lap)
    seams[starts] = 0.0
    laps = np.cumsum(seams)
    along = stated + lap * (laps - np.repeat(laps[starts], counts))
    longest = int(np.argmax(counts))
    of_longest = slice(starts[longest], starts[longest] + counts[longest])
    front = np.interp(frame[starts], frame[of_longest], along[of_longest])
    behind = np.floor((front - along[starts]) / lap)
    behind[longest] = 0.0
    return along + lap * np.repeat(behind, counts)


def _rearmost(
    frame: Int[np.ndarray, " rows"], along: Float[np.ndarray, " rows"], lap: float, file: str
) -> Int[np.ndarray, " frames"]:
    """Row of the rearmost vehicle of every frame."""
    order = np.lexsort((along, frame))
    rearmost, foremost = (order[rows] for rows in first_and_last_rows(frame[order]))
    reach = along[foremost] - along[rearmost]
    if (reach >= lap).any():
        worst = int(np.argmax(reach))
        text = f"in frame {frame[rearmost[worst]]} vehicles are {reach[worst]:.1f} m apart on a ring of {lap:g} m"
        remedy = "data.ring must be the length of one lap [m], and nobody may overtake or be counted twice"
        raise bad_recording("ring-overtaken", text, remedy, file, column="position")
    return rearmost
