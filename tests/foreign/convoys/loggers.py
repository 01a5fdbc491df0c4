"""The loggers: GNSS receivers on the vehicles, and the tables of what they recorded."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from .fleet import Fleet
from .simulation import STEP, Motion

EVERY = 2
"""Steps of the simulation per logged frame: receivers log at 10 Hz."""

LANE_WIDTH = 3.75
"""Width of the only lane of the convoy [m] (RAA 2008)."""

_POSITION_DRIFT, _POSITION_DRIFT_TIME = 0.25, 40.0
"""Slow error of a position that other receivers do not share [m], and its correlation time [s]: differential GNSS."""

_POSITION_NOISE = 0.02
"""Error of a position that is new in every frame [m]."""

_SPEED_NOISE, _SPEED_NOISE_TIME = 0.05, 0.3
"""Error of the Doppler speed [m/s], and its correlation time [s]."""

_ANTENNA = 0.1
"""Error of the surveyed distance from antenna to vehicle centre [m]."""


def _drifting(rng: np.random.Generator, shape: tuple[int, ...], size: float, time: float) -> np.ndarray:
    """Gaussian noise of this standard deviation, correlated over this time [s] along the first axis of frames."""
    keep = np.exp(-STEP * EVERY / time)
    white = rng.standard_normal(shape)
    start = white[:1] * keep
    return size * lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white, axis=0, zi=start)[0]


def _shifted(values: np.ndarray, offset: np.ndarray, skipped: int) -> np.ndarray:
    """Values [frames, runs, vehicles] at the stamped times: a clock that is ahead stamps what was `offset` s before."""
    steps = len(values)
    frames = np.arange(skipped, steps - skipped // 4, EVERY)
    where = frames[:, None, None] - offset / STEP
    low = np.clip(np.floor(where).astype(int), 0, steps - 2)
    share = where - low
    _, runs, vehicles = values.shape
    rows, columns = np.arange(runs)[None, :, None], np.arange(vehicles)[None, None, :]
    return values[low, rows, columns] * (1 - share) + values[low + 1, rows, columns] * share


def log(
    motion: Motion, fleet: Fleet, clock_offset: np.ndarray, skipped: int, rng: np.random.Generator
) -> list[pd.DataFrame]:
    """One table per run of what the loggers recorded after `skipped` steps, sorted by track_id and frame.

    Positions and speeds are two measurements, since receivers take speeds from Doppler shifts; neither is smoothed.
    Track numbers rise from the lead vehicle to the last. Lateral positions are from the left edge of the lane.
    """
    position, speed = (_shifted(values, clock_offset, skipped) for values in (motion.position, motion.speed))
    shape = position.shape
    position = position + rng.normal(0.0, _ANTENNA, shape[1:]) + rng.normal(0.0, _POSITION_NOISE, shape)
    position += _drifting(rng, shape, _POSITION_DRIFT, _POSITION_DRIFT_TIME)
    speed = np.maximum(speed + _drifting(rng, shape, _SPEED_NOISE, _SPEED_NOISE_TIME), 0.0)
    lateral = LANE_WIDTH / 2 + rng.normal(0.0, 0.1, shape[1:]) + _drifting(rng, shape, 0.18, 8.0)
    frames, runs, vehicles = shape
    tables = []
    for run in range(runs):

        def per_frame(values: np.ndarray, run: int = run) -> np.ndarray:
            return np.repeat(values[run], frames)

        def logged(values: np.ndarray, run: int = run) -> np.ndarray:
            return values[:, run].T.ravel()

        frame = np.tile(np.arange(frames), vehicles)
        tables.append(
            pd.DataFrame(
                {
                    "track_id": np.repeat(np.arange(1, vehicles + 1), frames),
                    "frame": frame,
                    "time": np.round(frame * STEP * EVERY, 3),
                    "direction": 1,
                    "x": logged(position),
                    "y": logged(lateral),
                    "position": logged(position),
                    "lateral": logged(lateral),
                    "lane": 1,
                    "speed": logged(speed),
                    "length": per_frame(fleet.length),
                    "width": per_frame(fleet.width),
                    "vehicle_class": per_frame(np.where(fleet.is_truck, "truck", "car")),
                }
            )
        )
    return tables
