"""Checks whether a column is in another unit than the schema's.

A wrong unit is a property of the table and never of a row, so these checks compare medians over many rows: steps with
speeds, changes of speed with accelerations, sizes with those of road vehicles. Each gets all rows or those of one
carriageway from `column_checks`. Lanes and lateral positions are compared in `lateral_checks`.
"""

import numpy as np
import pandas as pd

from rearl_jax.data.checks import clock
from rearl_jax.data.checks.typed_table import times_off_frames
from rearl_jax.data.problems import Finding, bad_recording
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.units import SI_FACTOR, UNITS
from rearl_jax.data.vehicle_classes import CLASSES
from rearl_jax.data.vehicle_rows import first_and_last_rows, follows_row_before

MIN_SPEED = 3.0  # m/s; below it rounding of positions hides the ratio of step and speed
MIN_STEPS = 20  # fewer moving steps do not determine a unit
RATIO_TOLERANCE = 0.07  # relative; the wrong units that are nearest to SI, ft with km/h, are off by 0.09
# Median sizes. Length of cars and trucks on motorways: 4.6 m and 14 to 16 m (Krajewski et al. 2018, highD).
MEDIAN_SIZE = {("length", "car"): (3.0, 7.0), ("length", "truck"): (4.5, 26.0), ("width", "car"): (1.2, 2.9)}
LANE_WIDTH = (2.2, 5.5)  # m
ACCELERATION_P99 = 9.0  # m/s^2, about the friction limit of a dry road
# Two measurements of one quantity: in NGSIM, I-80 and OpenACC they correlate with 0.92 or more and agree within 25 %.
MIN_CORRELATION = 0.8  # smallest correlation at which the units of two measurements are compared
MAX_SAME_UNIT_FACTOR = 1.8  # a larger factor between them is no measurement error; the nearest wrong unit, ft, has 3.28
WRONG_SHARE = 0.1  # of the rows; if more are wrong, the unit, frame rate or origin of the column is wrong
AVERAGING_TIME = 1.0  # s over which changes of speed are compared with accelerations, beyond most of their noise

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


def scale_of(values: np.ndarray, reference: np.ndarray) -> tuple[float, float] | None:
    """Smallest and largest factor between two measurements of one quantity; None if they do not determine it.

    Errors of the regressor make the slope of a regression too small. So the factor lies between the slope of `values`
    on `reference` and the inverse slope of `reference` on `values`. It is negative if the two have opposite signs.
    """
    known = np.isfinite(values) & np.isfinite(reference)
    values, reference = values[known], reference[known]
    if values.size < MIN_STEPS:
        return None
    product = float(np.mean(values * reference))
    squares = float(np.mean(values**2)), float(np.mean(reference**2))
    if not abs(product) > MIN_CORRELATION * np.sqrt(squares[0] * squares[1]):
        return None
    low, high = sorted((product / squares[1], squares[0] / product))
    return low, high


def require_period(time: np.ndarray, track: np.ndarray, period: float, file: str, column: str) -> None:
    """Raise BadRecordingError unless the rows of a track, in the order of time [s], are mostly one period [s] apart."""
    known = np.isfinite(time)
    steps = np.diff(time[known])[follows_row_before(track[known])[1:]]
    median = float(np.median(steps)) if steps.size else period
    if not 0.5 * period < median < 1.5 * period:
        text = f"rows are {median:.3g} s apart, not {period:g} s"
        remedy = "give the time in s, sorted, with every frame of a vehicle"
        raise bad_recording("wrong-units", text, remedy, file, column=column)


def is_other_unit(scale: tuple[float, float]) -> bool:
    """True for a scale as from `scale_of` that can only be that of another unit."""
    return scale[0] > MAX_SAME_UNIT_FACTOR or scale[1] < 1.0 / MAX_SAME_UNIT_FACTOR


def wrong_time(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Times that do not follow frame / frame rate."""
    bad = times_off_frames(table, info)
    if np.mean(bad) < WRONG_SHARE:
        return None
    track = table["track_id"].to_numpy()
    whose = "" if np.isin(track, track[~bad]).sum() == 0 else f" of vehicle {track[np.argmax(bad)]}"
    text = f"time{whose} does not follow frame / frame rate at {info.frame_rate:g} frames per second"
    found = clock.period_of(*(table[name].to_numpy(np.float64)[bad] for name in ("track_id", "frame", "time")))
    frames = {unit: found[0] * seconds * info.frame_rate for unit, seconds in UNITS["s"].items()} if found else {}
    unit = next((unit for unit, n in frames.items() if unit != "s" and abs(n - 1.0) <= RATIO_TOLERANCE), None)
    if unit is not None:
        return unit_finding("time", bad, f"{text}: it looks like {unit}", "give time in s")
    return unit_finding("time", bad, text, "give time in s and the frame rate of the recording")


def wrong_speed_or_position(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Steps of position that are not speed x time."""
    rows, step, expected = moving_steps(table, info)
    if rows.size < MIN_STEPS:
        return None
    ratio = float(np.median(step / expected))
    # Noise moves the median of a few short steps, but not their sum, and a jump moves only the sum.
    if min(abs(ratio - 1.0), abs(np.sum(step) / np.sum(expected) - 1.0)) <= RATIO_TOLERANCE:
        return None
    text = f"vehicles move {ratio:.3f} times as far as speed x time"
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
    return unit_finding(column, bad, text, remedy)


def wrong_ground(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Steps in x, y that are not those of position."""
    rows, step, _ = moving_steps(table, info)
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
    return unit_finding("x", bad, text, "give x, y and position in m and in the same road frame")


def wrong_size(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Median lengths and widths that no class of vehicle has."""
    vehicle_class = table["vehicle_class"].cat.codes.to_numpy()
    for (name, which), (low, high) in MEDIAN_SIZE.items():
        values = table[name].to_numpy()
        chosen = (vehicle_class == CLASSES.index(which)) & np.isfinite(values)
        if not chosen.any():
            continue
        median = float(np.median(values[chosen]))
        if not low <= median <= high:
            hints = {SI_FACTOR["ft"]: " (feet?)", 1.0 / SI_FACTOR["ft"]: " (metres, read as feet?)"}
            hint = next((words for factor, words in hints.items() if low <= median * factor <= high), "")
            text = f"the median {name} of class {which} is {median:.2f} m, outside {low:g} to {high:g} m{hint}"
            outside = chosen & ((values < low) | (values > high))
            remedy = f"convert {name} to m, or to the unit that the format has, or leave the column out"
            return unit_finding(name, outside, text, remedy)
    return None


def wrong_acceleration(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """Accelerations that contradict the changes of speed, or exceed tyre friction without agreeing with them.

    Where they agree, the same noise is in both, such as that of differentiated positions.
    """
    values = table["acceleration"].to_numpy()
    _, mean, change = mean_accelerations(table, info)
    if len(mean):
        scale = scale_of(mean, change)
        if scale is not None and is_other_unit(scale):
            text = f"acceleration is {scale[0]:.2f} to {scale[1]:.2f} times the change of speed per second"
            return unit_finding("acceleration", np.isfinite(values), text, "convert acceleration to m/s^2")
        if scale is not None:
            return None
    known = np.abs(values[np.isfinite(values)])
    if known.size >= MIN_STEPS and np.percentile(known, 99) > ACCELERATION_P99:
        text = f"1 % of |acceleration| is above {np.percentile(known, 99):.1f} m/s^2, beyond tyre friction"
        return unit_finding("acceleration", np.abs(values) > ACCELERATION_P99, text, "convert acceleration to m/s^2")
    return None


def mean_accelerations(table: pd.DataFrame, info: RecordingInfo) -> tuple[int, np.ndarray, np.ndarray]:
    """Steps n in AVERAGING_TIME, and over each n steps the mean acceleration and change of speed per second [m/s^2].

    The mean is NaN over rows that are not consecutive frames of one vehicle.
    """
    track, frame, speed, values = (table[name].to_numpy() for name in ("track_id", "frame", "speed", "acceleration"))
    n = max(round(AVERAGING_TIME * info.frame_rate), 1)
    if len(table) <= n:
        return n, np.empty(0), np.empty(0)
    mean = np.convolve(0.5 * (values[1:] + values[:-1]), np.full(n, 1.0 / n), mode="valid")
    consecutive = (track[n:] == track[:-n]) & (frame[n:] - frame[:-n] == n)
    return n, np.where(consecutive, mean, np.nan), (speed[n:] - speed[:-n]) * info.frame_rate / n


def moving_steps(table: pd.DataFrame, info: RecordingInfo) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows after a step of a moving vehicle, the step of position [m], and speed x time [m].

    A vehicle counts as moving by its speed, or by its positions if these move over the whole track: with a speed in
    another unit all vehicles may seem to stand still.
    """
    track, frame, speed, position = (table[name].to_numpy() for name in ("track_id", "frame", "speed", "position"))
    starts, ends = first_and_last_rows(track)
    time = np.maximum(frame[ends] - frame[starts], 1) / info.frame_rate
    moved = np.repeat(np.abs(position[ends] - position[starts]) / time > MIN_SPEED, ends - starts + 1)
    rows = np.flatnonzero(follows_row_before(track))
    step = position[rows] - position[rows - 1]
    dt = (frame[rows] - frame[rows - 1]) / info.frame_rate
    slower, mean = np.minimum(speed[rows], speed[rows - 1]), 0.5 * np.abs(speed[rows] + speed[rows - 1])
    moving = (slower > MIN_SPEED) | (moved[rows] & (np.abs(step) > MIN_SPEED * dt))
    moving &= step != 0.0
    # Not 0, because callers divide by it; any speed below that of the slowest moving vehicle would do.
    expected = np.maximum(mean, 1e-3) * dt
    return rows[moving], step[moving], expected[moving]


def unit_finding(column: str, rows: np.ndarray, problem: str, remedy: str) -> Finding | None:
    """The finding for a column in another unit; None if no row is marked."""
    return Finding("wrong_units", column, rows, problem, remedy) if rows.any() else None
