"""Adequacy of the final model: is what it leaves noise, or is there more?

Source: Meissner & Glasner, arXiv:2406.06707, for the joint view of states and terms; excess kurtosis as a test of
normality, Jarque & Bera, Int. Stat. Rev. 55 (1987) 163; variance that depends on the situation, Breusch & Pagan,
Econometrica 47 (1979) 1287.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.core.following import follow
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit, on_others
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.forcing import answers, drivers_of
from rearl_jax.discovery.observe.residuals import Residuals, residuals_of
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.null import noise_alone
from rearl_jax.discovery.search.procedure import Search
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_ENERGY = 9.0
"""Bound of a squared acceleration over a driver's usual one [-]: no single time step decides."""

OF_LATE = 0.3
"""Time over which a change of what the model wants is looked at [s]."""

REASONABLE = (-5.0, 3.0)
"""Accelerations a driver may want [m/s^2]; beyond them, a leader is measured too close."""


EVEN_FOR = 20.0
"""Time within which a driver's noise is taken to be of one size [s]: on measured drives the excess kurtosis of 0.18 is
still 0.17 where every driver has a size of its own, and -0.03 where every 20 s have one.
"""

REPLICATES = 8
"""Times the drives are made again, to see what noise alone leaves: its mean is known to 0.35 standard deviations."""

Parts = Sequence[Residuals]
"""Residuals of the final model, of each part of the drivers."""


@dataclass(frozen=True)
class Adequacy:
    """Measures of what the final model leaves behind.

    Attributes:
        kurtosis: Excess kurtosis of the innovations [-].
        kurtosis_deviation: Its standard deviation where innovations are normal [-].
        kurtosis_before: The same without anything added [-].
        autocorrelation: Autocorrelation of innovations one time step apart [-].
        unequal_noise: How surely the size of innovations depends on a situation, in standard deviations [-].
        misjudgement: How surely noise grows with what a misjudged gap would do, in standard deviations [-].
        staleness: The same with what a decision of some time ago would do [-].
        remaining: The candidate with the largest z-score, and its z-score.
        driver_minutes: Driver-minutes of what misjudgement and staleness were looked for in [min].
    """

    kurtosis: float
    kurtosis_deviation: float
    kurtosis_before: float
    autocorrelation: float
    unequal_noise: dict[str, float]
    misjudgement: float
    staleness: float
    remaining: tuple[Term, float]
    driver_minutes: float

    @property
    def misjudges(self) -> bool:
        """True if drivers seem to misjudge gaps, or to act on what they saw some time ago."""
        least = max(THRESHOLDS.growth_z_score, THRESHOLDS.growth_per_root_minute * float(np.sqrt(self.driver_minutes)))
        return max(self.misjudgement, self.staleness) > least

    @property
    def is_of_clocks(self) -> bool:
        """True if clocks that were put right may be all there is. Innovations need not be smooth: who cuts in when is
        not put right.
        """
        return max(self.misjudgement, self.staleness) < THRESHOLDS.growth_beside_clocks and self.is_white

    @property
    def is_white(self) -> bool:
        """True if innovations have nothing to do with the ones before."""
        return abs(self.autocorrelation) < THRESHOLDS.most_autocorrelation

    @property
    def is_enough(self) -> bool:
        """True if the final model leaves nothing but noise as drivers make it."""
        return self.is_smooth and not self.misjudges and self.is_white

    @property
    def is_smooth(self) -> bool:
        """True if the innovations look like those of a smooth model, or as rough as rare emergencies leave them."""
        explained = self.kurtosis < THRESHOLDS.kurtosis_left * self.kurtosis_before
        return (
            self.kurtosis <= max(THRESHOLDS.most_kurtosis, THRESHOLDS.kurtosis_z_score * self.kurtosis_deviation)
            or explained
        )


def adequacy(solver: Solver, found: Search, seed: int) -> Adequacy:
    """Moments of the final model's innovations, and the candidate that is most surprising still.

    Misjudged gaps and old decisions, which nothing else confirms, are asked of the other drivers as well.

    Args:
        solver: Has fitted the model.
        found: What was added.
        seed: Seed of the drives that are made again.
    """
    state, last = found.last.state, found.rounds[-1]
    (before,) = solver.innovations([found.first.state])
    states = [state, *on_others(solver, found.checked, [found.last])]
    everybody = residuals_of(solver, states, [found.last, found.last])
    chance = by_noise_alone(solver, states, found.last, seed)
    left = everybody[0]
    weight = state.data.weight
    innovation, before = standardised(left.innovation, state.data), standardised(before, state.data)
    lag = state.data.stride
    pair = weight[lag:] * weight[:-lag]
    neighbours = (innovation[lag:] * innovation[:-lag] * pair).sum() / pair.sum()
    term = max(last.z_score, key=lambda key: last.z_score[key])
    return Adequacy(
        kurtosis=kurtosis(innovation, weight),
        kurtosis_deviation=float(np.sqrt(24.0 / weight.sum())),
        kurtosis_before=kurtosis(before, weight),
        autocorrelation=float(neighbours),
        unequal_noise=unequal_noise(left.innovation, state.data),
        misjudgement=misjudgement(everybody, chance),
        staleness=staleness(everybody, chance),
        remaining=(term, float(last.z_score[term])),
        driver_minutes=sum(one.data.seconds for one in states) / 60,
    )


def by_noise_alone(solver: Solver, states: Sequence[FitState], fit: Fit, seed: int) -> list[Parts]:
    """Residuals of drives that the final model and noise have made, nothing else: a list of parts per replicate."""
    parts = [
        [one for group in noise_alone(solver, state, fit.noise, REPLICATES, seed + part) for one in group]
        for part, state in enumerate(states)
    ]
    return [residuals_of(solver, again, [fit] * len(again)) for again in zip(*parts, strict=True)]


def standardised(innovation: Float[np.ndarray, "steps pieces"], data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Innovations over their own usual size around each moment of each driver [-]: drivers differ in how evenly they
    drive, and drive less evenly while they accelerate or brake.
    """
    energy = np.cumsum(np.pad(innovation**2 * data.weight, ((1, 0), (0, 0))), axis=0)
    count = np.cumsum(np.pad(data.weight, ((1, 0), (0, 0))), axis=0)
    half, row = round(EVEN_FOR / 2 / data.dt), np.arange(len(innovation))
    first, last = np.maximum(row - half, 0), np.minimum(row + half + 1, len(innovation))
    usual = (energy[last] - energy[first]) / np.maximum(count[last] - count[first], 1.0)
    return innovation / np.sqrt(np.maximum(usual, 1e-12))


def kurtosis(innovation: Float[np.ndarray, "steps pieces"], weight: Float[np.ndarray, "steps pieces"]) -> float:
    """Excess kurtosis of the innovations that count [-]."""
    square, fourth = ((innovation**power * weight).sum() / weight.sum() for power in (2, 4))
    return float(fourth / square**2 - 3)


def unequal_noise(innovation: Float[np.ndarray, "steps pieces"], data: Measured) -> dict[str, float]:
    """Dependence of the size of innovations [m] on the situation: standard normal figures where there is none."""
    around = data.around
    gap = np.maximum(around.leader_rear - (data.smooth + data.length / 2), 1.0)
    situations = {
        "gap": np.log(gap),
        "speed": data.smooth_speed,
        "approach_rate": np.abs(data.smooth_speed - around.leader_speed),
    }

    relative = innovation**2 / data.driver_mean(innovation**2)[data.driver]
    return {name: _surely(_driver_scores(relative, values, data)) for name, values in situations.items()}


def misjudgement(parts: Parts, chance: Sequence[Parts]) -> float:
    """Growth of what drivers do beside the model with what a misjudged gap would make them do, in standard deviations.

    An error of the gap in proportion to it changes the acceleration by the gap times the model's answer to it. Noise of
    the acceleration does not depend on that answer, and is even damped by it: negative figures.
    `chance` are residuals of drives that the final model and noise alone have made.
    """

    def by_misjudging(left: Residuals) -> np.ndarray:
        gap, answer = np.asarray(left.stimulus().gap), answers(left).x
        return (answer * gap) ** 2

    return _beyond_chance(by_misjudging, parts, chance)


def staleness(parts: Parts, chance: Sequence[Parts]) -> float:
    """Growth of what drivers do beside the model with the late change of what it wants, in standard deviations.

    Who decides now and then, and holds on to it in between, is behind by a random time; what that does is in proportion
    to the change. Behind by always the same time he has a delay, which leaves nothing of the kind once it is known.
    Noise changes what the model wants too, by the speed it leaves: the calmer the leaders, the more of it by chance.
    Arguments as of `misjudgement`.
    """

    def by_being_late(left: Residuals) -> np.ndarray:
        data = left.state.data
        still = jnp.zeros(left.x.shape)
        wanted = np.asarray(follow(left.stimulus(), drivers_of(left), (), (), still, data.dt)[0], float)
        wanted = wanted.clip(*REASONABLE)
        ago = max(1, round(OF_LATE / data.dt))
        change = np.zeros_like(wanted)
        change[ago:] = wanted[ago:] - wanted[:-ago]
        return change**2

    return _beyond_chance(by_being_late, parts, chance)


Energy = Callable[[Residuals], np.ndarray]
"""Cause of what drivers do beside the model, squared."""


def _beyond_chance(energy: Energy, parts: Parts, chance: Sequence[Parts]) -> float:
    """Growth of what drivers do beside the model with an energy, beyond what noise alone leaves of that.

    Where noise leaves negative figures, zero is what has to be passed: a delay, known or not, leaves more than noise.
    """

    def grows(these: Parts) -> float:
        return _surely(np.concatenate([_energy_scores(energy(left), left) for left in these]))

    return grows(parts) - max(float(np.mean([grows(these) for these in chance])), 0.0)


def _energy_scores(square: Float[np.ndarray, "steps pieces"], left: Residuals) -> Float[np.ndarray, " drivers"]:
    """Growth of the energy of what each driver does beside the model with another one; nothing where no moment
    counts.
    """
    data = left.state.data
    counts = data.weight > 0
    if not counts.any():
        return np.zeros(data.n_drivers)
    usual, most = np.quantile(square[counts], [0.9, 0.98])
    stake = np.minimum(square, most) / max(float(usual), 1e-12)
    energy = left.acceleration**2
    energy = np.minimum(energy / np.maximum(data.driver_mean(energy), 1e-12)[data.driver], MOST_ENERGY)
    return _driver_scores(energy, stake, data)


def _driver_scores(
    energy: Float[np.ndarray, "steps pieces"], situation: Float[np.ndarray, "steps pieces"], data: Measured
) -> Float[np.ndarray, " drivers"]:
    """Growth of one with the other, driver by driver; drivers are compared with themselves."""

    def off(values: np.ndarray) -> np.ndarray:
        return values - data.driver_mean(values)[data.driver]

    return np.bincount(data.driver, (off(energy) * off(situation) * data.weight).sum(axis=0), data.n_drivers)


def _surely(scores: Float[np.ndarray, " drivers"]) -> float:
    """Sum of the scores in standard deviations [-]."""
    return float(scores.sum() / max(float(np.sqrt((scores**2).sum())), 1e-12))
