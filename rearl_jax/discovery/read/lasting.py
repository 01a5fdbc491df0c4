"""Lasting random series, that is, series correlated in time: Ornstein-Uhlenbeck processes u with du/dt = -u / time +
white noise, and smooth series w that follow one with dw/dt = (u - w) / time.
"""

import numpy as np
from jaxtyping import Float
from scipy.signal import lfilter


def lasting(
    sd: float, time: float, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of a stationary Ornstein-Uhlenbeck process with standard deviation `sd` (whose unit they have) and
    correlation time `time` [s], at time steps `dt` [s]; white noise for a time of 0.
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
    # Square roots of the covariances of w and u at the start, and of their random changes in a time step.
    of_start, of_change = (np.linalg.cholesky(part) for part in (covariance, covariance - step @ covariance @ step.T))
    shocks = np.einsum("ij,jtn->itn", of_change, rng.standard_normal((2, *shape)))
    shocks[:, 0] = of_start @ np.linalg.solve(of_change, shocks[:, 0])
    followed = lfilter([1.0], [1.0, -step[1, 1]], shocks[1], axis=0)
    shocks[0, 1:] += step[0, 1] * followed[:-1]
    return np.asarray(lfilter([1.0], [1.0, -step[0, 0]], shocks[0], axis=0))


SMOOTH_COVARIANCE = np.array([[1.0, 1.0], [1.0, 2.0]])
"""Stationary covariance of a smooth series w of variance 1 and the process u that it follows, of variance 2 [-]."""


def smooth_step(time: float, dt: float) -> Float[np.ndarray, "2 2"]:
    """Transition matrix of (w, u) over a time step `dt` [s]: a smooth series w and the process u that it follows, both
    with the time constant `time` [s].
    """
    kept = np.exp(-dt / time)
    return np.array([[kept, kept * dt / time], [0.0, kept]])
