"""Errors of models on the report drivers, with the floor from the drivers' own noise.

Only the drivers' own parameters are calibrated; everything else is kept as fitted to other drivers. The model is then
simulated behind the measured leader, without correction. The main error uses parameters calibrated to each drive
(`protocols.IN_SAMPLE`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.closed_loop import FARTHEST, calibrated_to_gap, simulated_error
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.response_time import Responses, responses
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import left_out_runs
from rearl_jax.discovery.report.protocols import IN_SAMPLE, ProtocolErrors, protocol_errors
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP, TimeGapVariation, energy_scores
from rearl_jax.discovery.search.simulated_drives import behind_noisy_drive, position_errors

FLOOR_RUNS = 4
"""Realisations of the drivers' noise for the floor, the error that remains if the model is correct."""

MOST_SQUARE = 2.0
"""Bound of the squared error of one realisation as a multiple of the median one, because noise alone sometimes drives a
vehicle into its leader, where no model is valid.
"""

MEASURES = (
    "gap_rmse",
    "gap_nrmse",
    "speed_rmse",
    "gap_rmse_uncalibrated",
    "one_step",
    "energy_score",
    "log_likelihood",
)
"""Measures of each driver, in this order. With parameters calibrated to the gap, as is common: closed-loop gap error
[m], the same over the root mean square gap [-], speed error [m/s]. With the parameters of the best one-step prediction:
closed-loop gap error [m], error in predicting the next position [m], energy score of noisy simulations [m],
log-likelihood [nats].
"""


@dataclass(frozen=True)
class ModelErrors:
    """Errors of one model, driver by driver.

    Attributes:
        by_driver: Each measure of each driver.
        floor: Closed-loop gap error from the drivers' own noise alone [m], by driver; larger than the error itself if
            the acceleration residual is not the assumed noise.
        protocols: Errors under each protocol, see `protocols`.
        responses: Response times of the drivers; None if the errors of several models are joined or were read from a
            table.
    """

    by_driver: dict[str, Float[np.ndarray, " drivers"]]
    floor: Float[np.ndarray, " drivers"]
    protocols: dict[str, ProtocolErrors | None]
    responses: Responses | None


def model_errors(
    solver: Solver, data: Measured, fit: Fit, seed: int, variation: TimeGapVariation = CONSTANT_TIME_GAP
) -> ModelErrors:
    """Errors of a fitted model on the report drivers. The seed of the noise must be the same for all models that are
    compared; `variation` is that of the time gap in predictions, see `protocol_errors`.
    """
    state = recalibrated(solver, data, fit)
    calibrated = calibrated_to_gap(solver, state)
    in_sample_error, uncalibrated_error = (simulated_error(solver, each) for each in (calibrated, state))
    protocols = protocol_errors(solver, state, fit, in_sample_error, left_out_runs(data), variation)
    in_sample = protocols[IN_SAMPLE]
    assert in_sample is not None
    (innovation,) = solver.innovations([state])
    mean = data.driver_mean
    measures = {
        "gap_rmse_uncalibrated": np.sqrt(mean(uncalibrated_error**2)),
        "one_step": np.sqrt(mean(innovation**2)),
        "energy_score": energy_scores(solver, state, fit, seed),
        "log_likelihood": state.penalised(),
    }
    floor = _floor(solver, state, calibrated, fit, seed)
    return ModelErrors(in_sample.by_driver | measures, floor, protocols, responses(solver, state))


def _floor(solver: Solver, state: FitState, calibrated: FitState, fit: Fit, seed: int) -> Float[np.ndarray, " drivers"]:
    """Gap error [m] of each driver that remains if the model is correct: drives simulated with the model and the noise
    level of the driver's innovations are calibrated in the same way as measured ones.
    """
    data, squares = state.data, []
    rng = np.random.default_rng([seed, 1])
    # The innovations of `state` give the noise level; the parameters calibrated to the gap generate the drives.
    expected = float(fit.noise.gain(data.dt, data.stride).variance)
    noisy = replace(state, z=calibrated.z, variance=expected)
    for _ in range(FLOOR_RUNS):
        behind = behind_noisy_drive(solver, noisy, fit.noise, rng)
        positions = data.y - np.clip(behind, -FARTHEST, FARTHEST)
        positions = positions + position_errors(fit.noise, positions.shape, data.dt, rng)
        recalibrated_state = replaced(calibrated, pieces=replace(calibrated.pieces, y=positions))
        solver.solve([recalibrated_state], iterations=20, tolerance=0.1)
        squares.append(data.driver_mean(simulated_error(solver, recalibrated_state) ** 2))
    return np.sqrt(np.minimum(squares, MOST_SQUARE * np.median(squares, axis=0)).mean(axis=0))
