"""Platoon leaders: they have no vehicle ahead and drive a prescribed, varying speed profile."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rearl_jax.blind.traffic.scenario import SUB_STEP

# Phases of a drive: how often, between which speeds [m/s], for how long [s].
PHASES = (
    (0.30, (20.0, 29.0), (6.0, 12.0)),  # cruising
    (0.30, (27.0, 33.5), (6.0, 13.0)),  # free
    (0.22, (10.0, 17.0), (5.0, 9.0)),  # a slow-down
    (0.18, (2.5, 7.0), (2.0, 5.0)),  # a stop-and-go wave
)
ACCELERATION, DECELERATION = (0.6, 1.6), (0.8, 2.4)  # [m/s^2]
JERK_TIME = 0.6  # s, over which accelerations set in
FASTEST = 34.0  # m/s


def draw_profiles(n: int, seconds: float, pace: float, rng: np.random.Generator) -> np.ndarray:
    """Speeds of n vehicles at every sub-step, [n, n_steps] [m/s]."""
    n_steps = round(seconds / SUB_STEP) + 1
    profiles = np.stack([_draw_profile(n_steps, pace, rng) for _ in range(n)])
    return gaussian_filter1d(profiles, JERK_TIME / SUB_STEP, axis=1, mode="nearest")


def _draw_profile(n_steps: int, pace: float, rng: np.random.Generator) -> np.ndarray:
    shares = np.array([share for share, _, _ in PHASES])
    speed = float(pace * rng.uniform(19.0, 28.0))
    pieces, length, phase = [np.array([speed])], 1, -1  # no phase yet
    while length < n_steps:
        # Never the same phase twice in a row, because constant driving carries no information.
        weights = np.where(np.arange(len(PHASES)) == phase, 0.0, shares)
        phase = int(rng.choice(len(PHASES), p=weights / weights.sum()))
        _, speeds, durations = PHASES[phase]
        target = min(pace * float(rng.uniform(*speeds)), FASTEST)
        rate = float(rng.uniform(*(ACCELERATION if target > speed else DECELERATION)))
        ramp = np.linspace(speed, target, max(2, round(abs(target - speed) / rate / SUB_STEP)))
        pieces += [ramp, np.full(round(float(rng.uniform(*durations)) / SUB_STEP), target)]
        length += pieces[-2].size + pieces[-1].size
        speed = target
    return np.concatenate(pieces)[:n_steps]
