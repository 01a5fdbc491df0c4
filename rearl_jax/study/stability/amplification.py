"""Amplification along platoons of equal vehicles: simulated behind a first vehicle whose speed oscillates, and by the
linear analysis.
"""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.config.stability import StabilityConfig
from rearl_jax.export.platoon import STEPS_PER_SECOND, simulate, start_platoons
from rearl_jax.study.stability.analysis import amplification
from rearl_jax.study.stability.cases import MAX_SPEED_SHARE, Case

N_FOLLOWERS = 3
"""Followers of each first vehicle. The amplitudes of the third and the second are compared, because both are simulated;
the first vehicle's motion is prescribed.
"""

TRANSIENT = 300.0
"""Time until the followers oscillate steadily [s]."""

EVALUATED_PERIODS, MIN_EVALUATED_TIME = 4, 60.0
"""Periods of the slowest oscillation that are evaluated after the transient [-], and the least evaluated time [s]."""

AMPLIFICATION_COLUMNS = ("speed", "frequency", "analysis", "simulated", "difference")


def amplification_table(case: Case, options: StabilityConfig) -> pd.DataFrame:
    """One row per speed [m/s] and frequency [Hz]: amplitude of a follower's speed over its leader's [-] by the analysis
    and in the simulation, and the difference.
    """
    speeds = [speed for speed in options.speeds if speed < MAX_SPEED_SHARE * case.desired_speed]
    if not speeds:
        return pd.DataFrame(columns=list(AMPLIFICATION_COLUMNS))
    speed, frequency = (axis.ravel() for axis in np.meshgrid(speeds, options.frequencies, indexing="ij"))
    duration = max(EVALUATED_PERIODS / frequency.min(), MIN_EVALUATED_TIME)
    time = np.arange(round((TRANSIENT + duration) * STEPS_PER_SECOND) + 1)[:, None] / STEPS_PER_SECOND
    first = speed + options.amplitude * np.sin(2 * np.pi * frequency * time)
    motion = simulate(start_platoons(case.typical, first, N_FOLLOWERS, options.seed), first)
    is_steady = time[:, 0] >= TRANSIENT
    amplitude = [amplitudes(motion.speed[is_steady, vehicle], frequency, time[is_steady]) for vehicle in (-2, -1)]
    expected = [amplification(case.slopes(v), case.scheme, f) for v, f in zip(speed, frequency, strict=True)]
    simulated = amplitude[1] / amplitude[0]
    columns = (speed, frequency, expected, simulated, simulated - expected)
    return pd.DataFrame(dict(zip(AMPLIFICATION_COLUMNS, columns, strict=True)))


def amplitudes(
    speed: Float[np.ndarray, "steps platoons"],
    frequency: Float[np.ndarray, " platoons"],
    time: Float[np.ndarray, "steps one"],
) -> Float[np.ndarray, " platoons"]:
    """Amplitude of each platoon's oscillation at its frequency [m/s], by least squares with a mean and a trend."""
    result = []
    for series, series_frequency in zip(speed.T, frequency, strict=True):
        angle = 2 * np.pi * series_frequency * time[:, 0]
        basis = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle), angle], axis=1)
        sine, cosine, *_ = np.linalg.lstsq(basis, series, rcond=None)[0]
        result.append(np.hypot(sine, cosine))
    return np.array(result)
