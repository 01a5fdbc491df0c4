"""Division of the acceleration residual into acceleration noise and a time gap that varies in time.

Most of the error of long predictions arises because models keep a constant time gap, while people keep a longer one for
some time and then a shorter one. The times of these changes cannot be predicted, but a simulation can reproduce their
size and duration. The division minimises the energy score of noisy simulations, which is lowest for the correct spread.
Simulated is the second half of each drive, with the driver's own parameters of the first half: parameters of the whole
drive follow its slow changes, so that a varying time gap would seem to be constant.

Source: estimation by the energy score, Gneiting & Raftery, J. Am. Stat. Assoc. 102 (2007) 359, section 9.1.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.closed_loop import FARTHEST
from rearl_jax.discovery.observe.fit import Fit, known_drivers
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import halves, has_enough_data
from rearl_jax.discovery.search.null import behind_noisy_drive, lasting
from rearl_jax.metrics.energy import energy_score

REALISATIONS = 12
"""Simulations of each driver per energy score."""

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Tested shares of the acceleration noise [-]."""

SIZES, TIMES = (0.0, 0.15, 0.3, 0.45, 0.65), (5.0, 15.0, 45.0)
"""Tested standard deviations of log T [-] and correlation times [s]."""

SMALLEST = 1e-3
"""Smallest energy score that is distinguished [m]."""


@dataclass(frozen=True)
class TimeGapVariation:
    """Ornstein-Uhlenbeck process of the logarithm of a driver's time gap about its mean.

    Attributes:
        sd: Standard deviation [-]; 0 for a constant time gap.
        time: Correlation time [s].
        noise_share: Share of the acceleration noise that remains in addition [-].
    """

    sd: float = 0.0
    time: float = 15.0
    noise_share: float = 1.0


CONSTANT = TimeGapVariation()


def energy_scores(
    solver: Solver, state: FitState, fit: Fit, seed: int, variation: TimeGapVariation = CONSTANT
) -> Float[np.ndarray, " drivers"]:
    """Energy score of noisy simulations of each driver [m]; distances are root mean squares over a drive.

    Args:
        solver: Solver of the model.
        state: State of the drivers under the model.
        fit: The model and its noise.
        seed: Seed of the noise, the same for all models.
        variation: Variation of the time gap, and the remaining share of the noise.
    """
    data, rng, variations = state.data, np.random.default_rng(seed), np.random.default_rng([seed, 2])
    noise = replace(fit.noise, acceleration=variation.noise_share * fit.noise.acceleration)
    drawn = []
    for _ in range(REALISATIONS):
        varied = lasting(variation.sd, variation.time, data.y.shape, data.dt, variations) if variation.sd else None
        drives = replace(state, pieces=replace(state.pieces, varied=varied))
        drawn.append(np.clip(behind_noisy_drive(solver, drives, noise, rng), -FARTHEST, FARTHEST))
    measured = np.zeros_like(drawn[0])  # deviations from the measurement are drawn
    return energy_score(drawn, measured, lambda one, other: np.sqrt(data.driver_mean((one - other) ** 2)))


def later_halves(solver: Solver, data: Measured, fit: Fit) -> FitState | None:
    """Second halves of drives, with the drivers' own parameters of the first ones; None if no drive is long enough."""
    is_long = has_enough_data([halves(data)])
    return known_drivers(solver, halves(data.of_drivers(is_long)), fit) if is_long.any() else None


def time_gap_variation(solver: Solver, fit: Fit, seed: int) -> TimeGapVariation:
    """The variation with the lowest geometric mean energy score of the fitted drivers (few poorly modelled drivers do
    not dominate this mean); no variation if the improvement is below two standard errors.
    """
    state = later_halves(solver, fit.state.data, fit)
    if state is None:
        return CONSTANT
    scores: dict[TimeGapVariation, Float[np.ndarray, " drivers"]] = {}

    def best_of(tried: Iterable[TimeGapVariation]) -> TimeGapVariation:
        for candidate in tried:
            if candidate not in scores:
                scores[candidate] = np.log(np.maximum(energy_scores(solver, state, fit, seed, candidate), SMALLEST))
        return min(scores, key=lambda candidate: float(scores[candidate].mean()))

    best = best_of([CONSTANT, *(TimeGapVariation(sd, noise_share=share) for sd in SIZES for share in SHARES[::2])])
    best = best_of(replace(best, time=time) for time in TIMES)
    best = best_of(replace(best, noise_share=share) for share in SHARES)
    best = best_of(replace(best, sd=sd) for sd in SIZES)
    gained = scores[CONSTANT] - scores[best]
    is_sure = len(gained) > 1 and gained.mean() > 2 * gained.std(ddof=1) / np.sqrt(len(gained))
    return best if is_sure else CONSTANT
