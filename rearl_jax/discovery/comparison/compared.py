"""Car-following models calibrated to the same drivers, and their predictions for the same check drivers.

Parameters of drivers, population and noise are estimated for every model separately. The weights of the innovations are
estimated for the model of the key `driver` and used for all models, because log-likelihoods can be compared only if
they weight the data equally.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.discovery.comparison.choice import is_beaten
from rearl_jax.discovery.observe.base import Base, base_of
from rearl_jax.discovery.observe.closed_loop import calibrated_to_gap, simulated_error
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState, new_state
from rearl_jax.discovery.observe.noise import noise_levels, under_best_time, with_spread
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.starts import from_best_start
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import left_out_runs
from rearl_jax.discovery.report.protocols import PROTOCOL_MEASURES, protocol_errors
from rearl_jax.discovery.search.decision import bounded_gains

MOST_FITTED, MOST_CHECKED = 40, 120
"""Largest numbers of drivers that models are calibrated to, and compared on; of more drivers, a random sample is used.
The second is larger because calibration takes most of the time, and more check drivers make the comparison more
precise.
"""

ONE_STEP = "one_step"
"""Value of the column `protocol` in rows with log-likelihoods, which predict one time step."""

LOG_LIKELIHOOD = "log_likelihood"


@dataclass(frozen=True)
class ModelPredictions:
    """Predictions of one model for the check drivers.

    Attributes:
        name: Name of the car-following model.
        log_likelihood: Log-likelihood of each driver with its own parameters integrated out [nats].
        errors: Measures of PROTOCOL_MEASURES by protocol, each an array over the drivers who could be tested. Protocols
            in which no driver could be tested are missing; empty if the model is significantly less likely than others.
    """

    name: str
    log_likelihood: Float[np.ndarray, " drivers"]
    errors: Mapping[str, Mapping[str, Float[np.ndarray, " _"]]] = field(default_factory=dict)


def compared_models(
    solvers: Sequence[Solver],
    fitted: Measured,
    checked: Measured,
    seed: int,
    progress: Callable[[int, int], None],
    *,
    lane_changes: bool,
) -> tuple[list[ModelPredictions], Base]:
    """Predictions of every model for the check drivers, and the calibrated first model, which is that of the key
    `driver`. Models are calibrated to `fitted` drivers, with the effects of lane changes if `lane_changes`; `progress`
    is called with the number of models done and of all models.
    """
    progress(0, len(solvers))
    base = base_of(solvers[0], fitted, lane_changes=lane_changes)
    fits, states, log_likelihoods = [], [], []
    for index, solver in enumerate(solvers):
        fit = base.fit if index == 0 else calibrated_alike(solver, fitted, base.fit)
        fits.append(fit)
        states.append(recalibrated(solver, checked, fit))
        log_likelihoods.append(states[-1].marginal())
        progress(index + 1, len(solvers))
    found, gains = [], gains_of(log_likelihoods, checked)
    for index, (solver, fit, state) in enumerate(zip(solvers, fits, states, strict=True)):
        is_simulated = index == 0 or not is_beaten(gains[index], gains, seed)
        errors = _errors_by_protocol(solver, fit, state) if is_simulated else {}
        found.append(ModelPredictions(solver.layout.prior.name, log_likelihoods[index], errors))
    return found, base


def gains_of(
    log_likelihoods: Sequence[Float[np.ndarray, " drivers"]], data: Measured
) -> list[Float[np.ndarray, " drivers"]]:
    """Log-likelihood of each driver under each model minus that under the first model, bounded as in `bounded_gains`
    [nats].
    """
    return [bounded_gains(of_model - log_likelihoods[0], data) for of_model in log_likelihoods]


def calibrated_alike(solver: Solver, data: Measured, fit: Fit) -> Fit:
    """Another car-following model, calibrated with the measurement noise and the weights of innovations of a given fit.

    All other parameters are estimated again; those of the effects of lane changes start at the values of that fit.
    """
    state = new_state(data, solver.layout, fit.noise)
    state.theta, state.active = fit.state.theta.copy(), fit.state.active
    state = from_best_start(solver, state, iterations=10)
    state, noise = under_best_time(solver, state, noise_levels(fit.noise))
    return Fit(candidate=None, state=with_spread(solver, state), noise=noise)


def _errors_by_protocol(solver: Solver, fit: Fit, state: FitState) -> dict[str, dict[str, Float[np.ndarray, " _"]]]:
    """Errors of drivers in every protocol in which at least one driver can be tested."""
    in_sample = simulated_error(solver, calibrated_to_gap(solver, state))
    found = protocol_errors(solver, state, fit, in_sample, left_out_runs(state.data))
    return {name: dict(errors.by_driver) for name, errors in found.items() if errors is not None}


def compared_table(found: Sequence[ModelPredictions]) -> pd.DataFrame:
    """Every measure of every checked driver by model and protocol."""
    parts = []
    for predictions in found:
        measures = {ONE_STEP: {LOG_LIKELIHOOD: predictions.log_likelihood}, **predictions.errors}
        for protocol, by_driver in measures.items():
            part = pd.DataFrame({name: by_driver.get(name, np.nan) for name in (LOG_LIKELIHOOD, *PROTOCOL_MEASURES)})
            part.insert(0, "driver", np.arange(len(part)))
            part.insert(0, "protocol", protocol)
            part.insert(0, "model", predictions.name)
            parts.append(part)
    return pd.concat(parts, ignore_index=True)


def read_compared(path: Path) -> list[ModelPredictions]:
    """Predictions stored by an interrupted run."""
    found = []
    for name, rows in pd.read_parquet(path).groupby("model", sort=False):
        by_protocol = {str(protocol): part for protocol, part in rows.groupby("protocol", sort=False)}
        log_likelihood = by_protocol.pop(ONE_STEP)[LOG_LIKELIHOOD].to_numpy(float)
        errors = {
            protocol: {measure: part[measure].to_numpy(float) for measure in PROTOCOL_MEASURES}
            for protocol, part in by_protocol.items()
        }
        found.append(ModelPredictions(str(name), log_likelihood, errors))
    return found
