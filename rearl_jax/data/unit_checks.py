"""Checks whether a column is in another unit than the schema says.

A wrong unit is a property of the table and never of a row, so these checks compare medians over the whole
recording: steps with speeds, sizes with those of road vehicles, lane distances with those of roads.
"""

import numpy as np
import pandas as pd

from rearl_jax.data.checks import CLASSES, follows_row_before
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.units import SI_FACTOR

MOVING = 3.0  # m/s; below it rounding of positions hides the ratio of step and speed
MIN_STEPS = 20  # fewer moving steps do not tell a unit
RATIO_TOLERANCE = 0.07  # the nearest confusion, feet with km/h, is off by 0.09
# Median sizes. Length of cars and trucks on motorways: 4.6 m and 14 to 16 m (Krajewski et al. 2018, highD).
MEDIAN_SIZE = {("length", "car"): (3.0, 7.0), ("length", "truck"): (4.5, 26.0), ("width", "car"): (1.2, 2.9)}
LANE_WIDTH = (2.2, 5.5)  # m
ACCELERATION_P99 = 9.0  # m/s^2, about the friction limit of a dry road

# step / (speed * time) that a wrong unit of position or speed produces.
UNIT_RATIOS = {
    "speed is in km/h, not m/s": SI_FACTOR["km/h"],
    "speed is in ft/s, not m/s": SI_FACTOR["ft/s"],
    "speed is in mph, not m/s": SI_FACTOR["mph"],
    "position is in ft, not m": 1.0 / SI_FACTOR["ft"],
    "position is in ft and speed in km/h": SI_FACTOR["km/h"] / SI_FACTOR["ft"],
    "position is in ft and speed in mph": SI_FACTOR["mph"] / SI_FACTOR["ft"],
    "position is in km, not m": 1.0 / SI_FACTOR["km"],
    "position is in cm, not m": 1.0 / SI_FACTOR["cm"],
}


def wrong_units(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """The first sign that a whole column is in another unit than the schema says."""
    for check in (_wrong_time, _wrong_speed_or_position, _wrong_ground, _wrong_size, _wrong_lateral):
        finding = check(table, info)
        if finding is not None:
            return finding
    values = np.abs(table["acceleration"].to_numpy())
    known = values[np.isfinite(values)]
    if known.size >= MIN_STEPS and np.percentile(known, 99) > ACCELERATION_P99:
        text = f"1 % of |acceleration| is above {np.percentile(known, 99):.1f} m/s^2, beyond tyre friction"
        return _unit_finding("acceleration", values > ACCELERATION_P99, text, "convert acceleration to m/s^2")
    return None


def _wrong_time(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    off = table["time"].to_numpy() - table["frame"].to_numpy() / info.frame_rate
    bad = np.abs(off - np.median(off)) > 0.5 / info.frame_rate
    text = f"time does not follow frame / frame rate at {info.frame_rate:g} frames per second"
    return _unit_finding("time", bad, text, "give time in s and the frame rate of the recording")


def _wrong_speed_or_position(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    rows, step, expected = _moving_steps(table, info)
    if rows.size < MIN_STEPS:
        return None
    ratio = float(np.median(step / expected))
    if abs(ratio - 1.0) <= RATIO_TOLERANCE:
        return None
    text = f"vehicles move {ratio:.3f} times as far as speed x time says"
    # A decreasing position has a negative ratio and no unit explains it.
    cause, known = min(UNIT_RATIOS.items(), key=lambda item: abs(np.log(max(ratio, 1e-9) / item[1])))
    if abs(ratio / known - 1.0) <= RATIO_TOLERANCE:
        remedy = f"it looks as if {cause}: convert it to SI"
    elif ratio < 0.0:
        remedy = "position must increase in driving direction: reverse it"
    else:
        remedy = f"check the units of position and speed and the frame rate ({info.frame_rate:g} per second)"
    bad = np.zeros(len(table), dtype=bool)
    bad[rows] = np.abs(step / expected - 1.0) > RATIO_TOLERANCE
    column = "position" if "position" in remedy and "speed" not in remedy else "speed"
    return _unit_finding(column, bad, text, remedy)


def _wrong_ground(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    rows, step, _ = _moving_steps(table, info)
    if rows.size < MIN_STEPS:
        return None
    x, y = table["x"].to_numpy(), table["y"].to_numpy()
    ground = np.hypot(x[rows] - x[rows - 1], y[rows] - y[rows - 1])
    ratio = float(np.median(ground / np.abs(step)))
    if abs(ratio - 1.0) <= RATIO_TOLERANCE:
        return None
    bad = np.zeros(len(table), dtype=bool)
    bad[rows] = np.abs(ground / np.abs(step) - 1.0) > RATIO_TOLERANCE
    text = f"vehicles move {ratio:.3f} times as far in x, y as in position"
    return _unit_finding("x", bad, text, "give x, y and position in m and in the same road frame")


def _wrong_size(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    vehicle_class = table["vehicle_class"].cat.codes.to_numpy()
    for (name, which), (low, high) in MEDIAN_SIZE.items():
        values = table[name].to_numpy()
        chosen = (vehicle_class == CLASSES.index(which)) & np.isfinite(values)
        if not chosen.any():
            continue
        median = float(np.median(values[chosen]))
        if not low <= median <= high:
            foot = SI_FACTOR["ft"]
            hint = " (feet?)" if low <= median * foot <= high else ""
            text = f"the median {name} of class {which} is {median:.2f} m, outside {low:g} to {high:g} m{hint}"
            return _unit_finding(name, chosen & ((values < low) | (values > high)), text, f"convert {name} to m")
    return None


def _wrong_lateral(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    lateral = table["lateral"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    known = np.isfinite(lateral) & np.isfinite(lane)
    lanes, counts = np.unique(lane[known], return_counts=True)
    lanes = lanes[counts >= MIN_STEPS]
    if lanes.size < 2:
        return None
    left, right = (float(np.median(lateral[known & (lane == rank)])) for rank in (lanes[0], lanes[-1]))
    width = (right - left) / (lanes[-1] - lanes[0])
    if LANE_WIDTH[0] <= width <= LANE_WIDTH[1]:
        return None
    text = f"lateral grows by {width:.2f} m per lane to the right, outside {LANE_WIDTH[0]} to {LANE_WIDTH[1]} m"
    return _unit_finding("lateral", known & (lane == lanes[-1]), text, "give lateral in m, positive to the right")


def _moving_steps(table: pd.DataFrame, info: RecordingInfo) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows after a step of a moving vehicle, that step of position, and what speed x time expects [m]."""
    frame, speed, position = (table[name].to_numpy() for name in ("frame", "speed", "position"))
    moving = follows_row_before(table["track_id"].to_numpy())
    moving[1:] &= (speed[1:] > MOVING) & (speed[:-1] > MOVING)
    rows = np.flatnonzero(moving)
    step = position[rows] - position[rows - 1]
    rows, step = rows[step != 0.0], step[step != 0.0]
    expected = 0.5 * (speed[rows] + speed[rows - 1]) * (frame[rows] - frame[rows - 1]) / info.frame_rate
    return rows, step, expected


def _unit_finding(column: str, rows: np.ndarray, problem: str, remedy: str) -> Finding | None:
    return Finding("wrong_units", column, rows, problem, remedy) if rows.any() else None
