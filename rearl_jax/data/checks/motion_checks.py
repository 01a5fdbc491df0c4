"""Checks of single vehicles: their positions, speeds and accelerations must say the same of their motion.

A median over all vehicles hides one whose speed is 0 throughout, or who drives backwards.
"""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.typed_table import follows_row_before
from rearl_jax.data.checks.unit_checks import ALIKE, MIN_STEPS, WINDOW
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo

FEWEST = 5
"""Moving steps of a vehicle, fewer do not tell how it moves."""
SHORTEST_TIME = 2.0
"""Time [s] that a vehicle must have moved: pieces of 1 s beside a jump may be bent by what made the jump."""
SLOW = 1.0
"""Speed [m/s] below which noise of positions may be larger than steps."""
SHORTEST = 5.0
"""Distance [m] that a vehicle must have moved, beyond the noise of positions."""
OFF = 0.3
"""Share by which steps and speed x time of a vehicle may differ.

Over whole tracks they differ by .13 or less in NGSIM and OpenACC; the least wrong unit makes .47.
"""
ACCELERATION_SCALE = (0.25, 1.8)
"""Factors between accelerations and changes of speed that no error makes: beyond them sign or unit is wrong.

The tracks of NGSIM and FHWA are within .39 and 1.28; NGSIM's accelerations are clipped.
"""


def wrong_motion(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Rows of vehicles whose speeds, ground positions or accelerations contradict their positions or speeds."""
    track = table["track_id"].to_numpy()
    which = np.cumsum(~follows_row_before(track)) - 1
    rows = np.flatnonzero(follows_row_before(track))
    dt = (table["frame"].to_numpy()[rows] - table["frame"].to_numpy()[rows - 1]) / info.frame_rate
    speed, position, x, y = (table[name].to_numpy() for name in ("speed", "position", "x", "y"))
    step = position[rows] - position[rows - 1]
    expected = 0.5 * (speed[rows] + speed[rows - 1]) * dt
    ground = np.hypot(x[rows] - x[rows - 1], y[rows] - y[rows - 1])
    for column, measured, wanted in (("speed", step, expected), ("x", ground, np.abs(step))):
        wrong = _disagree(which[rows], measured, wanted, dt)
        if wrong is not None:
            vehicle, total, other = wrong
            first = track[int(np.argmax(which == vehicle[0]))]
            what = "moves {:.1f} m where speed x time is {:.1f} m" if column == "speed" else "moves {:.1f} m in x, y "
            text = f"vehicle {first} " + what.format(total, other)
            text += "" if column == "speed" else f"and {other:.1f} m in position"
            remedy = "position must grow while driving, and all columns must be of the same vehicle and unit"
            return Finding("wrong_motion", column, np.isin(which, vehicle), text, remedy)
    vehicle = _accelerate_otherwise(table, which, info)
    if vehicle.size:
        first = track[int(np.argmax(which == vehicle[0]))]
        text = f"the acceleration of vehicle {first} is not the change of its speed per second"
        remedy = "give it in m/s^2 along the driving direction, negative for braking"
        return Finding("wrong_motion", "acceleration", np.isin(which, vehicle), text, remedy)
    return None


def _disagree(
    which: np.ndarray, measured: np.ndarray, wanted: np.ndarray, dt: np.ndarray
) -> tuple[np.ndarray, float, float] | None:
    """Vehicles most of whose steps, and all of them together, are not those wanted; totals of the first of them [m]."""
    size = np.maximum(np.abs(measured), np.abs(wanted))
    moving = size > SLOW * dt
    off = np.abs(measured - wanted) > OFF * size
    number, n_off, time = (np.bincount(which, weights=values) for values in (moving, moving & off, moving * dt))
    total, other = (np.bincount(which, weights=values) for values in (measured, wanted))
    far = np.maximum(np.abs(total), np.abs(other))
    wrong = (number >= FEWEST) & (time >= SHORTEST_TIME) & (far > SHORTEST)
    wrong &= (n_off > 0.5 * number) & (np.abs(total - other) > OFF * far)
    vehicles = np.flatnonzero(wrong)
    return (vehicles, float(total[vehicles[0]]), float(other[vehicles[0]])) if vehicles.size else None


def _accelerate_otherwise(table: pd.DataFrame, which: np.ndarray, info: RecordingInfo) -> np.ndarray:
    """Vehicles whose accelerations follow changes of speed, but with another sign or unit."""
    speed, values = table["speed"].to_numpy(), table["acceleration"].to_numpy()
    n = max(round(WINDOW * info.frame_rate), 1)
    if len(table) <= n:
        return np.empty(0, np.int64)
    mean = np.convolve(0.5 * (values[1:] + values[:-1]), np.full(n, 1.0 / n), mode="valid")
    change = (speed[n:] - speed[:-n]) * info.frame_rate / n
    used = (which[n:] == which[:-n]) & np.isfinite(mean)
    vehicle, mean, change = which[n:][used], mean[used], change[used]
    sums = {
        name: np.bincount(vehicle, weights=weights, minlength=which[-1] + 1)
        for name, weights in (("n", None), ("product", mean * change), ("own", mean**2), ("other", change**2))
    }
    alike = np.abs(sums["product"]) > ALIKE * np.sqrt(sums["own"] * sums["other"])
    alike &= (sums["n"] >= MIN_STEPS) & (sums["product"] != 0.0)
    product = np.where(alike, sums["product"], 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.stack([product / sums["other"], sums["own"] / product])
    low, high = np.min(slopes, axis=0), np.max(slopes, axis=0)
    return np.flatnonzero(alike & ((high < ACCELERATION_SCALE[0]) | (low > ACCELERATION_SCALE[1])))
