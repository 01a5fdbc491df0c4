"""Checks of single vehicles: their positions, speeds and accelerations must agree with one another.

A median over all vehicles would hide one vehicle whose speed is always 0, or that drives backwards.
"""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.typed_table import follows_row_before
from rearl_jax.data.checks.unit_checks import AVERAGING_TIME, MIN_CORRELATION, MIN_STEPS
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo

MIN_MOVING_STEPS = 5
"""Number of moving steps that a vehicle must have to be judged."""
MIN_MOVING_TIME = 2.0
"""Time [s] that a vehicle must have moved to be judged. The faults that cause a jump may also distort the second before
and after it.
"""
MIN_MOVING_SPEED = 1.0
"""Speed [m/s] below which the noise of positions may exceed the distance between two frames."""
MIN_DISTANCE = 5.0
"""Distance [m] that a vehicle must have moved to be judged, well above the noise of positions."""
MOTION_TOLERANCE = 0.3
"""Relative difference [-] allowed between the distance moved and speed x time.

Over whole tracks it is .13 or less in NGSIM and OpenACC; the least wrong unit gives .47.
"""
ACCELERATION_SCALE = (0.25, 1.8)
"""Smallest and largest ratio [-] of acceleration to change of speed per second that measurement errors explain.

Outside of this range the sign or the unit is wrong. The tracks of NGSIM and FHWA are between .39 and 1.28; NGSIM's
accelerations are clipped.
"""


def wrong_motion(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows of vehicles whose speeds, ground positions or accelerations contradict their positions or speeds."""
    track = table["track_id"].to_numpy()
    vehicle = np.cumsum(~follows_row_before(track)) - 1
    rows = np.flatnonzero(follows_row_before(track))
    dt = (table["frame"].to_numpy()[rows] - table["frame"].to_numpy()[rows - 1]) / info.frame_rate
    speed, position, x, y = (table[name].to_numpy() for name in ("speed", "position", "x", "y"))
    step = position[rows] - position[rows - 1]
    expected = 0.5 * (speed[rows] + speed[rows - 1]) * dt
    ground = np.hypot(x[rows] - x[rows - 1], y[rows] - y[rows - 1])
    for column, measured, predicted in (("speed", step, expected), ("x", ground, np.abs(step))):
        wrong = _contradicting(vehicle[rows], measured, predicted, dt)
        if wrong is not None:
            vehicles, total, other = wrong
            first = track[int(np.argmax(vehicle == vehicles[0]))]
            what = "moves {:.1f} m where speed x time is {:.1f} m" if column == "speed" else "moves {:.1f} m in x, y "
            text = f"vehicle {first} " + what.format(total, other)
            text += "" if column == "speed" else f"and {other:.1f} m in position"
            remedy = "position must grow while driving, and all columns must be of the same vehicle and unit"
            return Finding("wrong_motion", column, np.isin(vehicle, vehicles), text, remedy)
    vehicles = _wrongly_accelerating(table, vehicle, info)
    if vehicles.size:
        first = track[int(np.argmax(vehicle == vehicles[0]))]
        text = f"the acceleration of vehicle {first} is not the change of its speed per second"
        remedy = "give it in m/s^2 along the driving direction, negative for braking"
        return Finding("wrong_motion", "acceleration", np.isin(vehicle, vehicles), text, remedy)
    return None


def _contradicting(
    vehicle: np.ndarray, measured: np.ndarray, predicted: np.ndarray, dt: np.ndarray
) -> tuple[np.ndarray, float, float] | None:
    """Vehicles whose measured and predicted distances differ in most steps and in total; totals of the first [m]."""
    size = np.maximum(np.abs(measured), np.abs(predicted))
    moving = size > MIN_MOVING_SPEED * dt
    off = np.abs(measured - predicted) > MOTION_TOLERANCE * size
    number, n_off, time = (np.bincount(vehicle, weights=values) for values in (moving, moving & off, moving * dt))
    total, other = (np.bincount(vehicle, weights=values) for values in (measured, predicted))
    far = np.maximum(np.abs(total), np.abs(other))
    wrong = (number >= MIN_MOVING_STEPS) & (time >= MIN_MOVING_TIME) & (far > MIN_DISTANCE)
    wrong &= (n_off > 0.5 * number) & (np.abs(total - other) > MOTION_TOLERANCE * far)
    vehicles = np.flatnonzero(wrong)
    return (vehicles, float(total[vehicles[0]]), float(other[vehicles[0]])) if vehicles.size else None


def _wrongly_accelerating(table: pd.DataFrame, vehicle: np.ndarray, info: RecordingInfo) -> np.ndarray:
    """Vehicles whose accelerations correlate with their changes of speed, but with a wrong sign or unit."""
    speed, values = table["speed"].to_numpy(), table["acceleration"].to_numpy()
    n = max(round(AVERAGING_TIME * info.frame_rate), 1)
    if len(table) <= n:
        return np.empty(0, np.int64)
    mean = np.convolve(0.5 * (values[1:] + values[:-1]), np.full(n, 1.0 / n), mode="valid")
    change = (speed[n:] - speed[:-n]) * info.frame_rate / n
    used = (vehicle[n:] == vehicle[:-n]) & np.isfinite(mean)
    number, mean, change = vehicle[n:][used], mean[used], change[used]
    sums = {
        name: np.bincount(number, weights=weights, minlength=vehicle[-1] + 1)
        for name, weights in (("n", None), ("product", mean * change), ("own", mean**2), ("other", change**2))
    }
    alike = np.abs(sums["product"]) > MIN_CORRELATION * np.sqrt(sums["own"] * sums["other"])
    alike &= (sums["n"] >= MIN_STEPS) & (sums["product"] != 0.0)
    product = np.where(alike, sums["product"], 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.stack([product / sums["other"], sums["own"] / product])
    low, high = np.min(slopes, axis=0), np.max(slopes, axis=0)
    return np.flatnonzero(alike & ((high < ACCELERATION_SCALE[0]) | (low > ACCELERATION_SCALE[1])))
