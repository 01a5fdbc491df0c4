"""The clock of a table: its frame rate from times that may be rounded, and the unit that the times are in."""

import numpy as np

STANDARD_RATES = (1.0, 2.0, 5.0, 10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 100.0, 120.0, 200.0)
"""Frames per second of usual cameras and receivers [1/s]; preferred where rounded times leave a choice."""
NTSC_RATES = (24000 / 1001, 30000 / 1001, 60000 / 1001)
"""Frames per second of NTSC video [1/s]: 23.976, 29.97 and 59.94."""
SECONDS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
"""Units of time that are not the second [s]."""
PLAUSIBLE_RATES = (0.5, 300.0)
"""Frames per second of recordings of traffic [1/s]; beyond them times are in another unit."""
_LARGEST_STEP = 3  # of resolution: 10^3 s
_FINEST = 9  # of resolution: 10^-9 s
_DECIMALS = 6  # of a frame rate that is none of the usual ones


def resolution(time: np.ndarray) -> float:
    """The largest power of ten that all times are multiples of [unit of time]; 0 if they are multiples of none."""
    time = time[np.isfinite(time)]
    if not time.size or not np.any(time):
        return 0.0
    noise = 4.0 * np.finfo(np.float64).eps * float(np.max(np.abs(time)))
    for power in range(_LARGEST_STEP, -_FINEST - 1, -1):
        step = 10.0**power
        if np.all(np.abs(time - step * np.rint(time / step)) <= noise + 1e-9 * step):
            return step
    return 0.0


def period_of(track: np.ndarray, frame: np.ndarray, time: np.ndarray) -> tuple[float, float] | None:
    """Time between two frames and its uncertainty, in the unit of the times; None if no track tells it.

    The rounding of a time is the same for a step and for a whole track, so tracks tell the period better than steps,
    and the whole recording tells it best, if its tracks share a clock.

    Args:
        track: Vehicle of each row.
        frame: Frame of each row.
        time: Time of each row; what is not finite does not count.
    """
    known = np.flatnonzero(np.isfinite(track) & np.isfinite(frame) & np.isfinite(time))
    order = known[np.lexsort((frame[known], track[known]))]
    track, frame, time = track[order], frame[order], time[order]
    starts = np.flatnonzero(np.r_[True, track[1:] != track[:-1]]) if len(track) else np.empty(0, np.int64)
    spans, periods = [], []
    for start, stop in zip(starts, np.r_[starts[1:], len(track)], strict=True):
        # Medians of both ends: a single wrong time must not tilt the track.
        part = max((stop - start) // 3, 1)
        ends = slice(start, start + part), slice(stop - part, stop)
        span, length = (np.median(values[ends[1]]) - np.median(values[ends[0]]) for values in (frame, time))
        if span > 0 and length > 0:
            spans.append(span)
            periods.append(length / span)
    if not spans:
        return None
    long = np.array(spans) >= 0.5 * max(spans)
    period = float(np.median(np.array(periods)[long]))
    rounding = resolution(time) + 8.0 * np.finfo(np.float64).eps * float(np.max(np.abs(time)))
    uncertainty = rounding / max(spans)
    off = time - period * (frame - frame[0])
    low, high = np.quantile(frame, (0.1, 0.9))
    span = float(np.median(frame[frame >= high]) - np.median(frame[frame <= low]))
    if span > max(spans):
        drift = float(np.median(off[frame >= high]) - np.median(off[frame <= low])) / span
        if abs(drift) <= 2.0 * uncertainty:
            period, uncertainty = period + drift, rounding / span
    return period, uncertainty


def rate_of(period: float, uncertainty: float) -> float:
    """Frames per second: the most usual rate within the uncertainty of the period.

    Args:
        period: Time between two frames [s].
        uncertainty: By how much it may be off [s].
    """
    for rates in (STANDARD_RATES, NTSC_RATES):
        rate = min(rates, key=lambda rate: abs(1.0 / rate - period))
        if abs(1.0 / rate - period) <= uncertainty + 1e-9 * period:
            return rate
    for decimals in range(_DECIMALS):
        rate = round(1.0 / period, decimals)
        if rate > 0.0 and abs(1.0 / rate - period) <= uncertainty + 1e-9 * period:
            return rate
    return round(1.0 / period, _DECIMALS)


def unit_of(period: float, scale: float | None) -> str | None:
    """Unit of the times if it is not the second.

    Args:
        period: Time between two frames in that unit.
        scale: Steps of position over speed x time; None where no vehicle moves.
    """
    for unit, seconds in SECONDS.items():
        is_plausible = PLAUSIBLE_RATES[0] <= 1.0 / (period * seconds) <= PLAUSIBLE_RATES[1]
        if scale is None:
            is_this = not PLAUSIBLE_RATES[0] / 20.0 <= 1.0 / period <= PLAUSIBLE_RATES[1]
        else:
            is_this = abs(scale / seconds - 1.0) < 0.1
        if is_plausible and is_this:
            return unit
    return None
