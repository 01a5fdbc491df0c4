"""Protocols of the field: what is known of a driver before its drive is predicted.

Every error is that of a simulation behind the measured leader. What differs is where a driver's own parameters come
from: the population, the first half of its drive, its other runs, or the drive itself, which predicts nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.closed_loop import simulated_error
from rearl_jax.discovery.observe.fit import Fit, on_others
from rearl_jax.discovery.observe.fit_state import FitState, copied
from rearl_jax.discovery.observe.observer import pieces_of
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import Split, error_of_splits, halves, seen_enough

IN_SAMPLE = "in_sample"

PROTOCOLS = {
    "population": "parameters of the population, other drivers",
    "first_half": "own parameters from the first half of a drive, the second half",
    "other_runs": "own parameters from the driver's other runs, the run left out",
    IN_SAMPLE: "own parameters calibrated to the drive itself",
}
"""Where a driver's own parameters come from, and what is simulated with them."""

SMALLEST_GAP = 0.1
"""Least root mean square gap that an error is compared with [m]: drivers who are not tested have none."""

PROTOCOL_MEASURES = ("gap_rmse", "gap_nrmse", "speed_rmse")
"""Root mean square error of the gap [m], the same over the root mean square gap [-], and of the speed [m/s]."""


@dataclass(frozen=True)
class ProtocolErrors:
    """Errors of one model under one protocol.

    Attributes:
        driver: Whose: the place among the drivers reported on, or among those with several runs.
        by_driver: Each of PROTOCOL_MEASURES of each of them.
        usual: The same of the same drives with the parameters of the population.
        left_out: Drivers of whom too little was seen.
    """

    driver: Int[np.ndarray, " drivers"]
    by_driver: dict[str, Float[np.ndarray, " drivers"]]
    usual: dict[str, Float[np.ndarray, " drivers"]]
    left_out: int


Deviation = Float[np.ndarray, "steps pieces"]
"""Measured less simulated positions [m]."""


def protocol_errors(
    solver: Solver, state: FitState, fit: Fit, in_sample: Deviation, runs: Sequence[Split] = ()
) -> dict[str, ProtocolErrors | None]:
    """Errors under every protocol, by name; None where nobody can be tested.

    Args:
        solver: Of the model.
        state: The drivers reported on, under the model.
        fit: The model.
        in_sample: Deviations with parameters calibrated to each drive.
        runs: Splits of drivers with several runs, see `left_out_runs`.
    """
    data = state.data
    whole, everybody = [Split(data, data)], np.arange(data.n_drivers)
    usual = measures_of(whole, [_with_usual_drivers(solver, state)])
    return {
        "population": ProtocolErrors(everybody, usual, usual, 0),
        "first_half": _predicted(solver, [halves(data)], fit),
        "other_runs": _predicted(solver, runs, fit),
        IN_SAMPLE: ProtocolErrors(everybody, measures_of(whole, [in_sample]), usual, 0),
    }


def _predicted(solver: Solver, splits: Sequence[Split], fit: Fit) -> ProtocolErrors | None:
    """Errors in the tests with parameters from the training: the driver's likelihood there and its population."""
    if not splits or not seen_enough(splits).any():
        return None
    used = np.flatnonzero(seen_enough(splits))
    own, usual = [], []
    for split in splits:
        (trained,) = on_others(solver, split.training, [fit])
        tested = copied(trained, data=split.test, pieces=pieces_of(split.test, fit.noise))
        own.append(simulated_error(solver, tested))
        usual.append(_with_usual_drivers(solver, tested))
    by_driver, of_usual = (
        {name: values[used] for name, values in measures_of(splits, deviations).items()} for deviations in (own, usual)
    )
    return ProtocolErrors(used, by_driver, of_usual, splits[0].test.n_drivers - len(used))


def _with_usual_drivers(solver: Solver, state: FitState) -> Deviation:
    """Deviations where everybody has the parameters of the population."""
    return simulated_error(solver, copied(state, z=state.mean[state.truck]))


def measures_of(splits: Sequence[Split], deviations: Sequence[Deviation]) -> dict[str, Float[np.ndarray, " drivers"]]:
    """Each of PROTOCOL_MEASURES of each driver, over the time steps that count in the tests."""
    gaps = [gap_of(split.test) for split in splits]
    speeds = [speed_deviation(one, split.test) for one, split in zip(deviations, splits, strict=True)]
    rmse, size, speed = (error_of_splits(splits, values) for values in (deviations, gaps, speeds))
    return {"gap_rmse": rmse, "gap_nrmse": rmse / np.maximum(size, SMALLEST_GAP), "speed_rmse": speed}


def gap_of(data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Measured gaps [m]."""
    return data.around.leader_rear - (data.smooth + data.length / 2)


def speed_deviation(deviation: Deviation, data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Measured less simulated speeds [m/s], from measured less simulated positions [m]."""
    ahead = deviation - (data.y - data.smooth)
    # Backward: what comes after the last time step of a piece is padding, in which nobody drives.
    return np.diff(ahead, axis=0, prepend=ahead[:1]) / data.dt
