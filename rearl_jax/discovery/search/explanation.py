"""Tests whether a search explains the drivers, and whether one with another model predicts them better."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.adequacy import Adequacy
from rearl_jax.discovery.search.decision import bounded_gains
from rearl_jax.discovery.search.outcome import Search, is_free
from rearl_jax.discovery.search.simulation import resampled_means, share_worse, simulated_gains
from rearl_jax.discovery.thresholds import THRESHOLDS


@dataclass(frozen=True)
class Prediction:
    """Predictions of the final model of a search for the check drivers (`data`): the log-likelihood of each driver's
    positions, predicted one time step ahead, with the driver's parameters integrated out [nats], and the gap error of
    each driver in simulation, with the driver's parameters calibrated to the gap [m].
    """

    log_likelihood: Float[np.ndarray, " drivers"]
    gap_error: Float[np.ndarray, " drivers"]
    data: Measured


def prediction_of(solver: Solver, outcome: Search) -> Prediction:
    """Predictions of the final model of a search for the check drivers."""
    state = recalibrated(solver, outcome.checked, outcome.last)
    (error,) = gap_errors(solver, [state])
    return Prediction(state.marginal(), error, outcome.checked)


def is_explained(outcome: Search, adequacy: Adequacy) -> bool:
    """True if only noise is left and every effect found has a name without doubt; no effect need be found."""
    if outcome.rejected or outcome.is_contradicted or outcome.leaves_shifts:
        return False
    if not outcome.added and outcome.leaves_more:
        return False
    if any(is_free(trial) or outcome.is_doubtful(trial) for trial in outcome.added):
        return False
    return adequacy.is_adequate


def predicts_better(before: Prediction, after: Prediction, seed: int) -> bool:
    """True if a search with another model (`after`) predicts the check drivers significantly better than the first
    search (`before`), one-step predictions and simulations together, and its simulations are not significantly worse.
    """
    gains = bounded_gains(after.log_likelihood - before.log_likelihood, after.data)
    simulated = simulated_gains(before.gap_error, after.gap_error, after.data)
    worse = share_worse(before.gap_error, after.gap_error, THRESHOLDS.borne_growth, seed)
    share_better = (resampled_means(gains + simulated, seed) > 0).mean()
    return bool(share_better >= THRESHOLDS.base_confidence and worse < THRESHOLDS.rejection_share)
