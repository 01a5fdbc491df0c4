"""Measured positions at a reduced time resolution, and smooth speeds and accelerations from them."""

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.linalg import solveh_banded

from rearl_jax.data.records import Recording

SLOWEST_RATE = 7.5
"""Lowest sufficient number of time steps per second [1/s], because drivers do not act faster than within a few tenths
of a second.
"""

AVERAGED = ("time", "position", "lateral", "x", "y", "speed", "acceleration")
"""Columns whose neighbouring frames are averaged."""

TOO_SHORT = 6
"""Largest number of time steps of a track that is too short to be smoothed."""

CUT_OFF = 3.44
"""Angular frequency [rad/s] above which changes of position are regarded as noise, for 0.1 m of noise at 10 Hz."""

CUT_OFF_NOISE = 0.1 * np.sqrt(0.1)
"""Noise density to which CUT_OFF belongs [m sqrt(s)]."""

CUT_OFF_RANGE = (2.0, 12.0)
"""Bounds of the cut-off [rad/s]."""

JUMP = 12.0
"""Change of the acceleration from one time step to the next [m/s^2] beyond any driver's, sudden full braking included.
"""

JUMP_NOISE = 8.0
"""Limit of the change of the acceleration in standard deviations of all its changes [-]; the larger limit holds."""


Thinned = tuple[pd.DataFrame, float]
"""A canonical table, and its time step [s]."""


def thinned(recording: Recording, rate: float | None = None) -> Thinned:
    """The table of a recording at the lowest sufficient time resolution, and its time step [s]; `rate` is the frame
    rate [1/s], None for that of the recording.

    Groups of neighbouring frames are merged: positions are averaged, so that no measurement is lost; lane and leader
    are taken from the last frame of each group.
    """
    rate = rate or recording.info.frame_rate
    n = max(1, int(rate / SLOWEST_RATE))
    table = recording.table
    if n == 1:
        return table, 1.0 / rate
    group = table["frame"].to_numpy() // n
    keys = [table["track_id"].to_numpy(), group]
    grouped = table.groupby(keys, sort=True)
    whole = np.asarray(grouped["frame"].count()) == n
    averages = np.stack([np.asarray(grouped[name].mean()) for name in AVERAGED], axis=1)[whole]
    # Tracks are sorted and without gaps, so the last row of a group is where the next one begins, less one.
    last_row = np.cumsum(np.asarray(grouped["frame"].count())) - 1
    last = table.iloc[last_row[whole]].reset_index(drop=True)
    last[list(AVERAGED)] = averages
    last["frame"] = last["frame"] // n
    return last, n / rate


def track_bounds(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """First row of each track without gaps, and one past its last; the table is sorted by track and frame."""
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    starts = np.flatnonzero(np.r_[True, (track[1:] != track[:-1]) | (frame[1:] != frame[:-1] + 1)])
    return starts, np.r_[starts[1:], len(track)]


def position_noise(position: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> float:
    """Standard deviation of white noise in the positions of all tracks [m], from their fourth differences; `starts` and
    `stops` as of `track_bounds`.

    Source: the fourth difference of white noise of variance 1 has variance 70; motion hardly has any.
    """
    parts = [np.diff(position[a:b], 4) for a, b in zip(starts, stops, strict=True) if b - a > 4]
    return robust_deviation(np.concatenate(parts)) / float(np.sqrt(70.0)) if parts else 0.0


def robust_deviation(values: Float[np.ndarray, " n"]) -> float:
    """Standard deviation of normal values with mean zero from the median of their absolute values, on which a few
    outliers have no influence. Source: Hampel, J. Am. Stat. Assoc. 69 (1974) 383.
    """
    return float(np.median(np.abs(values))) / 0.6745


def jumps(position: np.ndarray, dt: float) -> np.ndarray:
    """True for rows of one track at which its position jumps beyond vehicle motion and noise.

    Such jumps occur when a receiver loses satellites or a sensor switches to another vehicle.
    """
    jumped = np.zeros(len(position), bool)
    if len(position) > 3:
        third = np.diff(position, 3)
        jumped[2:-1] = np.abs(third) > max(JUMP * dt**2, JUMP_NOISE * robust_deviation(third))
    return jumped


def lasting_noise(white: float, time: float, dt: float) -> float:
    """Standard deviation [m] of errors with the correlation time `time` [s] whose fourth differences have the same
    variance as those of white noise [m].
    """
    at_lags = np.array([70.0, -56.0, 28.0, -8.0, 1.0])  # autocorrelation of the fourth-difference operator
    both_sides = np.array([1, 2, 2, 2, 2])  # every lag but 0 occurs twice
    share = (at_lags * np.exp(-dt / time) ** np.arange(5) * both_sides).sum() / 70.0
    return white / float(np.sqrt(share))


def cut_off(noise: float, dt: float) -> float:
    """Angular frequency [rad/s] above which noise exceeds motion.

    Source: Wiener filtering of a motion whose third derivative is white: the cut-off is proportional to the inverse
    cube root of the noise density.
    """
    density = max(noise, 1e-6) * np.sqrt(dt)
    return float(np.clip(CUT_OFF * (CUT_OFF_NOISE / density) ** (1 / 3), *CUT_OFF_RANGE))


def smoothed(position: np.ndarray, dt: float, angular_cut_off: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth position [m], speed [m/s] and acceleration [m/s^2] of one track.

    The smooth position x minimises sum (y - x)^2 + weight sum (third difference of x)^2, y the measured position.

    Source: Whittaker, Proc. Edinburgh Math. Soc. 41 (1923) 63; Eilers, Anal. Chem. 75 (2003) 3631.
    """
    n = len(position)
    x = position
    if n > TOO_SHORT:
        x = low_pass(position - position[0], dt, angular_cut_off) + position[0]
    speed = np.gradient(x, dt) if n > 1 else np.zeros(n)
    return x, speed, np.gradient(speed, dt) if n > 1 else np.zeros(n)


def low_pass(
    values: Float[np.ndarray, "steps *series"], dt: float, angular_cut_off: float
) -> Float[np.ndarray, "steps *series"]:
    """The part of series below an angular frequency [rad/s], by the filter of `smoothed`; unchanged if too short."""
    if len(values) <= TOO_SHORT:
        return values
    return np.asarray(solveh_banded(_penalty(len(values), (angular_cut_off * dt) ** -6.0), values))


def smoothed_tracks(
    position: np.ndarray, starts: np.ndarray, stops: np.ndarray, dt: float, angular_cut_off: float
) -> np.ndarray:
    """Smooth positions [m], speeds [m/s] and accelerations [m/s^2] of all tracks, as of `smoothed`, [3, n_rows]."""
    motion = np.empty((3, len(position)))
    for start, stop in zip(starts, stops, strict=True):
        motion[:, start:stop] = smoothed(position[start:stop], dt, angular_cut_off)
    return motion


def _penalty(n: int, weight: float) -> np.ndarray:
    """Upper bands of 1 + weight D'D, in the form of `solveh_banded`; D takes third differences of n values."""
    bands = np.zeros((4, n))
    stencil = np.array([-1.0, 3.0, -3.0, 1.0])
    for shift in range(4):
        for k in range(4 - shift):
            # Row r of D touches columns r .. r + 3; entry (c, c + shift) of D'D sums over the rows that touch both.
            bands[3 - shift, shift + k : shift + k + n - 3] += weight * stencil[k] * stencil[k + shift]
    bands[3] += 1.0
    return bands
