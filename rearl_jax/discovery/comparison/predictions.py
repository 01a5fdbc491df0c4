"""Additions to a model that do not explain its drivers: only as many as predict other drivers best."""

from dataclasses import replace

import numpy as np

from rearl_jax.discovery.comparison.choice import mean_prediction_error
from rearl_jax.discovery.comparison.compared import errors_by_protocol
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.report.protocols import PROTOCOL_MEASURES
from rearl_jax.discovery.search.procedure import Search


def best_predicting(solver: Solver, outcome: Search) -> Search:
    """The search with as many of its additions, in their order, as predict the checked drivers best.

    Evidence comes from one-step predictions, and simulations of calibrated drivers forgive much. An effect that is not
    surely the right one has to be of use for drivers, or parts of drives, to which nothing was calibrated.
    """
    if not outcome.added:
        return outcome
    fits = [outcome.first, *(trial.fit for trial in outcome.added)]
    states = recalibrated(solver, outcome.checked, fits)
    errors = [errors_by_protocol(solver, fit, state) for fit, state in zip(fits, states, strict=True)]
    measure = PROTOCOL_MEASURES[0]
    kept = int(np.argmin([mean_prediction_error({name: one[measure] for name, one in of.items()}) for of in errors]))
    if kept == len(outcome.added):
        return outcome
    rounds = [*outcome.rounds[:kept], replace(outcome.rounds[kept], accepted=[])]
    return replace(outcome, rounds=rounds, rejected=[*outcome.rejected, *outcome.added[kept:]])
