"""Lasting random series, that is, series correlated in time: Ornstein-Uhlenbeck processes u, du/dt = -u / time + white
noise, and smooth series w that follow one, dw/dt = (u - w) / time.
"""

import numpy as np
from jaxtyping import Float
from scipy.signal import lfilter


def lasting(
    sd: float, time: float, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of a stationary Ornstein-Uhlenbeck process with standard deviation `sd` and correlation time `time`
    [s]; white noise for a time of 0.
    """
    kept = np.exp(-dt / time) if time else 0.0
    shocks = rng.standard_normal(shape) * sd
    shocks[1:] *= np.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], shocks, axis=0))


def smooth_lasting(
    sd: float, time: float, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of a stationary smooth series with standard deviation `sd` that follows an Ornstein-Uhlenbeck
    process, both with the time constant `time` [s].
    """
    covariance = sd**2 * SMOOTH_COVARIANCE
    step = smooth_step(time, dt)
    first, later = (np.linalg.cholesky(part) for part in (covariance, covariance - step @ covariance @ step.T))
    shocks = np.einsum("ij,jtn->itn", later, rng.standard_normal((2, *shape)))
    shocks[:, 0] = first @ np.linalg.solve(later, shocks[:, 0])
    followed = lfilter([1.0], [1.0, -step[1, 1]], shocks[1], axis=0)
    shocks[0, 1:] += step[0, 1] * followed[:-1]
    return np.asarray(lfilter([1.0], [1.0, -step[0, 0]], shocks[0], axis=0))


SMOOTH_COVARIANCE = np.array([[1.0, 1.0], [1.0, 2.0]])
"""Stationary covariance of a smooth series w of variance 1 and the process u that it follows [-]: u has variance 2."""


def smooth_step(time: float, dt: float) -> Float[np.ndarray, "2 2"]:
    """Transition matrix over a time step [s] of a smooth series and the process that it follows, for a time constant
    [s]: dw/dt = (u - w) / time, du/dt = -u / time + white noise.
    """
    kept = np.exp(-dt / time)
    return np.array([[kept, kept * dt / time], [0.0, kept]])
