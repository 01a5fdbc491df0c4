"""Frame rate of a recording from the steps of its times, and the frames of times; another unit is an error."""

from pathlib import Path

import numpy as np

from rearl_jax.data.checks import clock
from rearl_jax.data.problems import bad_recording

_TOLERANCE = 0.02
"""Largest relative difference between the median step and that of a usual frame rate [-]; times are rounded."""
_EXACT = 1e-6
"""The same for the mean of all steps if times are not rounded [-]."""
MAX_FRAME_OFFSET = 0.1
"""Frames [-] by which the times of a vehicle may differ from those of the others without a note."""
_ROUNDING = 1e-3  # frames; error of a time that has been rounded


def frame_rate_of(steps: np.ndarray, file: Path | str, column: str) -> float:
    """Frames per second [1/s]: the usual rate nearest to the median of the positive steps [s] along tracks.

    Raises:
        BadRecordingError: The times are not in seconds, or no vehicle has two rows.
    """
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not steps.size:
        text = "no vehicle has two rows with different times"
        raise bad_recording("frame-rate-unknown", text, "complete the times", file, column=column)
    period = float(np.median(steps))
    unit = clock.unit_of(period, None)
    is_other = unit not in (None, "s")
    rate = usual_rate_of(steps) or clock.rate_of(period, _TOLERANCE * period)
    if is_other or not clock.PLAUSIBLE_RATES[0] <= rate <= clock.PLAUSIBLE_RATES[1]:
        text = f"the times of a vehicle are {period:g} apart" + (f": they look like {unit}" if is_other else "")
        raise bad_recording("wrong-units", text, "give the times in s", file, column=column)
    return rate


def usual_rate_of(steps: np.ndarray, n_tracks: int = 1) -> float | None:
    """The usual frame rate [1/s] of positive steps [s] along tracks, by their mean, which rounding hardly changes.

    None if it is not a usual one. Longer steps, where rows are missing, do not count.
    """
    used = steps[steps < 1.5 * np.median(steps)]
    mean = float(np.mean(used))
    rate = clock.rate_of(mean, clock.resolution(used) * n_tracks / len(used) + _EXACT * mean)
    return rate if rate in (*clock.STANDARD_RATES, *clock.NTSC_RATES) else None


def require_distinct_times(steps: np.ndarray, moved: np.ndarray, file: Path | str, column: str) -> None:
    """Raise BadRecordingError if many rows have the time of the row before of their vehicle at another place.

    `steps` are the steps of time along tracks, `moved` the distances to the row before.
    """
    share = float(np.mean((steps == 0.0) & (moved > 0.0))) if steps.size else 0.0
    if share > clock.MAX_IRREGULAR_SHARE:
        text = f"{share:.0%} of the rows have the time of the row before of their vehicle: times are too coarse"
        raise bad_recording("times-too-coarse", text, "write the time of every frame", file, column=column)


def frames_of(time: np.ndarray, begins: np.ndarray, rate: float) -> tuple[np.ndarray, tuple[str, ...]]:
    """Frame of each row, NaN where the time is not finite; and a note if vehicles have times between the frames.

    Frames are counted from the first time of each vehicle, so that also times between those of the other vehicles are
    whole frames apart.

    Args:
        time: Time of each row [s], the rows of a vehicle together.
        begins: Number of the first row of each vehicle, ascending.
        rate: Frames per second [1/s].
    """
    first = np.fmin.reduceat(np.where(np.isfinite(time), time, np.nan), begins)
    counts = np.diff(begins, append=len(time))
    exact = first * rate - phase_of(first * rate)
    # All halves are rounded up, whatever their last digits.
    begin = np.floor(exact + 0.5 + _ROUNDING)
    n_between = int((np.abs(exact - begin) > MAX_FRAME_OFFSET).sum())
    notes = (between_frames(n_between),) if n_between else ()
    return np.repeat(begin, counts) + np.rint((time - np.repeat(first, counts)) * rate), notes


def between_frames(n_vehicles: int) -> str:
    """The note on vehicles whose times are more than MAX_FRAME_OFFSET away from the frames."""
    return f"{n_vehicles} vehicles have times between those of the others, up to half a frame off"


def phase_of(frames: np.ndarray) -> float:
    """Distance of most times, in frame intervals, from whole numbers, -0.5 to 0.5: the median direction on a circle.

    Times that are not finite are ignored.
    """
    angle = 2.0 * np.pi * (frames[np.isfinite(frames)] % 1.0)
    if not angle.size:
        return 0.0
    return float(np.arctan2(np.median(np.sin(angle)), np.median(np.cos(angle))) / (2.0 * np.pi))
