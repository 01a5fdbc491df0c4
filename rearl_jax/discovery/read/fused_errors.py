"""Errors of positions that were fused with independently measured speeds, estimated by comparing the two.

Errors of two receivers are independent, and a driver responds to true gaps. So the errors in the positions of driver
and leader leave a residual, which the position of any third vehicle helps to predict: it seems to have an influence
that it has not. Drives that are simulated without missing effects are therefore measured with such errors.

Source: errors in variables, Fuller, Measurement Error Models (1987), chapter 1.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.read.smoothing import low_pass

LAGS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0)
"""Lags at which differences of the two columns are compared [s]."""

LEAST_LAGS = 7
"""Smallest number of lags from which the parts of the errors are told apart."""

TIMES = (5.0, 10.0, 20.0, 40.0, 80.0)
"""Tested correlation times of lasting errors [s]."""

LEAST_WINDOWS = 30
"""Smallest number of independent differences at a lag; longer lags are not used."""


@dataclass(frozen=True)
class FusedErrors:
    """Errors of positions whose fast part is the integrated speed.

    Attributes:
        white: Standard deviation of the white errors of the position [m].
        lasting: Standard deviation of its errors that last [m].
        time: Correlation time of the lasting errors [s].
        walk: Standard deviation of the integrated errors of the speed after one second [m/s^0.5].
        cut_off: Angular frequency below which the position is used, and above which the integrated speed [rad/s].
    """

    white: float
    lasting: float
    time: float
    walk: float
    cut_off: float

    def drawn(self, shape: tuple[int, int], dt: float, rng: np.random.Generator) -> Float[np.ndarray, "steps pieces"]:
        """Realisations [m], one for each piece."""
        of_position = lasting(self.lasting, self.time, shape, dt, rng) + self.white * rng.standard_normal(shape)
        of_speed = self.walk * np.sqrt(dt) * np.cumsum(rng.standard_normal(shape), axis=0)
        return of_speed + low_pass(of_position - of_speed, dt, self.cut_off)


def fused_errors(differences: Iterable[Float[np.ndarray, " steps"]], dt: float, cut_off: float) -> FusedErrors | None:
    """Errors from each track's position minus its integrated speed [m]; None if the tracks are too short.

    Second differences are used, because a constant error of the speed adds a constant slope. Their variance at a lag L
    is 6 white^2 + 2 lasting^2 (3 - 4 r + r^2) + 2 walk^2 L, with r = exp(-L / time).

    Args:
        differences: Position minus integrated speed of each track.
        dt: Time step [s].
        cut_off: Angular frequency at which the two were fused [rad/s].
    """
    tracks, lags, variances, windows = list(differences), [], [], []
    for lag in LAGS:
        step = max(1, round(lag / dt))
        second = [track[2 * step :] - 2 * track[step:-step] + track[: -2 * step] for track in tracks]
        values = np.concatenate([np.empty(0), *second])
        if len(values) < LEAST_WINDOWS * step:
            break
        # From the median, because positions jump where a receiver loses satellites.
        variances.append((float(np.median(np.abs(values))) / 0.6745) ** 2)
        lags.append(step * dt)
        windows.append(len(values) / step)
    if len(lags) < LEAST_LAGS or min(variances) <= 0:
        return None
    # Weights for the relative errors of variances, from the number of independent windows.
    lag, weight = np.array(lags), np.sqrt(windows)
    scale = weight / np.array(variances)
    fits = []
    for time in TIMES:
        kept = np.exp(-lag / time)
        parts = np.stack([np.full_like(lag, 6.0), 2 * (3 - 4 * kept + kept**2), 2 * lag], axis=1)
        squares, misfit = nnls(parts * scale[:, None], weight)
        white, size, walk = np.sqrt(squares).tolist()
        fits.append((float(misfit), FusedErrors(white, size, time, walk, cut_off)))
    return min(fits, key=lambda fit: fit[0])[1]
