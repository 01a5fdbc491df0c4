"""Decision between fitted candidates: gain where they were fitted, and on other drivers, against their freedom."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.candidates import Candidate
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.uncertainty import price
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS


@dataclass(frozen=True)
class Trial:
    """A fitted candidate and its gains.

    Attributes:
        candidate: Which.
        fit: With it.
        fitted: Gain of each driver where it was fitted [nats], within the bounds of what one driver can contribute.
        checked: Gain of each other driver, all of whom found their own parameters anew [nats], within these bounds.
        other: The other drivers with it.
        price: Paid for its freedom [nats].
        null_mean: What all drivers together gain where nothing is missing [nats].
        simulated: Gain of each other driver's simulation [nats], within these bounds; None where none was asked.
    """

    candidate: Candidate
    fit: Fit
    fitted: Float[np.ndarray, " drivers"]
    checked: Float[np.ndarray, " others"]
    other: FitState
    price: float
    null_mean: float = 0.0
    simulated: Float[np.ndarray, " others"] | None = None

    @property
    def gain(self) -> float:
        """Gain where it was fitted, paid for [nats]."""
        return float(self.fitted.sum()) - self.price

    @property
    def check(self) -> float:
        """Gain on the other drivers [nats]."""
        return float(self.checked.sum())

    @property
    def total(self) -> float:
        """Total that candidates are compared by [nats]."""
        return self.gain + self.check - self.null_mean

    @property
    def overall(self) -> float:
        """The total with what simulations say of it [nats]: one time step ahead and a minute ahead are asked alike."""
        return self.total + (0.0 if self.simulated is None else float(self.simulated.sum()))

    def beats(self, other: "Trial") -> bool:
        """True if it fares better than another by more than what tells candidates apart."""
        return self.overall > other.overall + THRESHOLDS.indistinct_total

    @property
    def holds(self) -> bool:
        """True if it is believed as far as the drivers go."""
        return (
            self.gain > THRESHOLDS.least_gain
            and self.total > THRESHOLDS.least_total
            and self.check > THRESHOLDS.worst_check
        )


def bounded_gains(gains: Float[np.ndarray, " drivers"], data: Measured) -> Float[np.ndarray, " drivers"]:
    """Gain of each driver within the bounds of what one can contribute [nats]; they grow with what was seen of it."""
    most = THRESHOLDS.most_from_one_driver * np.maximum(data.driver_minutes, 1.0)
    return np.clip(gains, -most, most)


def trial_of(
    solver: Solver, fit: Fit, base: FitState, other: FitState, other_base: FitState, null_mean: float
) -> Trial:
    """Gains of a fitted candidate against the model without it (`base`), of the same drivers and of others."""
    candidate = fit.candidate
    assert candidate is not None
    cost = price(solver, fit.state, candidate.free)
    if candidate.kind == "generic":
        cost += THRESHOLDS.freedom_price
    fitted = bounded_gains(fit.state.penalised() - base.penalised(), base.data)
    checked = bounded_gains(other.penalised() - other_base.penalised(), other.data)
    return Trial(candidate, fit, fitted, checked, other, cost, null_mean)


def ranked(trials: list[Trial]) -> list[Trial]:
    """Those that hold, the best first."""
    return sorted((trial for trial in trials if trial.holds), key=lambda trial: -trial.total)


def believed(trials: list[Trial]) -> list[Trial]:
    """Those that hold, the best first; before them, where any holds, what fares better still.

    What convinces other drivers by so much more is the better account, also where the fitted ones hardly paid for its
    freedom.
    """
    accepted = ranked(trials)
    better = [trial for trial in trials if accepted and trial.gain > 0 and trial.beats(accepted[0])]
    return sorted(better, key=lambda trial: -trial.total) + accepted


def not_told_apart(best: list[Trial]) -> list[Trial]:
    """The best and those that come within `indistinct_total` of it."""
    return [trial for trial in best if best[0].overall - trial.overall < THRESHOLDS.indistinct_total]
