"""Decision between fitted candidates (possible missing effects), by their gains of log-likelihood on the drivers that
they are fitted to and on other drivers, the check drivers, less a complexity penalty.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.base import Base
from rearl_jax.discovery.observe.candidates import CANDIDATE_EFFECTS, PLACED, REACTION_DELAY, Candidate, Term
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.uncertainty import complexity_penalty
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.families import confounded
from rearl_jax.discovery.thresholds import THRESHOLDS

OF_FOLLOWER = frozenset({"follower_gap", "follower_approach_rate"})
"""Variables that depend on the vehicle behind."""


@dataclass(frozen=True)
class Trial:
    """A fitted candidate and its gains.

    Attributes:
        candidate: The candidate.
        fit: The model fitted with the candidate.
        fitted: Gain of each fitted driver [nats], bounded as in `bounded_gains`.
        checked: Gain of each check driver, with its parameters calibrated again [nats], bounded.
        other: State of the check drivers with the candidate.
        penalty: Complexity penalty [nats].
        null_mean: Mean gain of all drivers together if no effect is missing [nats].
        simulated: Gain of each check driver's simulation [nats], bounded; None if not simulated.
    """

    candidate: Candidate
    fit: Fit
    fitted: Float[np.ndarray, " drivers"]
    checked: Float[np.ndarray, " check_drivers"]
    other: FitState
    penalty: float
    null_mean: float = 0.0
    simulated: Float[np.ndarray, " check_drivers"] | None = None

    @property
    def gain(self) -> float:
        """Gain on the fitted drivers, less the complexity penalty [nats]."""
        return float(self.fitted.sum()) - self.penalty

    @property
    def check(self) -> float:
        """Gain on the check drivers [nats]."""
        return float(self.checked.sum())

    @property
    def total(self) -> float:
        """Total gain by which candidates are compared [nats]."""
        return self.gain + self.check - self.null_mean

    @property
    def is_of_follower(self) -> bool:
        """True for a response to the vehicle behind. That vehicle reacts to the recorded drive, so a simulated driver
        who responds to it stays near the recorded drive in any case: better simulations are no evidence.
        """
        return bool(OF_FOLLOWER & set(self.candidate.variables))

    @property
    def overall(self) -> float:
        """Total gain of one-step predictions and simulations with equal weight [nats], see `is_of_follower`."""
        by_simulation = 0.0 if self.simulated is None else float(self.simulated.sum())
        if self.is_of_follower:
            by_simulation = min(by_simulation, 0.0)
        return self.total + by_simulation

    def beats(self, other: "Trial") -> bool:
        """True if the overall gain exceeds that of another trial by more than `indistinct_total`."""
        return self.overall > other.overall + THRESHOLDS.indistinct_total

    @property
    def holds(self) -> bool:
        """True if fitted and check drivers both support the candidate."""
        return (
            self.gain > THRESHOLDS.least_gain
            and self.total > THRESHOLDS.least_total
            and self.check > THRESHOLDS.worst_check
        )


def bounded_gains(gains: Float[np.ndarray, " drivers"], data: Measured) -> Float[np.ndarray, " drivers"]:
    """Gain of each driver, bounded so that one driver cannot decide [nats]; the bound grows with the driver's time."""
    bound = THRESHOLDS.most_from_one_driver * np.maximum(data.driver_minutes, 1.0)
    return np.clip(gains, -bound, bound)


def trial_of(
    solver: Solver, fit: Fit, base: FitState, other: FitState, other_base: FitState, null_mean: float
) -> Trial:
    """Gains of a fitted candidate. `other` is the state of the check drivers with the candidate; `base` and
    `other_base` are those of the fitted and of the check drivers without it; `null_mean` as in `Trial`.
    """
    candidate = fit.candidate
    assert candidate is not None
    cost = complexity_penalty(solver, fit.state, candidate.free)
    if candidate.kind == "generic":
        cost += THRESHOLDS.freedom_price
    fitted = bounded_gains(fit.state.penalised() - base.penalised(), base.data)
    checked = bounded_gains(other.penalised() - other_base.penalised(), other.data)
    return Trial(candidate, fit, fitted, checked, other, cost, null_mean)


def lane_change_trials(solver: Solver, base: Base, checked: Measured) -> list[Trial]:
    """Trials of the effects of lane changes in the calibrated model, each against the model with those before it."""
    if not base.extended:
        return []
    fits = [base.bare, *base.extended]
    of_check = [recalibrated(solver, checked, fit) for fit in fits]
    return [
        trial_of(solver, after, before.state, other, other_before, 0.0)
        for before, after, other_before, other in zip(fits[:-1], fits[1:], of_check[:-1], of_check[1:], strict=True)
    ]


def shortest_delay(data: Measured) -> float:
    """Shortest delay [s] that must be a reaction time: it exceeds the lag of vehicles, `least_delay`, and the standard
    deviation of the kernel that smoothed the positions.

    A driver without a delay responds just as late if the vehicle takes time to carry out the acceleration, or if the
    decision is carried out one time step later.
    """
    return max(THRESHOLDS.vehicle_lag, THRESHOLDS.least_delay * data.dt, data.kernel.deviation)


def is_too_short(trial: Trial) -> bool:
    """True if the trial is a delay that need not be a reaction time, see `shortest_delay`."""
    if trial.candidate.term != REACTION_DELAY:
        return False
    state = trial.fit.state
    return bool(np.abs(state.theta[list(trial.candidate.free)]).max() < shortest_delay(state.data))


def copies_leader(trial: Trial) -> bool:
    """True if the trial is a response to the leader's acceleration by which drivers accelerate at once as hard as the
    leader, or harder.

    No driver can do so. Measured drivers seem to do so if both positions share an error, for example if a vehicle was
    measured from its leader.
    """
    if trial.candidate.term != Term("leader_acceleration"):
        return False
    share = trial.fit.state.theta[trial.candidate.free[0]]
    return bool(share >= THRESHOLDS.whole_acceleration)


def imitating(trials: list[Trial]) -> set[Term]:
    """Candidates that a response which is none of drivers explains better: a delay that is too short, which fast
    responses imitate, or a copy of the leader's acceleration. A free curve over the leader's acceleration imitates the
    copy unless it is clearly better.
    """
    impossible = [trial for trial in trials if (is_too_short(trial) or copies_leader(trial)) and trial.holds]

    def is_imitation(trial: Trial, other: Trial) -> bool:
        if not confounded(trial.candidate.term, other.candidate.term):
            return False
        is_its_curve = copies_leader(other) and trial.candidate.term == Term("dependence", "leader_acceleration")
        return other.beats(trial) or (is_its_curve and not trial.beats(other))

    return {trial.candidate.term for trial in trials for other in impossible if is_imitation(trial, other)}


def is_everywhere(trial: Trial) -> bool:
    """True if the trial is a section of road that contains the whole measured road, or a change of conditions before
    the recordings begin. What acts on all drivers at all times is a property of the drivers.
    """
    effect = trial.candidate.term.effect
    if effect not in PLACED:
        return False
    state = trial.fit.state
    names = [parameter.name for parameter in CANDIDATE_EFFECTS[effect].parameters]
    values = dict(zip(names, state.theta[list(trial.candidate.free)].tolist(), strict=True))
    measured = state.data.weight > 0
    if PLACED[effect] == "time":
        return bool(values["onset"] <= state.data.surroundings.time[measured].min())
    positions = state.data.y[measured]
    return bool(values["start"] <= positions.min() and values["end"] >= positions.max())


def believed(trials: list[Trial]) -> list[Trial]:
    """Supported candidates (see `Trial.holds`), the best first. If there are any, unsupported candidates that are
    clearly better (see `Trial.beats`) precede them: they are the better explanation, even if their gain on the fitted
    drivers hardly exceeds the complexity penalty.
    """
    accepted = sorted((trial for trial in trials if trial.holds), key=lambda trial: -trial.total)
    better = [trial for trial in trials if accepted and trial.gain > 0 and trial.beats(accepted[0])]
    return sorted(better, key=lambda trial: -trial.total) + accepted


def indistinguishable(best: list[Trial]) -> list[Trial]:
    """The best trial, which is the first, and the trials within `indistinct_total` of it."""
    return [trial for trial in best if best[0].overall - trial.overall < THRESHOLDS.indistinct_total]
