"""Calibration protocols of the literature: which data a driver's parameters come from when its drive is simulated.

Every error compares a simulation behind the measured leader with the measurement. Own parameters come from the
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

IN_SAMPLE = "in_sample"

PROTOCOLS = {
    "population": "parameters of the population, other drivers",
    "first_half": "own parameters from the first half of a drive, the second half",
    "other_runs": "own parameters from the driver's other runs, the run left out",
    IN_SAMPLE: "own parameters calibrated to the drive itself",
}
"""Source of a driver's parameters and simulated drive, by protocol."""

PREDICTING = tuple(name for name in PROTOCOLS if name != IN_SAMPLE)
"""Protocols that predict."""

SMALLEST_GAP = 0.1
"""Smallest divisor of relative errors [m]; it avoids division by zero for drivers who are not tested."""

PROTOCOL_MEASURES = ("gap_rmse", "gap_nrmse", "speed_rmse")
"""Root mean square error of the gap [m], the same over the root mean square gap [-], and of the speed [m/s]."""


@dataclass(frozen=True)
class ProtocolErrors:
    """Errors of one model under one protocol.

    Attributes:
        driver: Index of each tested driver among the report drivers, or among the drivers with several runs.
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
    """Errors under every protocol, by name; None if no driver can be tested.

    Args:
        solver: Solver of the model.
        state: State of the report drivers under the model.
        fit: The fitted model.
        in_sample: Deviations with parameters calibrated to each drive.
        runs: As of `prediction_errors`.
        variation: As of `prediction_errors`.
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
    """Errors under the protocols that predict, by name: all but IN_SAMPLE; None if no driver can be tested.

    Args:
        solver: Solver of the model.
        state: State of the report drivers under the model.
        fit: The fitted model.
        runs: Splits of drivers with several runs, see `left_out_runs`.
        variation: Variation of the time gap; predictions contain the part that follows from the gap at the start.
    """
    data = state.data
    whole, all_drivers = [Split(data, data)], np.arange(data.n_drivers)
    unknown = replaced(state, z=state.mean[state.truck])
    population = measures_of(whole, [simulated_error(solver, unknown)])
    started = _varied(unknown, variation.expected_of_unknown(unknown, solver.layout.prior))
    predicted = population if started is unknown else measures_of(whole, [simulated_error(solver, started)])
    return {
        "population": ProtocolErrors(all_drivers, predicted, population, 0),
        "first_half": _predicted(solver, [halves(data)], fit, variation),
        "other_runs": _predicted(solver, runs, fit, variation),
    }


def _predicted(solver: Solver, splits: Sequence[Split], fit: Fit, variation: TimeGapVariation) -> ProtocolErrors | None:
    """Errors in the tests with parameters estimated from the training drives and the population."""
    if not splits or not has_enough_data(splits).any():
        return None
    used = np.flatnonzero(has_enough_data(splits))
    own, population = [], []
    for split in splits:
        tested = known_drivers(solver, split, fit)
        own.append(simulated_error(solver, _varied(tested, variation.expected(tested, solver.layout.prior))))
        population.append(simulated_error(solver, replaced(tested, z=tested.mean[tested.truck])))
    by_driver, with_population = (
        {name: values[used] for name, values in measures_of(splits, deviations).items()}
        for deviations in (own, population)
    )
    return ProtocolErrors(used, by_driver, with_population, splits[0].test.n_drivers - len(used))


def _varied(state: FitState, varied: Float[np.ndarray, "steps pieces"] | None) -> FitState:
    """The drivers with the logarithm of their time gap changed by `varied`; unchanged for None."""
    return state if varied is None else replaced(state, pieces=replace(state.pieces, varied=varied))


def measures_of(splits: Sequence[Split], deviations: Sequence[Deviation]) -> dict[str, Float[np.ndarray, " drivers"]]:
    """The PROTOCOL_MEASURES of each driver, over the time steps that count in the tests."""
    gaps = [gap_of(split.test) for split in splits]
    speeds = [speed_deviation(deviation, split.test) for deviation, split in zip(deviations, splits, strict=True)]
    rmse, size, speed = (error_of_splits(splits, values) for values in (deviations, gaps, speeds))
    return {"gap_rmse": rmse, "gap_nrmse": rmse / np.maximum(size, SMALLEST_GAP), "speed_rmse": speed}


def gap_of(data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Measured gaps [m]."""
    return data.surroundings.leader_rear - (data.smooth + data.length / 2)


def speed_deviation(deviation: Deviation, data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Measured minus simulated speeds [m/s], from measured minus simulated positions [m]."""
    ahead = deviation - (data.y - data.smooth)
    # Backward difference, because the values after the last time step of a piece are padding.
    return np.diff(ahead, axis=0, prepend=ahead[:1]) / data.dt
