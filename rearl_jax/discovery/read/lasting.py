"""Random series that last: Ornstein-Uhlenbeck processes."""

import numpy as np
from jaxtyping import Float
from scipy.signal import lfilter


def lasting(
    sd: float, time: float, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of a stationary Ornstein-Uhlenbeck process of a standard deviation and a correlation time [s]; white
    noise for a time of 0.
    """
    kept = np.exp(-dt / time) if time else 0.0
    shocks = rng.standard_normal(shape) * sd
    shocks[1:] *= np.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], shocks, axis=0))
