"""Calibration protocols of the literature: which data a driver's parameters come from when its drive is simulated.

Every error compares a simulation behind the measured leader with the measurement. A driver's parameters come from the
population, from the first half of the drive, from the driver's other runs, or from the drive itself. The last case is
not a prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.closed_loop import simulated_error
from rearl_jax.discovery.observe.fit import Fit, known_drivers
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import Split, error_of_splits, halves, has_enough_data
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP, TimeGapVariation

FIRST_HALF, IN_SAMPLE = "first_half", "in_sample"
"""Names of the protocols with parameters from the first half of a drive, and from the drive itself."""

PROTOCOLS = {
    "population": "parameters of the population of other drivers",
    FIRST_HALF: "own parameters from the first half of a drive, simulation of the second half",
    "other_runs": "own parameters from the driver's other runs, simulation of the run left out",
    IN_SAMPLE: "own parameters calibrated to the drive itself",
}
"""Source of a driver's parameters, and the simulated drive if it is another, by protocol."""

PREDICTING = tuple(name for name in PROTOCOLS if name != IN_SAMPLE)
"""Protocols that predict."""

SMALLEST_GAP = 0.1
"""Smallest divisor of relative gap errors [m]; it avoids division by zero for drivers who are not tested."""

PROTOCOL_MEASURES = ("gap_rmse", "gap_nrmse", "speed_rmse")
"""Root mean square error of the gap [m], the same over the root mean square gap [-], and of the speed [m/s]."""


@dataclass(frozen=True)
class ProtocolErrors:
    """Errors of one model under one protocol.

    Attributes:
        driver: Index of each tested driver among the report drivers; under `other_runs` among those with several runs.
        by_driver: Values of the PROTOCOL_MEASURES of each tested driver.
        population: Values of the same measures on the same drives with population parameters.
        left_out: Number of drivers with too little data.
    """

    driver: Int[np.ndarray, " drivers"]
    by_driver: dict[str, Float[np.ndarray, " drivers"]]
    population: dict[str, Float[np.ndarray, " drivers"]]
    left_out: int


Deviation = Float[np.ndarray, "steps pieces"]
"""Measured minus simulated positions [m]."""


def protocol_errors(
    solver: Solver,
    state: FitState,
    fit: Fit,
    in_sample: Deviation,
    runs: Sequence[Split] = (),
    variation: TimeGapVariation = CONSTANT_TIME_GAP,
) -> dict[str, ProtocolErrors | None]:
    """Errors under every protocol, by name; None if no driver can be tested. `in_sample` are the deviations with
    parameters calibrated to each drive; other arguments as of `prediction_errors`.
    """
    predicted, whole = prediction_errors(solver, state, fit, runs, variation), [Split(state.data, state.data)]
    population = predicted["population"]
    assert population is not None
    own = ProtocolErrors(population.driver, measures_of(whole, [in_sample]), population.population, 0)
    return predicted | {IN_SAMPLE: own}


def prediction_errors(
    solver: Solver,
    state: FitState,
    fit: Fit,
    runs: Sequence[Split] = (),
    variation: TimeGapVariation = CONSTANT_TIME_GAP,
) -> dict[str, ProtocolErrors | None]:
    """Errors of a fitted model under the protocols that predict, by name: all but IN_SAMPLE; None if no driver can be
    tested. `state` is that of the report drivers under the model.

    `runs` are the splits of drivers with several runs, see `left_out_runs`. Of the variation of the time gap, the part
    that follows from the gap at the start of a drive is predicted.
    """
    data = state.data
    whole, all_drivers = [Split(data, data)], np.arange(data.n_drivers)
    average = replaced(state, z=state.mean[state.truck])
    population = measures_of(whole, [simulated_error(solver, average)])
    varied = _varied(average, variation.expected_of_unknown(average, solver.layout.prior))
    predicted = population if varied is average else measures_of(whole, [simulated_error(solver, varied)])
    return {
        "population": ProtocolErrors(all_drivers, predicted, population, 0),
        FIRST_HALF: first_half_errors(solver, data, fit, variation),
        "other_runs": _predicted(solver, runs, fit, variation),
    }


def first_half_errors(
    solver: Solver, data: Measured, fit: Fit, variation: TimeGapVariation = CONSTANT_TIME_GAP
) -> ProtocolErrors | None:
    """Errors of a fitted model under FIRST_HALF, for drivers to whom it was not fitted; None if none can be tested."""
    return _predicted(solver, [halves(data)], fit, variation)


def _predicted(solver: Solver, splits: Sequence[Split], fit: Fit, variation: TimeGapVariation) -> ProtocolErrors | None:
    """Errors on the test drives, with each driver's parameters from its training drives and from the population; None
    if no driver has enough data.
    """
    if not splits or not has_enough_data(splits).any():
        return None
    tested_drivers = np.flatnonzero(has_enough_data(splits))
    own, population = [], []
    for split in splits:
        tested = known_drivers(solver, split, fit)
        own.append(simulated_error(solver, _varied(tested, variation.expected(tested, solver.layout.prior))))
        population.append(simulated_error(solver, replaced(tested, z=tested.mean[tested.truck])))
    by_driver, with_population = (
        {name: values[tested_drivers] for name, values in measures_of(splits, deviations).items()}
        for deviations in (own, population)
    )
    left_out = splits[0].test.n_drivers - len(tested_drivers)
    return ProtocolErrors(tested_drivers, by_driver, with_population, left_out)


def _varied(state: FitState, log_change: Float[np.ndarray, "steps pieces"] | None) -> FitState:
    """The drivers with the logarithm of their time gap changed by `log_change` [-]; unchanged for None."""
    return state if log_change is None else replaced(state, pieces=replace(state.pieces, varied=log_change))


def measures_of(splits: Sequence[Split], deviations: Sequence[Deviation]) -> dict[str, Float[np.ndarray, " drivers"]]:
    """The PROTOCOL_MEASURES of each driver, over the time steps of the test drives that count; `deviations` belong to
    the splits, in order.
    """
    gaps = [split.test.gap for split in splits]
    speeds = [speed_deviation(deviation, split.test) for deviation, split in zip(deviations, splits, strict=True)]
    gap_rmse, gap_rms, speed_rmse = (error_of_splits(splits, values) for values in (deviations, gaps, speeds))
    gap_nrmse = gap_rmse / np.maximum(gap_rms, SMALLEST_GAP)
    return {"gap_rmse": gap_rmse, "gap_nrmse": gap_nrmse, "speed_rmse": speed_rmse}


def speed_deviation(deviation: Deviation, data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Measured minus simulated speeds [m/s], from measured minus simulated positions [m]."""
    ahead = deviation - (data.y - data.smooth)  # smoothed measurement minus simulation
    # Backward difference, because the values after the last time step of a piece are padding.
    return np.diff(ahead, axis=0, prepend=ahead[:1]) / data.dt
