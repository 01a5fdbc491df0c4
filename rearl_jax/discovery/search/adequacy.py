"""Adequacy of the final model of a search: tests whether its residuals are noise.

Residuals are the innovations (one-step prediction errors of the position) and the acceleration residual (acceleration
that the model does not explain).

Source: Meissner & Glasner, arXiv:2406.06707, for the joint view of states and terms; excess kurtosis as a test of
normality, Jarque & Bera, Int. Stat. Rev. 55 (1987) 163; variance that depends on the situation, Breusch & Pagan,
Econometrica 47 (1979) 1287.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.forcing import acceleration_derivatives, wanted_acceleration
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import far_from_changes, relative_variance
from rearl_jax.discovery.observe.residuals import Residuals, residuals_of
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.simulated_drives import noise_alone
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_ENERGY = 9.0
"""Bound of a squared acceleration residual divided by the driver's mean one [-], so that no single time step decides.
"""

CHANGE_TIME = 0.3
"""Time over which the change of the model's acceleration is computed [s]."""

PLAUSIBLE_ACCELERATIONS = (-5.0, 3.0)
"""Range of plausible model accelerations [m/s^2]; beyond it, a leader is measured too close."""

CONSTANT_NOISE_TIME = 20.0
"""Time within which a driver's noise level is assumed constant [s]. On measured drives an excess kurtosis of 0.18 falls
to 0.17 with one noise level per driver, and to -0.03 with one per 20 s. Division by the root mean square of n values
gives normal innovations an excess kurtosis of -6 / (n + 2): -0.03 at 10 Hz, -0.3 with one measurement per second.
"""

REPLICATES = 8
"""Simulated replicates of the drives with noise alone; the mean over them is known to 0.35 standard deviations."""

ResidualsByPart = Sequence[Residuals]
"""Residuals of the final model, of the fitted and of the check drivers."""


@dataclass(frozen=True)
class Adequacy:
    """Measures of the errors that the final model does not explain.

    Attributes:
        kurtosis: Excess kurtosis of the innovations [-].
        kurtosis_deviation: Standard deviation of the kurtosis of normal innovations [-].
        kurtosis_before: Excess kurtosis without added effects [-].
        autocorrelation: Autocorrelation of innovations from one independent measurement to the next [-].
        autocorrelation_by_noise: The same of drives simulated with the final model and noise alone [-]; not zero if
            positions were smoothed.
        unequal_noise: Dependence of the innovations' variance on the situation, in standard deviations [-].
        misjudgement: Growth of the noise with the response to a misjudged gap, in standard deviations [-]; large if
            drivers misjudge gaps.
        staleness: Growth of the noise with the error of a delayed decision, in standard deviations [-]; large if
            drivers decide at intervals and keep the acceleration in between.
        remaining: The candidate with the largest z-score, and its z-score.
        driver_minutes: Driver-minutes used for misjudgement and staleness [min].
    """

    kurtosis: float
    kurtosis_deviation: float
    kurtosis_before: float
    autocorrelation: float
    autocorrelation_by_noise: float
    unequal_noise: dict[str, float]
    misjudgement: float
    staleness: float
    remaining: tuple[Term, float]
    driver_minutes: float

    @property
    def most_growth(self) -> float:
        """Limit of misjudgement and staleness [-]."""
        return max(THRESHOLDS.growth_z_score, THRESHOLDS.growth_per_root_minute * float(np.sqrt(self.driver_minutes)))

    @property
    def misjudges(self) -> bool:
        """True if drivers seem to misjudge gaps, or to decide at intervals."""
        return max(self.misjudgement, self.staleness) > self.most_growth

    @property
    def is_of_clocks(self) -> bool:
        """True if corrected clock offsets may explain everything. The kurtosis is not tested, because the times of
        cut-ins are not corrected.
        """
        return max(self.misjudgement, self.staleness) < THRESHOLDS.growth_beside_clocks and self.is_white

    @property
    def is_white(self) -> bool:
        """True if `excess_autocorrelation` is small."""
        return abs(self.excess_autocorrelation) < THRESHOLDS.most_autocorrelation

    @property
    def excess_autocorrelation(self) -> float:
        """Autocorrelation of innovations beyond the range from 0 to that of drives simulated with noise alone [-].

        The observer assumes innovations without autocorrelation. Noise alone makes them positively correlated if
        drives were smoothed, and negatively if drivers correct errors faster than the observer, which has one gain for
        all of them, assumes; either may be weaker than simulated, because leaders' errors count as drivers' noise too.
        """
        by_noise = self.autocorrelation_by_noise
        return self.autocorrelation - float(np.clip(self.autocorrelation, min(by_noise, 0.0), max(by_noise, 0.0)))

    @property
    def is_adequate(self) -> bool:
        """True if the residuals of the final model are consistent with driver noise."""
        return self.is_normal and not self.misjudges and self.is_white

    @property
    def is_normal(self) -> bool:
        """True if the kurtosis is that of normal innovations, or if the added effects removed enough of it."""
        return self.kurtosis <= self.tolerated_kurtosis or self.kurtosis < self.enough_removed

    @property
    def tolerated_kurtosis(self) -> float:
        """Kurtosis up to which innovations count as normal [-]."""
        return max(THRESHOLDS.most_kurtosis, THRESHOLDS.kurtosis_z_score * self.kurtosis_deviation)

    @property
    def enough_removed(self) -> float:
        """Kurtosis below which the added effects removed enough of it [-]."""
        return THRESHOLDS.kurtosis_left * self.kurtosis_before


def adequacy(solver: Solver, search: Search, seed: int) -> Adequacy:
    """Adequacy of the final model of a search.

    Kurtosis and autocorrelation are those far from changes of leader, if there are enough data: how a lane change is
    carried out differs from time to time. Misjudged gaps and old decisions are not candidates of the search, and
    nothing is fitted to test them, so the tests use the fitted and the check drivers together.
    """
    state, noise, last_round = search.last.state, search.last.noise, search.rounds[-1]
    (innovation_before,) = solver.innovations([search.first.state])
    states = [state, recalibrated(solver, search.checked, search.last)]
    of_parts = [residuals_of(solver, solved, noise) for solved in states]
    by_noise = by_noise_alone(solver, states, noise, seed)
    fitted = of_parts[0]
    weight = far_from_changes(state.data, state.data.weight)
    innovation = standardised(fitted.innovation, state.data, noise)
    innovation_before = standardised(innovation_before, state.data, search.first.noise)
    term = max(last_round.z_score, key=lambda key: last_round.z_score[key])
    return Adequacy(
        kurtosis=kurtosis(innovation, weight),
        kurtosis_deviation=float(np.sqrt(24.0 / weight.sum())),
        kurtosis_before=kurtosis(innovation_before, weight),
        autocorrelation=neighbour_autocorrelation(fitted),
        autocorrelation_by_noise=float(np.mean([neighbour_autocorrelation(of_fitted) for of_fitted, _ in by_noise])),
        unequal_noise=unequal_noise(fitted.innovation, state.data),
        misjudgement=misjudgement(of_parts, by_noise),
        staleness=staleness(of_parts, by_noise),
        remaining=(term, float(last_round.z_score[term])),
        driver_minutes=sum(solved.data.seconds for solved in states) / 60,
    )


def by_noise_alone(solver: Solver, states: Sequence[FitState], noise: Noise, seed: int) -> list[ResidualsByPart]:
    """Residuals of drives simulated with the final model and noise alone, for each replicate."""
    replicates_by_part = [
        [replicate for batch in noise_alone(solver, state, noise, REPLICATES, seed + part) for replicate in batch]
        for part, state in enumerate(states)
    ]
    return [
        [residuals_of(solver, drives, noise) for drives in replicate]
        for replicate in zip(*replicates_by_part, strict=True)
    ]


def standardised(
    innovation: Float[np.ndarray, "steps pieces"], data: Measured, noise: Noise
) -> Float[np.ndarray, "steps pieces"]:
    """Innovations divided by the standard deviation that the noise model expects, relative to that behind a steady
    leader, and by their local root mean square of the same driver [-], because noise levels differ between drivers and
    rise while a driver accelerates or brakes.
    """
    innovation = innovation / np.sqrt(relative_variance(data, noise))
    energy = np.cumsum(np.pad(innovation**2 * data.weight, ((1, 0), (0, 0))), axis=0)
    count = np.cumsum(np.pad(data.weight, ((1, 0), (0, 0))), axis=0)
    half, row = round(CONSTANT_NOISE_TIME / 2 / data.dt), np.arange(len(innovation))
    first, stop = np.maximum(row - half, 0), np.minimum(row + half + 1, len(innovation))
    local = (energy[stop] - energy[first]) / np.maximum(count[stop] - count[first], 1.0)
    return innovation / np.sqrt(np.maximum(local, 1e-12))


def neighbour_autocorrelation(residuals: Residuals) -> float:
    """Autocorrelation of standardised innovations from one independent measurement to the next [-]."""
    data, lag = residuals.state.data, residuals.state.data.stride
    innovation = standardised(residuals.innovation, data, residuals.noise)
    weight = far_from_changes(data, data.weight)
    pair = weight[lag:] * weight[:-lag]
    return float((innovation[lag:] * innovation[:-lag] * pair).sum() / pair.sum())  # NaN without a pair: not white


def kurtosis(innovation: Float[np.ndarray, "steps pieces"], weight: Float[np.ndarray, "steps pieces"]) -> float:
    """Excess kurtosis of the innovations that count [-]."""
    square, fourth = ((innovation**power * weight).sum() / weight.sum() for power in (2, 4))
    return float(fourth / square**2 - 3)  # 3: kurtosis of normal values


def unequal_noise(innovation: Float[np.ndarray, "steps pieces"], data: Measured) -> dict[str, float]:
    """Dependence of the size of innovations [m] on gap, speed and approach rate, in standard deviations [-]."""
    situations = {
        "gap": np.log(np.maximum(data.gap, 1.0)),
        "speed": data.smooth_speed,
        "approach_rate": np.abs(data.smooth_speed - data.surroundings.leader_speed),
    }
    relative = innovation**2 / data.driver_mean(innovation**2)[data.driver]
    return {name: _in_deviations(_driver_scores(relative, values, data)) for name, values in situations.items()}


def misjudgement(measured: ResidualsByPart, by_noise: Sequence[ResidualsByPart]) -> float:
    """Growth of the acceleration residual with the response to a misjudged gap, in standard deviations [-]. `by_noise`
    are residuals of replicates of the measured drives, simulated with the final model and noise alone.

    A relative error of the gap changes the acceleration by the gap times the model's derivative by the gap. Noise of
    the acceleration does not depend on this derivative and is even damped by it, which gives negative values.
    """

    def by_misjudging(residuals: Residuals) -> np.ndarray:
        gap, by_gap = np.asarray(residuals.stimulus().gap), acceleration_derivatives(residuals).x
        return (by_gap * gap) ** 2

    return _beyond_noise(by_misjudging, measured, by_noise)


def staleness(measured: ResidualsByPart, by_noise: Sequence[ResidualsByPart]) -> float:
    """Growth of the acceleration residual with the recent change of the model acceleration, in standard deviations [-].

    A driver who decides from time to time and keeps the acceleration in between lags by a random time; the resulting
    residual is proportional to the change. A constant lag is a delay, which leaves no such residual once the model
    contains it. Noise also changes the speed and thereby the model acceleration, most of all behind leaders of steady
    speed; simulations with noise alone show by how much. Arguments as of `misjudgement`.
    """

    def by_old_decision(residuals: Residuals) -> np.ndarray:
        data = residuals.state.data
        wanted = wanted_acceleration(residuals).clip(*PLAUSIBLE_ACCELERATIONS)
        n_back = max(1, round(CHANGE_TIME / data.dt))
        change = np.zeros_like(wanted)
        change[n_back:] = wanted[n_back:] - wanted[:-n_back]
        return change**2

    return _beyond_noise(by_old_decision, measured, by_noise)


SquaredCause = Callable[[Residuals], np.ndarray]
"""Function from residuals to the square of a possible cause of the acceleration residual in every time step."""


def _beyond_noise(squared_cause: SquaredCause, measured: ResidualsByPart, by_noise: Sequence[ResidualsByPart]) -> float:
    """Growth of the acceleration residual with a squared cause, minus the growth by noise alone if that is positive.

    A negative growth by noise alone is not subtracted: drivers with a delay, even a modelled one, show more growth than
    noise alone, and would otherwise exceed the threshold.
    """

    def growth(by_part: ResidualsByPart) -> float:
        scores = [_energy_scores(squared_cause(residuals), residuals) for residuals in by_part]
        return _in_deviations(np.concatenate(scores))

    return growth(measured) - max(float(np.mean([growth(replicate) for replicate in by_noise])), 0.0)


def _energy_scores(square: Float[np.ndarray, "steps pieces"], residuals: Residuals) -> Float[np.ndarray, " drivers"]:
    """Growth of each driver's squared acceleration residual with a squared cause; 0 if no time step counts."""
    data = residuals.state.data
    counts = data.weight > 0
    if not counts.any():
        return np.zeros(data.n_drivers)
    large, most = np.quantile(square[counts], [0.9, 0.98])
    cause = np.minimum(square, most) / max(float(large), 1e-12)
    energy = residuals.acceleration**2
    energy = np.minimum(energy / np.maximum(data.driver_mean(energy), 1e-12)[data.driver], MOST_ENERGY)
    return _driver_scores(energy, cause, data)


def _driver_scores(
    energy: Float[np.ndarray, "steps pieces"], situation: Float[np.ndarray, "steps pieces"], data: Measured
) -> Float[np.ndarray, " drivers"]:
    """Covariance of squared residual and situation within each driver, times the number of time steps that count."""

    def deviation(values: np.ndarray) -> np.ndarray:
        return values - data.driver_mean(values)[data.driver]

    return np.bincount(
        data.driver, (deviation(energy) * deviation(situation) * data.weight).sum(axis=0), data.n_drivers
    )


def _in_deviations(scores: Float[np.ndarray, " drivers"]) -> float:
    """Sum of independent scores of mean 0, in standard deviations of the sum [-]."""
    return float(scores.sum() / max(float(np.sqrt((scores**2).sum())), 1e-12))
