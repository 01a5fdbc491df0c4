"""Slow variation of the time gap within drivers, estimated from the autocovariance of the acceleration residual.

People keep a longer time gap for some time and then a shorter one, so the residual of a model with constant parameters
is correlated over tens of seconds. A candidate whose influence changes as slowly, such as a dependence on speed, then
agrees with the residual by chance far more often than behind drivers with acceleration noise alone. The null
distribution is simulated with this variation, so that such agreement is not taken for evidence.

The autocovariance of the measured residual, less that of drives simulated with a constant time gap, is compared with
the increase that a known variation causes in simulations; it is proportional to the variance of the variation.

Source: indirect inference, Gourieroux, Monfort & Renault, J. Appl. Econometrics 8 (1993) S85.
"""

from functools import partial

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.residuals import autocovariances, smoothed_acceleration
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP, TimeGapVariation
from rearl_jax.discovery.search.simulated_drives import noise_alone

LAGS = (2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0)
"""Lags of the autocovariances [s], from the correlation time of acceleration noise to that of the slowest variation."""

TIMES = (10.0, 20.0, 40.0)
"""Tested correlation times [s]."""

TESTED_SD, MOST_SD = 0.2, 0.6
"""Standard deviation of log T with which drives are simulated, and the largest that is returned [-]."""

REPLICATES = 2
"""Simulated data sets for each variation."""


def slow_variation(solver: Solver, state: FitState, noise: Noise, seed: int) -> TimeGapVariation:
    """Variation of the time gap with which simulated drives of the calibrated model have the measured autocovariance of
    the acceleration residual, beside the fitted acceleration noise; a constant time gap if no variation makes them more
    similar.
    """
    prior = solver.layout.prior
    measured = _autocovariances(solver, state, noise)

    def simulated(variation: TimeGapVariation) -> Float[np.ndarray, " lags"]:
        # The seed is the same for every variation, so that noise hardly contributes to their difference.
        drives = noise_alone(solver, state, noise, REPLICATES, seed, partial(variation.drawn, state, prior))
        return np.mean([_autocovariances(solver, drive, noise) for batch in drives for drive in batch], axis=0)

    constant = simulated(CONSTANT_TIME_GAP)
    excess = measured - constant
    best, least = CONSTANT_TIME_GAP, float((excess**2).sum())
    for time in TIMES:
        increase = simulated(TimeGapVariation(TESTED_SD, time)) - constant
        factor = max(float((increase * excess).sum() / max((increase**2).sum(), 1e-30)), 0.0)
        misfit = float(((excess - factor * increase) ** 2).sum())
        if misfit < least:
            best, least = TimeGapVariation(min(TESTED_SD * factor**0.5, MOST_SD), time), misfit
    return best


def _autocovariances(solver: Solver, state: FitState, noise: Noise) -> Float[np.ndarray, " lags"]:
    """Autocovariances of the acceleration residual [m^2/s^4]; 0 at lags longer than the drives."""
    data = state.data
    (innovation,) = solver.innovations([state])
    residual = smoothed_acceleration(innovation, data.weight, noise, data.dt, data.stride)
    return autocovariances(
        residual, data.weight, [data.stride * max(1, round(lag / data.dt / data.stride)) for lag in LAGS]
    )
