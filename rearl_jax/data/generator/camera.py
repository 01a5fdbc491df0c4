"""Observed tracks of generated vehicles: frames at 25 Hz, detection noise, a smoothing tracker, a limited view."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator.fleet import Drivers
from rearl_jax.data.generator.traffic import FRAME, Samples

LATERAL_NOISE_SHARE = 0.5  # lateral detection noise relative to the longitudinal one; assumed to be smaller
MIN_TRACK_FRAMES = 4  # frames the tracker needs for third differences


@dataclass(frozen=True)
class Tracks:
    """Output of the tracker, one row per vehicle and frame, sorted by vehicle and frame; as the driver sees the road.

    Attributes:
        vehicle: Number of the vehicle.
        frame: Frame, 1 = first of the recording.
        position: Vehicle centre from the upstream edge of the view [m].
        lateral: Vehicle centre from the left edge of the carriageway [m].
        speed, lateral_speed: First derivatives [m/s].
        acceleration, lateral_acceleration: Second derivatives [m/s^2].
    """

    vehicle: np.ndarray
    frame: np.ndarray
    position: np.ndarray
    lateral: np.ndarray
    speed: np.ndarray
    lateral_speed: np.ndarray
    acceleration: np.ndarray
    lateral_acceleration: np.ndarray


def observe(
    samples: Samples, drivers: Drivers, n_frames: int, config: GeneratorConfig, rng: np.random.Generator
) -> Tracks:
    """Tracks of all vehicles while their whole bounding box is in view."""
    vehicle, frame, position, lateral = interpolate(samples, config.frames_per_step)
    n_rows = len(vehicle)
    noise = config.position_noise * rng.standard_normal((2, n_rows))
    begin = np.flatnonzero(np.diff(vehicle, prepend=-1))
    measured = np.stack([position + noise[0], lateral + LATERAL_NOISE_SHARE * noise[1]], axis=1)
    smooth = smoothed(measured, begin, config.smoothing_cutoff)
    velocity, acceleration = derivatives(smooth, begin)
    half_length = 0.5 * drivers.length[vehicle]
    in_view = (frame >= 1) & (frame <= n_frames)
    in_view &= (smooth[:, 0] - half_length >= 0.0) & (smooth[:, 0] + half_length <= config.camera_length)
    rows = _without_holes(in_view, begin)
    return Tracks(vehicle[rows], frame[rows], *smooth[rows].T, *velocity[rows].T, *acceleration[rows].T)


def interpolate(samples: Samples, frames_per_step: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vehicle, frame, position [m] and lateral position [m] at every frame between the samples.

    Positions follow the cubic through both samples with their speeds (exact for constant acceleration),
    lateral positions the straight line.
    """
    n_rows = np.diff(np.flatnonzero(np.diff(samples.vehicle, prepend=-1, append=-1)))
    enough = np.repeat((n_rows - 1) * frames_per_step >= MIN_TRACK_FRAMES, n_rows)
    pair = np.flatnonzero((samples.vehicle[1:] == samples.vehicle[:-1]) & enough[:-1])
    if np.any(samples.step[pair + 1] - samples.step[pair] != 1):
        raise RuntimeError("a generated vehicle left the view and came back; positions must not decrease")
    p = np.arange(frames_per_step) / frames_per_step  # share of the step that has passed
    duration = FRAME * frames_per_step
    x0, x1 = samples.position[pair, None], samples.position[pair + 1, None]
    m0, m1 = duration * samples.speed[pair, None], duration * samples.speed[pair + 1, None]
    position = (
        (2 * p**3 - 3 * p**2 + 1) * x0 + (p**3 - 2 * p**2 + p) * m0 + (3 * p**2 - 2 * p**3) * x1 + (p**3 - p**2) * m1
    )
    lateral = (1 - p) * samples.lateral[pair, None] + p * samples.lateral[pair + 1, None]
    frame = frames_per_step * samples.step[pair, None] + np.arange(frames_per_step) + 1
    vehicle = np.repeat(samples.vehicle[pair], frames_per_step)
    return vehicle, frame.ravel(), position.ravel(), lateral.ravel()


def smoothed(measured: np.ndarray, begin: np.ndarray, cutoff: float) -> np.ndarray:
    """Rows x that minimise |x - y|^2 + lambda |D3 x|^2 within each track: y is `measured`, D3 the third difference.

    This is the fixed-interval (Rauch-Tung-Striebel) smoother of a constant-acceleration model with white
    jerk, the tracker of highD, in one banded system. The gain at frequency f is 1 / (1 + lambda (2 sin(pi f
    dt))^6), dt being the time between two frames; lambda is such that the gain is one half at the cut-off.

    Args:
        measured: Positions, rows sorted by track and frame; one column per coordinate.
        begin: First row of every track; each track has at least four rows.
        cutoff: Frequency of half gain [Hz].

    Source: Whittaker (1923); Eilers (2003); Krajewski et al. (2018) for the tracker.
    """
    n_rows = len(measured)
    stiffness = (2.0 * np.sin(np.pi * cutoff * FRAME)) ** -6
    weight = np.full(n_rows, stiffness)  # of the third difference that starts in a row
    starts = np.concatenate([begin[1:], [n_rows]])
    for back in (1, 2, 3):  # none may reach into the next track
        weight[starts - back] = 0.0
    difference = (-1.0, 3.0, -3.0, 1.0)
    bands = np.zeros((4, n_rows))
    bands[0] = 1.0
    for i in range(4):
        for j in range(i, 4):
            # Row r of D3 adds difference[i] * difference[j] to the entry (r + i, r + j), stored in band j - i.
            bands[j - i, i:] += difference[i] * difference[j] * weight[: n_rows - i]
    return solveh_banded(bands, measured, overwrite_ab=True, lower=True, check_finite=False)


def derivatives(values: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative by central differences within each track, which begins in a row `begin`; one-sided at
    its ends.
    """
    n_rows = len(values)
    end = np.concatenate([begin[1:], [n_rows]]) - 1
    first, second = np.empty_like(values), np.empty_like(values)
    first[1:-1] = (values[2:] - values[:-2]) / (2.0 * FRAME)
    second[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / FRAME**2
    first[begin] = (values[begin + 1] - values[begin]) / FRAME
    first[end] = (values[end] - values[end - 1]) / FRAME
    second[begin], second[end] = second[begin + 1], second[end - 1]
    return first, second


def _without_holes(in_view: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """Rows of every track from its first to its last row in view, so that noise at the view's edge leaves no gap."""
    row = np.arange(len(in_view))
    first = np.minimum.reduceat(np.where(in_view, row, len(in_view)), begin)
    last = np.maximum.reduceat(np.where(in_view, row, -1), begin)
    track = np.cumsum(np.isin(row, begin)) - 1
    return np.flatnonzero((row >= first[track]) & (row <= last[track]))
