"""The measurement chain of a data set whose measurement is drawn: noise, smoothing, speed column, lane column."""

import numpy as np
from scipy.ndimage import convolve1d
from scipy.signal import lfilter, savgol_filter

from rearl_jax.blind.traffic.measurement import Frames, across, frame_times
from rearl_jax.blind.traffic.scenario import Chain, Scenario
from rearl_jax.blind.traffic.simulation import Events


def release(scenario: Scenario, chain: Chain, events: Events) -> Frames:
    """The columns as the data provider releases them, measured and processed by the drawn `chain`; a data set without
    broad priors is measured by `measurement.measure`.
    """
    rng = np.random.default_rng([scenario.seed, 6])
    rate = scenario.frame_rate
    time, recorded = frame_times(scenario)
    steps = np.searchsorted(events.time, time - 1e-6)
    shape = events.position[steps].shape
    position = events.position[steps] + scenario.position_noise * correlated(shape, scenario.noise_time, rate, rng)
    position = smoothed(position, chain.kernel, chain.kernel_time * rate)
    if chain.speed == "sensor":
        speed = events.speed[steps] + chain.sensor_noise * rng.standard_normal(shape)
        speed = smoothed(speed, chain.kernel, chain.kernel_time * rate)
    else:
        window = max(3, 2 * round(0.5 * chain.slope_time * rate) + 1)
        speed = np.asarray(savgol_filter(position, window, 2, deriv=1, delta=1.0 / rate, axis=0))
    speed = np.maximum(0.0, speed)
    # A path of minimum jerk is at the marking after half of its time.
    delay = 0.5 * chain.change_time if chain.lane == "marking" else 0.0
    lane, lateral = across(events, time[recorded], chain.change_time, delay, rng)
    return Frames(
        position[recorded],
        lateral,
        lane,
        speed[recorded],
        np.clip(np.gradient(speed, 1.0 / rate, axis=0)[recorded], -30.0, 30.0),
        np.ones_like(lane, dtype=bool),
    )


def correlated(shape: tuple[int, ...], time: float, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Stationary first-order autoregressive noise of unit variance; white for a correlation time [s] of 0."""
    drawn = rng.standard_normal(shape)
    if time == 0.0:
        return drawn
    decay = np.exp(-1.0 / (rate * time))
    drawn[1:] *= np.sqrt(1.0 - decay**2)
    return np.asarray(lfilter([1.0], [1.0, -decay], drawn, axis=0))


def smoothed(values: np.ndarray, kernel: str, deviation: float) -> np.ndarray:
    """Values along the first axis after a kernel with a standard deviation in frames; unchanged for "none"."""
    return values if kernel == "none" else convolve1d(values, weights(kernel, deviation), axis=0, mode="nearest")


def weights(kernel: str, deviation: float) -> np.ndarray:
    """Weights of a kernel, of sum 1, symmetric in time; the standard deviation is in frames."""
    reach = np.ceil(5.0 * deviation) + 1.0
    frame = np.arange(-reach, reach + 1.0)
    if kernel == "gaussian":
        values = np.exp(-0.5 * (frame / deviation) ** 2)
    elif kernel == "exponential":
        values = np.exp(-np.sqrt(2.0) * np.abs(frame) / deviation)
    elif kernel == "triangular":
        values = np.maximum(0.0, 1.0 - np.abs(frame) / (np.sqrt(6.0) * deviation))
    else:
        # A moving average; a frame at its edge counts with the part of it that is inside.
        values = np.clip(np.sqrt(3.0) * deviation + 0.5 - np.abs(frame), 0.0, 1.0)
    return values / values.sum()
