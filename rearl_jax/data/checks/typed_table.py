"""Checks of a canonical table whose columns have the types of `schema.COLUMNS`; each gives its first finding, or None.

Row checks mark bad rows, step checks mark the row after a bad step. Marked rows may be dropped and counted.
"""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.config.quoting import quoted
from rearl_jax.data.checks.clock import resolution
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_classes import CLASSES, NO_CLASS, code_of
from rearl_jax.data.vehicle_rows import follows_row_before

NULLABLE = frozenset({"lateral", "lane", "acceleration", "width", "leader_id"})
"""Columns whose values may be unknown."""
NUMBERED = frozenset({"track_id", "frame", "direction", "lane", "leader_id"})
"""Columns of whole numbers, which may be larger than any measure."""

# Wide enough for every road vehicle and for sensor noise, narrow enough for a broken row. Length: the longest
# combinations on European and US motorways are 25.25 m and about 36 m. Speed: beyond production cars.
RANGES = {"speed": (0.0, 100.0), "length": (0.5, 40.0), "width": (0.2, 5.0), "acceleration": (-50.0, 50.0)}
MAX_MAGNITUDE = 1e12  # larger than every measured number; squares of smaller numbers do not overflow
RANGE_UNIT = {"speed": "m/s", "length": "m", "width": "m", "acceleration": "m/s^2"}


MAX_LANES = 12
"""Number of lanes that no carriageway exceeds; a larger lane number is a fault, not a property of the road."""
POSITION_NOISE = 0.5
"""Deviation of a step from speed x time [m] that noise and rounding of positions may cause at any frame rate."""
NOISE_DEVIATIONS = 6.0
"""Standard deviations of the recording's own noise within which a step is no jump."""


def not_finite(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows with NaN in a column that must be known, or with an infinite or absurdly large value.

    Lengths come first, because a reader may have computed positions of centres from them.
    """
    for name in sorted(table.columns, key=lambda name: name != "length"):
        column = table[name]
        if not pd.api.types.is_float_dtype(column.dtype):
            continue
        values = column.to_numpy(dtype=np.float64, na_value=np.nan)
        size, largest = np.abs(values), np.finfo(np.float64).max if name in NUMBERED else MAX_MAGNITUDE
        bad = size > largest if name in NULLABLE else ~(size <= largest)
        if bad.any():
            value = values[np.argmax(bad)]
            return Finding("not_finite", name, bad, f"the value is {value}", "write a finite number")
    return None


def unknown_class(
    table: pd.DataFrame, info: RecordingInfo, policy: DataConfig, known: str = ", ".join(CLASSES)
) -> Finding | None:
    """Rows whose vehicle class is none of CLASSES; `known` lists what the file may state, such as numbers."""
    bad = ~table["vehicle_class"].isin(CLASSES).to_numpy()
    if not bad.any():
        return None
    value = table["vehicle_class"].iloc[int(np.argmax(bad))]
    remedy = f"use one of {known}"
    if policy.format is DataFormat.table:
        code = code_of(value)
        plain = code if code.isdecimal() or code == NO_CLASS else quoted(code)
        remedy += f", or say what it is: 'data.classes={{{plain}: car}}'"
    shown = repr(value) if isinstance(value, str) else code_of(value)
    text = "the class is empty" if pd.isna(value) else f"class {shown} is unknown"
    return Finding("unknown_class", "vehicle_class", bad, text, remedy)


def out_of_order(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows whose frame does not come after all earlier frames of the track; the table is grouped by track."""
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    follows = follows_row_before(track)
    if not (follows[1:] & (np.diff(frame) <= 0)).any():
        return None
    # After a frame number that is too large, all rows with smaller numbers are out of order, not only the next one.
    latest = table.groupby("track_id", sort=False)["frame"].cummax().to_numpy()
    bad = follows
    bad[1:] &= frame[1:] <= latest[:-1]
    row = int(np.argmax(bad))
    is_copy = table.duplicated(["track_id", "frame"]).to_numpy()
    if is_copy[row]:
        text = f"track {track[row]} has frame {frame[row]} twice"
        return Finding("duplicate", "frame", bad & is_copy, text, "keep one of the two rows")
    text = f"track {track[row]} goes back from frame {frame[row - 1]} to frame {frame[row]}"
    remedy = "sort the rows by track_id and frame if their order is the only fault"
    return Finding("unsorted", "frame", bad & ~is_copy, text, remedy)


def out_of_range(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows with a speed, length, width or acceleration that no road vehicle has."""
    for name, (low, high) in RANGES.items():
        values = table[name].to_numpy()
        bad = (values < low) | (values > high)
        if bad.any():
            row = int(np.argmax(bad))
            unit = RANGE_UNIT[name]
            text = f"{name} is {values[row]:g} {unit}, outside {low:g} to {high:g} {unit}"
            remedy = "correct the value" + (", or leave it empty where it is unknown" if name in NULLABLE else "")
            return Finding("out_of_range", name, bad, text, remedy)
    return None


def wrong_time(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows whose time differs from that of their frame by more than half a frame interval."""
    bad = times_off_frames(table, info)
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    text = f"time {table['time'].iloc[row]:g} s is not that of frame {table['frame'].iloc[row]}"
    return Finding(
        "wrong_time", "time", bad, text, "correct the time, or leave the column out, because it follows from the frames"
    )


def wrong_lane(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows with a direction the road does not have, or with a lane outside the lanes of their direction."""
    direction = table["direction"].to_numpy()
    bad = ~np.isin(direction, list(info.lane_count))
    if bad.any():
        text = f"direction {direction[np.argmax(bad)]} is none of {sorted(info.lane_count)}"
        return Finding("wrong_direction", "direction", bad, text, "use 1 and 2 as in highD, 1 if there is only one")
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    count = np.zeros(max(info.lane_count) + 1)
    count[list(info.lane_count)] = list(info.lane_count.values())
    bad = (lane < 0) | (lane >= count[direction])
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    n_lanes = int(count[direction[row]])
    text = f"lane {lane[row]:g} does not exist, direction {direction[row]} has lanes 0 (left) to {n_lanes - 1}"
    remedy = "count lanes from 0 at the left, correct the lane count, or leave the lane empty where it is unknown"
    return Finding("lane_out_of_range", "lane", bad, text, remedy)


def changed_direction(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows where a track passes to the other carriageway."""
    direction = table["direction"].to_numpy()
    bad = follows_row_before(table["track_id"].to_numpy())
    bad[1:] &= direction[1:] != direction[:-1]
    if not bad.any():
        return None
    track = table["track_id"].iloc[int(np.argmax(bad))]
    text = f"track {track} changes its driving direction"
    return Finding("changed_direction", "direction", bad, text, "give the two vehicles two ids", is_step=True)


def gap(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows before which frames of the same track are missing."""
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    bad = follows_row_before(track)
    bad[1:] &= np.diff(frame) > 1
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    text = f"track {track[row]} misses the frames between {frame[row - 1]} and {frame[row]}"
    return Finding("gap", "frame", bad, text, "fill the frames, or give the second part its own id", is_step=True)


def jump(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows that a vehicle cannot have reached from the row before.

    With the bound b = max(max_jump * time, POSITION_NOISE): |step of position - mean speed * time| > b, or a step on
    the ground longer than mean speed * time + b, or a step of the lateral position > b. The bound of each is at least
    NOISE_DEVIATIONS of its robust standard deviation, because noise of unsmoothed positions is no jump.
    """
    track = table["track_id"].to_numpy()
    follows = follows_row_before(track)[1:]
    time = np.diff(table["frame"].to_numpy()) / info.frame_rate
    speed, position, lateral = (table[name].to_numpy() for name in ("speed", "position", "lateral"))
    expected = 0.5 * (speed[1:] + speed[:-1]) * time
    step = np.diff(position)
    ground = np.hypot(np.diff(table["x"].to_numpy()), np.diff(table["y"].to_numpy()))
    usual_bound = np.maximum(policy.max_jump * time, POSITION_NOISE)
    deviations = {"position": np.abs(step - expected), "lateral": np.abs(np.diff(lateral)), "x": ground - expected}
    for name, deviation in deviations.items():
        known = np.abs(deviation[follows & np.isfinite(deviation)])
        noise = float(np.median(known)) / 0.6745 if known.size else 0.0
        bound = np.maximum(usual_bound, NOISE_DEVIATIONS * noise)
        bad = np.concatenate([[False], follows & (deviation > bound)])
        if bad.any():
            row = int(np.argmax(bad))
            moved = {"position": step, "x": ground, "lateral": np.diff(lateral)}[name][row - 1]
            text = (
                f"track {track[row]} moves {moved:.2f} m ({name}) in {time[row - 1]:g} s "
                f"at {speed[row]:.2f} m/s, {bound[row - 1]:.2g} m or more off (data.max_jump={policy.max_jump:g} m/s)"
            )
            return Finding("jump", name, bad, text, "correct the row, or give the second part its own id", is_step=True)
    return None


def times_off_frames(table: pd.DataFrame, info: RecordingInfo) -> np.ndarray:
    """Mask of rows whose time differs from start + frame / frame rate by more than half a frame interval.

    The start is common to all rows. A rounded time may differ by half of its rounding unit instead, if that is more.
    """
    time = table["time"].to_numpy()
    off = time - table["frame"].to_numpy() / info.frame_rate
    # 1 % more than half of the unit, because the common start is not known exactly.
    allowed = max(0.5 / info.frame_rate, 0.505 * resolution(time))
    median = np.quantile(off, 0.5, method="lower")  # the value of a row; the mean of two may be far from both
    sound = off[np.abs(off - median) <= 2.0 * allowed]  # without vehicles that have another clock
    middle = 0.5 * (np.quantile(sound, 0.1) + np.quantile(sound, 0.9))
    return np.abs(off - middle) > allowed
