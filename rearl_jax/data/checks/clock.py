"""Frame rate of a table from times that may be rounded, and the unit of the times."""

from collections.abc import Collection

import numpy as np

from rearl_jax.data.units import UNITS
from rearl_jax.data.vehicle_rows import first_and_last_rows, follows_row_before

STANDARD_RATES = (1.0, 2.0, 5.0, 10.0, 12.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 100.0, 120.0, 200.0)
"""Frame rates of usual cameras and receivers [1/s]; preferred where rounded times allow several rates."""
NTSC_RATES = (24000 / 1001, 30000 / 1001, 60000 / 1001)
"""Frame rates of NTSC video [1/s]: 23.976, 29.97 and 59.94."""
PLAUSIBLE_RATES = (0.5, 300.0)
"""Lowest and highest frame rate of traffic recordings [1/s]; outside of this range the times are in another unit."""
FRAME_TOLERANCE = 0.3
"""Largest deviation of a time from its frame, as a share of the frame interval [-]."""
MAX_IRREGULAR_SHARE = 0.05
"""Share of rows with a larger deviation [-] above which the times are not multiples of one step."""
_MAX_STEP_EXPONENT = 3  # of resolution: 10^3 s
_MIN_STEP_EXPONENT = 9  # of resolution: 10^-9 s
_DECIMALS = 6  # of an unusual frame rate


def resolution(time: np.ndarray) -> float:
    """The largest power of ten that all times are multiples of [unit of time]; 0 if they are multiples of none."""
    time = time[np.isfinite(time)]
    if not time.size or not np.any(time):
        return 0.0
    noise = 4.0 * np.finfo(np.float64).eps * np.abs(time)  # of each time, so that an absurd one hides no step
    for power in range(_MAX_STEP_EXPONENT, -_MIN_STEP_EXPONENT - 1, -1):
        step = 10.0**power
        if np.all(np.abs(time - step * np.rint(time / step)) <= noise + 1e-9 * step):
            return step
    return 0.0


def period_of(track: np.ndarray, frame: np.ndarray, time: np.ndarray) -> tuple[float, float] | None:
    """Time between two frames and its uncertainty, in the unit of the times; None if no track determines it.

    The period follows from the ends of tracks, because rounding errors matter less over a long time. It is refined on
    the whole recording if all tracks share a clock. Rows in which a value is not finite are ignored.
    """
    known = np.flatnonzero(np.isfinite(track) & np.isfinite(frame) & np.isfinite(time))
    order = known[np.lexsort((frame[known], track[known]))]
    track, frame, time = track[order], frame[order], time[order]
    if not len(track):
        return None
    frames_between, periods = [], []
    for first, last in zip(*first_and_last_rows(track), strict=True):
        # Medians over the first and the last third, so that a single wrong time does not change the period.
        part = max((last + 1 - first) // 3, 1)
        ends = slice(first, first + part), slice(last + 1 - part, last + 1)
        n_frames, duration = (np.median(values[ends[1]]) - np.median(values[ends[0]]) for values in (frame, time))
        if n_frames > 0 and duration > 0:
            frames_between.append(n_frames)
            periods.append(duration / n_frames)
    if not frames_between:
        return None
    is_long = np.array(frames_between) >= 0.5 * max(frames_between)
    period = float(np.median(np.array(periods)[is_long]))
    same = follows_row_before(track)[1:]
    scatter = 2.0 * float(np.median(np.abs(np.diff(time)[same] - period * np.diff(frame)[same])))
    rounding = max(resolution(time), scatter, _spacing_of_singles(time)) + 8.0 * np.finfo(np.float64).eps * float(
        np.median(np.abs(time))
    )
    uncertainty = rounding / max(frames_between)
    deviation = time - period * (frame - frame[0])
    low, high = np.quantile(frame, (0.1, 0.9))
    n_frames = float(np.median(frame[frame >= high]) - np.median(frame[frame <= low]))
    if n_frames > max(frames_between):
        # Per frame. A larger drift shows that the clocks of the tracks differ.
        drift = float(np.median(deviation[frame >= high]) - np.median(deviation[frame <= low])) / n_frames
        if abs(drift) <= 2.0 * uncertainty:
            period, uncertainty = period + drift, rounding / n_frames
    return period, uncertainty


def _spacing_of_singles(time: np.ndarray) -> float:
    """Distance between two float32 numbers of the size of the times, if all times are float32 numbers; else 0."""
    with np.errstate(over="ignore"):
        single = time.astype(np.float32)
    return float(np.spacing(np.max(np.abs(single)))) if np.array_equal(single, time) else 0.0


def rate_of(period: float, uncertainty: float) -> float:
    """Frame rate [1/s]: the most usual one within the uncertainty of the period between two frames, both in s."""
    for rates in (STANDARD_RATES, NTSC_RATES):
        rate = min(rates, key=lambda rate: abs(1.0 / rate - period))
        if abs(1.0 / rate - period) <= uncertainty + 1e-9 * period:
            return rate
    for decimals in range(_DECIMALS):
        rate = round(1.0 / period, decimals)
        if rate > 0.0 and abs(1.0 / rate - period) <= uncertainty + 1e-9 * period:
            return rate
    return round(1.0 / period, _DECIMALS)


def unit_of(period: float, scale: float | None, ratios: Collection[float] = ()) -> str | None:
    """Unit of the times; None if it cannot be determined.

    The motion of vehicles determines it best, even if position or speed is in another unit. Without motion it follows
    from the period, if this is plausible for a traffic recording in one unit only, and is not 1 as in frame numbers.

    Args:
        period: Time between two frames in that unit.
        scale: Ratio of the steps of position to speed x time; None where no vehicle moves.
        ratios: Values of this ratio if position or speed is in a usual unit other than that of SI.
    """
    seconds = UNITS["s"]
    units = [unit for unit in seconds if PLAUSIBLE_RATES[0] <= 1.0 / (period * seconds[unit]) <= PLAUSIBLE_RATES[1]]
    if scale is not None:
        for wanted, tried in (((1.0,), ("s", *units)), (ratios, units)):
            for unit in tried:
                if any(abs(scale / seconds[unit] / ratio - 1.0) < 0.07 for ratio in wanted):
                    return unit
    far = 20.0 / PLAUSIBLE_RATES[0]  # longer than any frame interval in s
    by_step = [unit for unit in units if unit not in ("min", "h") and (unit == "s" or period > far)]
    return by_step[0] if by_step and period != 1.0 else None


def frames_of(track: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Frame of each row, counted from the first time, and the frame interval in the unit of the times.

    None if the times of a track do not rise by multiples of one step, for example because they are rounded too much.
    Where a time is not finite, the frame is NaN.
    """
    known = np.flatnonzero(np.isfinite(track) & np.isfinite(time))
    order = known[np.lexsort((time[known], track[known]))]
    same = np.diff(track[order]) == 0
    steps = np.diff(time[order])[same]
    if not (steps > 0.0).any():
        return None
    period = float(np.median(steps[steps > 0.0]))
    number = np.zeros(len(order))
    # Steps rounded to 0.03 and 0.04 may be frames 1/30 apart: renumber with the period that the whole track implies.
    for _ in range(3):
        rises = np.where(same, np.maximum(np.rint(np.diff(time[order]) / period), 0.0), 0.0)
        number[1:] = np.cumsum(rises)
        estimate = period_of(track[order], number, time[order])
        if estimate is None:
            return None
        period = estimate[0]
    first = float(np.min(time[order]))
    period = _refined(time[order] - first, period)
    frame = np.full(len(time), np.nan)
    frame[order] = np.rint((time[order] - first) / period)
    off = np.abs(time[order] - first - frame[order] * period)
    share_off = np.mean(np.abs(off - np.median(off)) > FRAME_TOLERANCE * period)
    is_twice = np.any((np.diff(frame[order])[same] == 0) & (steps > 0.0))
    return None if share_off > MAX_IRREGULAR_SHARE or is_twice else (frame, period)


def _refined(time: np.ndarray, period: float) -> float:
    """Period that fits the whole recording, refined by regressions over longer and longer parts of it."""
    low, high = float(np.min(time)), float(np.max(time))
    reach = 50.0 * period
    while reach < 2.0 * (high - low):
        part = time[time <= low + reach]
        frame = np.rint(part / period)
        squares = float(np.sum(frame * frame))
        period = float(np.sum(frame * part)) / squares if squares > 0.0 else period
        reach *= 2.0
    return period
