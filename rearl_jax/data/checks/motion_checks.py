"""Checks of single vehicles: their positions, speeds and accelerations must agree with one another.

A median over all vehicles would hide one vehicle whose speed is always 0 or that drives backwards, and a sum over a
track would hide a fault in a part of it. So every track is checked as a whole and in stretches of some seconds.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.unit_checks import MIN_CORRELATION, MIN_STEPS, mean_accelerations
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.vehicle_rows import follows_row_before

MIN_MOVING_STEPS = 5
"""Number of moving steps that a vehicle must have to be checked."""
MIN_MOVING_TIME = 2.0
"""Time [s] that a vehicle must have moved to be checked. A fault that causes a jump may also distort the second before
and after it, which must not count as a wrong motion.
"""
MIN_MOVING_SPEED = 1.0
"""Speed [m/s] below which the noise of positions may exceed the distance between two frames."""
MIN_DISTANCE = 5.0
"""Distance [m] that a vehicle must have moved to be checked, well above the noise of positions."""
MOTION_TOLERANCE = 0.3
"""Relative difference [-] allowed between the distance moved and speed x time.

Measured: 0.13 or less over whole tracks of NGSIM and OpenACC, 0.12 over stretches. The wrong unit that is nearest to
the right one gives 0.47.
"""
STRETCH = 5.0
"""Length of a stretch [s], several times that of a dropout of a GPS receiver."""
LAGS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Delays [s] that the speeds of a source may have; the distance moved must be between speed x time for these delays."""
ACCELERATION_STRETCH = 15.0
"""Length of a stretch for accelerations [s]; in a shorter one noise may look like accelerations of the wrong sign."""
MIN_CHANGE = 0.3
"""Smallest root mean square of the changes of speed [m/s^2] that determines the sign of a stretch's accelerations."""
ACCELERATION_SCALE = (0.25, 1.8)
"""Smallest and largest ratio [-] of acceleration to change of speed per second that measurement errors explain.

Outside of this range the sign or the unit is wrong. Measured: 0.39 to 1.28 for the tracks of NGSIM and FHWA; NGSIM's
accelerations are clipped.
"""
MAX_BACKWARD = 1.0
"""Largest backward speed [m/s] that errors of tracking and of satellite receivers give to standing vehicles; noise of
receivers is 0.07 m/s in OpenACC.
"""


def standing(speed: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The speeds with 0 in place of small negative ones, and a note that states their number [m/s]."""
    backward = (speed < 0.0) & (speed >= -MAX_BACKWARD)
    notes = [f"{int(backward.sum())} speeds between -{MAX_BACKWARD:g} and 0 m/s set to 0"] if backward.any() else []
    return np.where(backward, 0.0, speed), notes


def wrong_motion(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of vehicles whose speeds, ground positions or accelerations contradict their positions or speeds."""
    track = table["track_id"].to_numpy()
    follows = follows_row_before(track)
    vehicle = np.cumsum(~follows) - 1
    speed, position, x, y = (table[name].to_numpy() for name in ("speed", "position", "x", "y"))
    dt = _steps(table["frame"].to_numpy(), follows) / info.frame_rate
    step = _steps(position, follows)
    expected = np.where(follows, 0.5 * (speed + np.roll(speed, 1)), 0.0) * dt
    ground = np.hypot(_steps(x, follows), _steps(y, follows))
    for column, measured, predicted in (("speed", step, expected), ("x", ground, np.abs(step))):
        masks = _steps_off(measured, predicted, dt)
        rows = _of_whole_tracks(vehicle, measured, predicted, dt, *masks)
        if not rows.any():
            stretch = _Stretches(vehicle, round(STRETCH * info.frame_rate))
            if column == "speed":
                low, high = stretch.between(expected, [round(lag * info.frame_rate) for lag in LAGS])
                moved = stretch.change(position)
            else:
                low = high = np.abs(stretch.change(position))
                moved = np.hypot(stretch.change(x), stretch.change(y))
            rows = stretch.rows(_apart(moved, low, high) & _mostly(*(stretch.sums(mask) for mask in masks)))
        if rows.any():
            row = int(np.argmax(rows))
            first = rows & (vehicle == vehicle[row])  # those of the first vehicle
            total, predicted_total = float(measured[first & follows].sum()), float(predicted[first & follows].sum())
            other = f"in x, y and {predicted_total:.1f} m in position"
            other = f"where speed x time is {predicted_total:.1f} m" if column == "speed" else other
            text = f"vehicle {track[row]} moves {total:.1f} m {other}"
            text += f", in the {dt[first].sum():.1f} s from frame {table['frame'].iloc[row]}"
            remedy = "position must grow while driving, and all columns must be of the same vehicle and unit"
            return Finding("wrong_motion", column, rows, text, remedy)
    rows = _wrongly_accelerating(table, vehicle, info)
    if rows.any():
        row = int(np.argmax(rows))
        text = f"from frame {table['frame'].iloc[row]} the acceleration of vehicle {track[row]} is not the change of "
        remedy = "give it in m/s^2 along the driving direction, negative for braking"
        return Finding("wrong_motion", "acceleration", rows, f"{text}its speed per second", remedy)
    return None


class _Stretches:
    """All stretches of n steps, from the row `first` to the row `last`, both of one vehicle."""

    def __init__(self, vehicle: np.ndarray, n: int) -> None:
        self._vehicle, self._n = vehicle, max(n, 1)
        self.first = np.flatnonzero(vehicle[self._n :] == vehicle[: -self._n])
        self.last = self.first + self._n

    def change(self, values: np.ndarray) -> np.ndarray:
        """Growth of a value over each stretch."""
        return values[self.last] - values[self.first]

    def sums(self, of_steps: np.ndarray) -> np.ndarray:
        """Sum over the steps of each stretch; a step is given at the row in which it ends."""
        return self.change(np.cumsum(of_steps, dtype=np.float64))

    def between(self, of_steps: np.ndarray, shifts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest sum over the steps of each stretch, shifted by these numbers of rows in its track."""
        starts = np.flatnonzero(np.diff(self._vehicle, prepend=-1))
        ends = np.append(starts[1:], len(self._vehicle)) - 1
        of_stretch = self._vehicle[self.first]
        back, ahead = starts[of_stretch] - self.first, ends[of_stretch] - self.last
        total = np.cumsum(of_steps)
        moves = (np.clip(shift, back, ahead) for shift in shifts)
        sums = np.stack([total[self.last + move] - total[self.first + move] for move in moves])
        return np.min(sums, axis=0), np.max(sums, axis=0)

    def rows(self, bad: np.ndarray) -> np.ndarray:
        """Mask of the rows of the marked stretches."""
        n_rows = len(self._vehicle)
        # 1 where a stretch begins, -1 after its end: the running sum counts the stretches that contain a row.
        begun = (
            np.bincount(self.first[bad], minlength=n_rows) - np.bincount(self.last[bad] + 1, minlength=n_rows + 1)[:-1]
        )
        return np.cumsum(begun) > 0


def _steps(values: np.ndarray, follows: np.ndarray) -> np.ndarray:
    """Difference to the row before; 0 in the first row of a track."""
    return np.where(follows, np.diff(values, prepend=values[:1]), 0.0)


def _steps_off(measured: np.ndarray, predicted: np.ndarray, dt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the steps of a moving vehicle, and of those among them whose two distances [m] differ; dt in s."""
    size = np.maximum(np.abs(measured), np.abs(predicted))
    moving = size > MIN_MOVING_SPEED * dt
    return moving, moving & (np.abs(measured - predicted) > MOTION_TOLERANCE * size)


def _mostly(n_moving: np.ndarray, n_off: np.ndarray) -> np.ndarray:
    """True where most moving steps disagree, not a single one at a jump."""
    return (n_moving >= MIN_MOVING_STEPS) & (n_off > 0.5 * n_moving)


def _apart(moved: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """True where the distance moved is outside two bounds by more than noise and tolerance explain."""
    off = np.maximum(moved - high, low - moved)
    return (off > MIN_DISTANCE) & (
        off > MOTION_TOLERANCE * np.maximum.reduce([np.abs(moved), np.abs(low), np.abs(high)])
    )


def _of_whole_tracks(
    vehicle: np.ndarray,
    measured: np.ndarray,
    predicted: np.ndarray,
    dt: np.ndarray,
    moving: np.ndarray,
    off: np.ndarray,
) -> np.ndarray:
    """Mask of the rows of vehicles whose measured and predicted distances [m] differ in most steps and in total.

    `moving` and `off` are the masks of `_steps_off`.
    """
    n_moving, n_off, time = (np.bincount(vehicle, weights=values) for values in (moving, off, moving * dt))
    total, predicted_total = (np.bincount(vehicle, weights=values) for values in (measured, predicted))
    far = np.maximum(np.abs(total), np.abs(predicted_total))
    wrong = _mostly(n_moving, n_off) & (time >= MIN_MOVING_TIME) & (far > MIN_DISTANCE)
    wrong &= np.abs(total - predicted_total) > MOTION_TOLERANCE * far
    return wrong[vehicle]


def _wrongly_accelerating(table: pd.DataFrame, vehicle: np.ndarray, info: RecordingInfo) -> np.ndarray:
    """Mask of rows whose accelerations correlate with the changes of speed, but with a wrong sign or unit.

    Compares means of the acceleration with the changes of speed in the same time.
    """
    n, mean, change = mean_accelerations(table, info)
    if not len(mean):
        return np.zeros(len(table), dtype=bool)
    used = np.flatnonzero(np.isfinite(mean))
    number, mean, change = vehicle[n:][used], mean[used], change[used]
    parts = (np.ones(len(used)), mean * change, mean**2, change**2)
    wrong = _has_other_scale(*(np.bincount(number, weights=part, minlength=vehicle[-1] + 1) for part in parts))
    if wrong.any():
        return wrong[vehicle]
    stretch = _Stretches(number, round(ACCELERATION_STRETCH * info.frame_rate))
    count, product, squared, squared_change = (stretch.sums(part) for part in parts)
    # Accelerations that are all 0 have no sign; `remarks` notes them.
    wrong = _has_other_scale(count, product, squared, squared_change)
    wrong &= (squared_change > MIN_CHANGE**2 * count) & (squared > 1e-6 * count)
    rows = np.zeros(len(table), dtype=bool)
    means = used[stretch.rows(wrong)]
    rows[means] = rows[means + n] = True  # the first and the last row of each average
    return rows


def _has_other_scale(
    count: np.ndarray, product: np.ndarray, squared: np.ndarray, squared_change: np.ndarray
) -> np.ndarray:
    """True where accelerations are proportional to the changes of speed, but by a factor outside ACCELERATION_SCALE.

    The arguments are the number of values and the sums of products, of squared accelerations and of squared changes.
    """
    alike = (count >= MIN_STEPS) & (product != 0.0)
    alike &= np.abs(product) > MIN_CORRELATION * np.sqrt(np.abs(squared * squared_change))
    product = np.where(alike, product, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.stack([product / squared_change, squared / product])
    low, high = np.min(slopes, axis=0), np.max(slopes, axis=0)
    return alike & ((high < ACCELERATION_SCALE[0]) | (low > ACCELERATION_SCALE[1]))
