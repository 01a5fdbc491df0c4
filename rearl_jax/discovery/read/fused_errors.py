"""Errors of positions that were fused with independently measured speeds, estimated by comparing the two.

A driver responds to true gaps, but the model to measured ones, so errors of the positions leave a residual. The
measured position of a third vehicle, whose errors are independent, helps to predict this residual. It therefore seems
to influence the driver even if it does not. So that the null distribution contains this false influence, simulated
drives are measured with such errors too.

Source: errors in variables, Fuller, Measurement Error Models (1987), chapter 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls, root_scalar

from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.read.smoothing import low_pass, robust_deviation

LAGS = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0)
"""Lags of the differences of position minus integrated speed [s]."""

LEAST_LAGS = 7
"""Smallest number of lags at which white, correlated and growing errors can be distinguished."""

TIMES = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)
"""Tested correlation times of the correlated errors of positions [s]."""

LONGEST_SPEED_TIME = 2.0
"""Longest correlation time of errors of the speed [s]; slower errors cannot be distinguished from driving."""

LEAST_WINDOWS = 30
"""Smallest number of independent differences at a lag; longer lags are not used."""


@dataclass(frozen=True)
class FusedErrors:
    """Errors of positions whose fast part is the integrated speed.

    Attributes:
        white: Standard deviation of the white errors of the position [m].
        lasting: Standard deviation of its errors that are correlated in time [m].
        time: Correlation time of these errors [s].
        walk: Standard deviation of the integrated errors of the speed, a random walk, divided by the root of the time
            walked [m/s^0.5].
        speed_time: Correlation time of the errors of the speed [s]; 0 if they are white.
        cut_off: Angular frequency below which the position is used, and above which the integrated speed [rad/s].
    """

    white: float
    lasting: float
    time: float
    walk: float
    speed_time: float
    cut_off: float

    def drawn(self, shape: tuple[int, int], dt: float, rng: np.random.Generator) -> Float[np.ndarray, "steps pieces"]:
        """Realisations of the errors [m], one for each piece."""
        of_position = lasting(self.lasting, self.time, shape, dt, rng) + self.white * rng.standard_normal(shape)
        kept = np.exp(-dt / self.speed_time) if self.speed_time else 0.0
        size = self.walk * np.sqrt((1 - kept) / (1 + kept) / dt)
        of_speed = dt * np.cumsum(lasting(size, self.speed_time, shape, dt, rng), axis=0)
        return of_speed + low_pass(of_position - of_speed, dt, self.cut_off)


def fused_errors(
    differences: Sequence[Float[np.ndarray, " steps"]],
    speeds: Sequence[Float[np.ndarray, " steps"]],
    dt: float,
    cut_off: float,
) -> FusedErrors | None:
    """Errors from each track's position minus its integrated speed; None if the tracks are too short.

    Second differences are used, because a constant error of the speed adds a constant slope. With the attributes of
    `FusedErrors`, their variance at a lag L is 6 white^2 + 2 lasting^2 (3 - 4 r + r^2) + 2 walk^2 L with
    r = exp(-L / time).

    Args:
        differences: Position minus integrated speed of each track [m].
        speeds: Measured speed of each track [m/s].
        dt: Time step [s].
        cut_off: Angular frequency at which position and integrated speed were fused [rad/s].
    """
    lags, variances, windows = [], [], []
    for lag in LAGS:
        step = max(1, round(lag / dt))
        values = _second_differences(differences, step)
        if len(values) < LEAST_WINDOWS * step:
            break
        # Robust, because positions jump where a receiver loses satellites.
        variances.append(robust_deviation(values) ** 2)
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
        fits.append((float(misfit), white, size, time, walk))
    _, white, size, time, walk = min(fits)
    speed_time = _speed_time(walk, robust_deviation(_second_differences(speeds, 1)) ** 2, dt)
    return FusedErrors(white, size, time, walk, speed_time, cut_off)


def _speed_time(walk: float, variance: float, dt: float) -> float:
    """Correlation time of the errors of the speed [s], from their growth and the variance of their second differences
    over one time step [m^2/s^2]. Drivers change the acceleration slowly, so nearly all of this variance is of errors.

    An error of variance s^2, of which a share k is kept from step to step, has second differences of variance
    2 s^2 (1 - k) (3 - k); the variance of its integral grows by s^2 dt^2 (1 + k) / (1 - k) = walk^2 dt per time step.
    """

    def excess(kept: float) -> float:
        """Variance of second differences for a share k, minus the observed one; it falls with k."""
        return 2 * walk**2 / dt * (1 - kept) ** 2 * (3 - kept) / (1 + kept) - variance

    if excess(0.0) <= 0:
        return 0.0
    most = float(np.exp(-dt / LONGEST_SPEED_TIME))
    if excess(most) >= 0:
        return LONGEST_SPEED_TIME
    return -dt / float(np.log(root_scalar(excess, bracket=(0.0, most)).root))


def _second_differences(tracks: Sequence[Float[np.ndarray, " steps"]], step: int) -> Float[np.ndarray, " differences"]:
    """Second differences at a lag of `step` time steps, of all tracks."""
    return np.concatenate(
        [np.empty(0), *(track[2 * step :] - 2 * track[step:-step] + track[: -2 * step] for track in tracks)]
    )
