"""Division of the acceleration residual into acceleration noise and a driver's time gap T that varies in time.

Most of the error of long predictions arises because models keep a constant time gap, while people keep a longer one for
some time and then a shorter one. The times of these changes cannot be predicted, but a simulation can reproduce their
size and duration. The division minimises the energy score of noisy simulations, which is lowest for the correct spread.
The second half of each drive is simulated, with the driver's parameters from the first half: parameters of the whole
drive follow slow changes of the time gap, which would then seem to be constant. The time gap at the start of
a simulated drive determines where the variation begins.

Source: estimation by the energy score, Gneiting & Raftery, J. Am. Stat. Assoc. 102 (2007) 359, section 9.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.noise import time_gap_departure
from rearl_jax.discovery.observe.closed_loop import FARTHEST
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit, known_drivers
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import halves, has_enough_data
from rearl_jax.discovery.search.simulated_drives import behind_noisy_drive
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.metrics.energy import energy_score

REALISATIONS = 12
"""Simulations of each driver per energy score."""

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Tested shares of the acceleration noise [-]."""

SIZES, TIMES = (0.0, 0.15, 0.3, 0.45, 0.65), (5.0, 15.0, 45.0)
"""Tested standard deviations of log T [-] and correlation times [s]."""

START_SHARES = (0.0, 0.4, 0.7, 0.9)
"""Tested values of `TimeGapVariation.start_share` [-]."""

SMALLEST_SCORE = 1e-3
"""Lower bound of energy scores [m], so that their logarithms are finite."""


@dataclass(frozen=True)
class TimeGapVariation:
    """Ornstein-Uhlenbeck process of the logarithm of a driver's time gap about its mean.

    Attributes:
        sd: Standard deviation [-]; 0 for a constant time gap.
        time: Correlation time [s].
        noise_share: Share of the acceleration noise that remains in addition [-].
        start_share: Share [-] of the difference between log T at the start of a drive and the driver's mean log T that
            is variation; the rest is chance, because the driver is not in equilibrium at that moment.
    """

    sd: float = 0.0
    time: float = 15.0
    noise_share: float = 1.0
    start_share: float = 0.0

    def expected(self, state: FitState, prior: Prior) -> Float[np.ndarray, "steps pieces"] | None:
        """Expected logarithm of the ratio of the time gap to the driver's mean one [-], given the time gap at the start
        of each piece; None for a constant time gap, or if the start contains no information about later time gaps.
        """
        if not self.sd * self.start_share:
            return None
        return self.start_share * departures(state, prior) * self._remaining(state.data)

    def expected_of_unknown(self, state: FitState, prior: Prior) -> Float[np.ndarray, "steps pieces"] | None:
        """Expected logarithm as in `expected`, for drivers of whom only the population is known: the time gap at the
        start is then also evidence of their mean time gap.

        Source: means of normal variables given their sum, here mean time gap, variation and departure from equilibrium.
        """
        if not self.sd * self.start_share:
            return None
        index = prior.names.index("time_gap")
        between = (prior.spread[index] * state.spread[index]) ** 2  # variance between drivers
        within = self.sd**2  # variance in time
        share = (between + within * self._remaining(state.data)) / (between + within / self.start_share)
        return share * departures(state, prior)

    def drawn(
        self, state: FitState, prior: Prior, rng: np.random.Generator
    ) -> Float[np.ndarray, "steps pieces"] | None:
        """A realisation of the logarithm of `expected` [-]; None for a constant time gap."""
        if not self.sd:
            return None
        path = lasting(self.sd, self.time, state.data.y.shape, state.data.dt, rng)
        begin = self.start_share * departures(state, prior) + np.sqrt(1 - self.start_share) * path[0]
        return path + (begin - path[0]) * self._remaining(state.data)

    def _remaining(self, data: Measured) -> Float[np.ndarray, "steps 1"]:
        """Share of the variation at the start that remains after each time step [-]."""
        return np.exp(-np.arange(len(data.y))[:, None] * data.dt / self.time)


CONSTANT_TIME_GAP = TimeGapVariation()
"""Constant time gap of each driver, with all of the acceleration noise."""


def departures(state: FitState, prior: Prior) -> Float[np.ndarray, " pieces"]:
    """Logarithm of the ratio of the time gap at the start of each piece to the driver's mean one [-]."""
    data, values = state.data, prior.values(state.z, state.truck)[state.data.driver]
    time_gap, jam_gap = (values[:, prior.names.index(name)] for name in ("time_gap", "jam_gap"))
    front, speed = state.pieces.start[0] + data.length / 2, state.pieces.start[1]
    departure = time_gap_departure(data.surroundings.leader_rear[0] - front, speed, time_gap, jam_gap)
    return np.asarray(data.surroundings.has_leader[0] * departure)


def energy_scores(
    solver: Solver, state: FitState, fit: Fit, seed: int, variation: TimeGapVariation = CONSTANT_TIME_GAP
) -> Float[np.ndarray, " drivers"]:
    """Energy score of noisy simulations of each driver [m]; distances are root mean squares over a drive. The seed of
    the noise must be the same for all models that are compared; `variation` also states the remaining share of the
    acceleration noise.
    """
    data, rng, variations = state.data, np.random.default_rng(seed), np.random.default_rng([seed, 2])
    noise = replace(fit.noise, acceleration=variation.noise_share * fit.noise.acceleration)
    drawn = []
    for _ in range(REALISATIONS):
        varied = variation.drawn(state, solver.layout.prior, variations)
        drives = replace(state, pieces=replace(state.pieces, varied=varied))
        drawn.append(np.clip(behind_noisy_drive(solver, drives, noise, rng), -FARTHEST, FARTHEST))
    measured = np.zeros_like(drawn[0])  # deviations from the measurement are drawn
    return energy_score(drawn, measured, lambda one, other: np.sqrt(data.driver_mean((one - other) ** 2)))


def later_halves(solver: Solver, data: Measured, fit: Fit) -> FitState | None:
    """Second halves of drives, with drivers' parameters from the first halves; None if no drive is long enough."""
    is_long = has_enough_data([halves(data)])
    return known_drivers(solver, halves(data.of_drivers(is_long)), fit) if is_long.any() else None


class VariationSearch:
    """Search for the variation of time gaps with the lowest geometric mean energy score of the fitted drivers, a mean
    that few poorly modelled drivers do not dominate.

    Scores are kept between calls, because each needs many simulations.
    """

    def __init__(self, solver: Solver, fit: Fit, seed: int) -> None:
        self._solver, self._fit, self._seed = solver, fit, seed
        self._state = later_halves(solver, fit.state.data, fit)
        self._scores: dict[TimeGapVariation, Float[np.ndarray, " drivers"]] = {}

    def best(self, start_shares: Sequence[float] = START_SHARES) -> TimeGapVariation:
        """The best variation; none if the improvement is not significant (`variation_z_score`). One parameter is
        searched after the other; `start_shares` are the tested values of `TimeGapVariation.start_share`.
        """
        if self._state is None:
            return CONSTANT_TIME_GAP
        grid = [TimeGapVariation(sd, noise_share=share) for sd in SIZES for share in SHARES[::2]]
        best = self._best_of([CONSTANT_TIME_GAP, *grid])
        best = self._best_of([best, *(replace(best, time=time) for time in TIMES)])
        best = self._best_of([best, *(replace(best, noise_share=share) for share in SHARES)])
        best = self._best_of([best, *(replace(best, sd=sd) for sd in SIZES)])
        if best.sd:
            starts = [replace(best, start_share=share, time=time) for share in start_shares for time in TIMES]
            best = self._best_of([best, *starts])
            best = self._best_of([best, *(replace(best, sd=sd) for sd in SIZES[1:])])
        gained = self._score(CONSTANT_TIME_GAP) - self._score(best)
        least = THRESHOLDS.variation_z_score
        is_significant = len(gained) > 1 and gained.mean() > least * gained.std(ddof=1) / np.sqrt(len(gained))
        return best if is_significant else CONSTANT_TIME_GAP

    def _best_of(self, tried: Sequence[TimeGapVariation]) -> TimeGapVariation:
        return min(tried, key=lambda variation: float(self._score(variation).mean()))

    def _score(self, variation: TimeGapVariation) -> Float[np.ndarray, " drivers"]:
        """Logarithm of the energy score of each driver's second half [log m]."""
        assert self._state is not None
        if variation not in self._scores:
            score = energy_scores(self._solver, self._state, self._fit, self._seed, variation)
            self._scores[variation] = np.log(np.maximum(score, SMALLEST_SCORE))
        return self._scores[variation]
