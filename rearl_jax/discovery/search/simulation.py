"""Simulations of the check drivers with candidates: they must agree with the evidence from one-step predictions, and
added effects must not make them worse.

Noise that differs from the observer's assumptions can look like an effect in one-step predictions. A simulation
accumulates the influence of an effect over time.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.candidates import LENS
from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.resampling import resamples
from rearl_jax.discovery.search.decision import Trial, bounded_gains
from rearl_jax.discovery.search.outcome import Search, is_free
from rearl_jax.discovery.thresholds import THRESHOLDS

DRAWS = 1000
"""Resamples of drivers."""

ROUNDING = 1e-9
"""Relative change of the squared error that is attributed to rounding [-]."""


def simulated(solver: Solver, base: FitState, accepted: Sequence[Trial]) -> tuple[list[Trial], list[Trial]]:
    """Trials confirmed by simulations of the check drivers, the best first, and trials contradicted by them; `base`
    is the state of these drivers without candidates.
    """
    leading = accepted[: THRESHOLDS.leading_simulated]
    if not leading:
        return [], []
    before, *errors = gap_errors(solver, [base, *(trial.other for trial in leading)])
    simulated_trials = [
        replace(trial, simulated=simulated_gains(before, after, base.data))
        for trial, after in zip(leading, errors, strict=True)
    ]
    tolerated = simulated_gains(before, before * np.sqrt(1 + THRESHOLDS.borne_growth), base.data)
    agreed, contradicted = [], []
    for trial in simulated_trials:
        assert trial.simulated is not None
        (contradicted if is_contradicted(trial.simulated, tolerated) else agreed).append(trial)
    return sorted(agreed, key=lambda trial: -trial.overall), contradicted


def simulated_gains(
    before: Float[np.ndarray, " drivers"], after: Float[np.ndarray, " drivers"], data: Measured
) -> Float[np.ndarray, " drivers"]:
    """Gain of log-likelihood of each driver's simulation [nats] whose gap error [m] changes from `before` to `after`.

    Errors of a simulation decay slowly, so a minute contains few independent errors; errors as small as the measurement
    noise carry no information. Source: likelihood of normal errors, at its maximum over their variance.
    """
    independent = data.driver_minutes * 60 / THRESHOLDS.simulated_memory
    least = data.noise**2
    gains = 0.5 * independent * np.log((before**2 + least) / (after**2 + least))
    return bounded_gains(gains, data)


def confirmed(solver: Solver, outcome: Search, seed: int) -> Search:
    """The search without those additions that make the closed-loop gap error of the check drivers larger.

    Additions are removed from the last one backwards. A free curve (effect without a name) after the first addition may
    only fit the remainder of earlier additions, so it is removed if it increases the error in more than half of the
    resamples of drivers. Then any addition is removed as long as the error is significantly larger than with none.
    """
    if not outcome.added:
        return outcome
    fits = [outcome.first, *(trial.fit for trial in outcome.added)]
    errors = gap_errors(solver, [recalibrated(solver, outcome.checked, fit) for fit in fits])
    kept = len(outcome.added)
    while (
        kept > 1 and is_free(outcome.added[kept - 1]) and share_worse(errors[kept - 1], errors[kept], seed=seed) > 0.5
    ):
        kept -= 1
    while kept and share_worse(errors[0], errors[kept], THRESHOLDS.borne_growth, seed) >= THRESHOLDS.rejection_share:
        kept -= 1
    if kept == len(outcome.added):
        return outcome
    last = outcome.rounds[kept]
    rounds = [*outcome.rounds[:kept], replace(last, accepted=[], dropped=last.accepted)]
    return replace(outcome, rounds=rounds, rejected=[*outcome.rejected, *outcome.added[kept:]])


def is_contradicted(gains: Float[np.ndarray, " drivers"], tolerated: Float[np.ndarray, " drivers"]) -> bool:
    """True if simulations lose more than the tolerated amount [nats] in most resamples of drivers.

    The contribution of each driver is bounded, so that one driver with a failed simulation does not decide.
    """
    return bool((resampled_means(gains - tolerated, seed=0) < 0).mean() > THRESHOLDS.contradiction_share)


def makes_simulations_worse(solver: Solver, before: FitState, after: FitState) -> bool:
    """True if a corrected artefact more likely increases than reduces the closed-loop gap error of drivers: `before`
    are the drivers as measured, under the model without the artefact, `after` the same with it corrected.

    One-step predictions may mistake other irregularities for an artefact; a simulation does not.
    """
    first, second = gap_errors(solver, [before, after])
    return share_worse(first, second) >= 0.5


def is_wrong_lens(solver: Solver, base: Fit, trial: Trial | None, checked: Measured) -> bool:
    """True if a trial corrects a camera distortion and makes simulations of the check drivers worse than `base`."""
    if trial is None or trial.candidate.term != LENS:
        return False
    return makes_simulations_worse(solver, recalibrated(solver, checked, base), trial.other)


def share_worse(
    before: Float[np.ndarray, " drivers"],
    after: Float[np.ndarray, " drivers"],
    tolerated: float = ROUNDING,
    seed: int = 0,
) -> float:
    """Share of resamples of drivers in which the squared error grows by more than the share `tolerated` [-]."""
    return float((resampled_means(after**2 - (1 + tolerated) * before**2, seed) > 0).mean())


def resampled_means(values: Float[np.ndarray, " drivers"], seed: int) -> Float[np.ndarray, " draws"]:
    """Means over resamples of drivers."""
    return values[resamples(len(values), DRAWS, seed)].mean(axis=1)
