"""Choice among additions that do not explain the drivers: as many as predict other drivers best."""

import numpy as np

from rearl_jax.discovery.comparison.choice import mean_prediction_error
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.report.protocols import prediction_errors
from rearl_jax.discovery.search.confirmation import with_first_additions
from rearl_jax.discovery.search.procedure import Search


def best_predicting(solver: Solver, outcome: Search) -> Search:
    """The search with as many of its additions, in their order, as predict the checked drivers best.

    Evidence comes from one-step predictions, and calibrated parameters can compensate for wrong effects in simulations.
    An effect that may not be the right one must improve predictions for drivers, or parts of drives, to which no
    parameter was calibrated.
    """
    if not outcome.added:
        return outcome
    fits = [outcome.first, *(trial.fit for trial in outcome.added)]
    states = recalibrated(solver, outcome.checked, fits)
    errors = [prediction_errors(solver, state, fit) for fit, state in zip(fits, states, strict=True)]
    gap_errors = [
        {name: of_protocol.by_driver["gap_rmse"] for name, of_protocol in of_fit.items() if of_protocol}
        for of_fit in errors
    ]
    return with_first_additions(outcome, int(np.argmin([mean_prediction_error(of_fit) for of_fit in gap_errors])))
