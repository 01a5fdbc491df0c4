"""Closed-loop simulation: drivers are simulated behind their measured leaders, without correction; and its errors."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.fit_state import FitState, replace_gain, replaced
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP
from rearl_jax.discovery.observe.solver import Solver

FARTHEST = 60.0
"""Bound of a position error [m]; beyond it the simulation has lost its leader and larger errors carry no information.
"""

TYPICAL_ERROR = 1.0
"""Standard deviation of gap errors [m] that is assumed when a driver is calibrated to the gap: the smaller it is, the
less the parameters are shrunk to the population mean.
"""


def gap_errors(solver: Solver, states: Sequence[FitState]) -> list[Float[np.ndarray, " drivers"]]:
    """Closed-loop gap error of each driver [m] under solved models, with own parameters calibrated to the gap."""
    calibrated = [calibrated_to_gap(solver, state) for state in states]
    return [np.sqrt(state.data.driver_mean(simulated_error(solver, state) ** 2)) for state in calibrated]


def simulated_error(solver: Solver, state: FitState) -> Float[np.ndarray, "steps pieces"]:
    """Measured minus simulated positions [m].

    Raises:
        FloatingPointError: The simulation of a driver is not finite.
    """
    error = solver.innovations([state], CLOSED_LOOP)[0]
    if not np.isfinite(error).all():
        lost = sorted({int(driver) for driver in state.data.driver[~np.isfinite(error).all(axis=0)]})
        raise FloatingPointError(
            f"{solver.layout.prior.name} simulates no position for the drivers {lost[:5]}: their parameters are "
            f"{state.z[lost[0]].round(2).tolist()} standard deviations from the median driver"
        )
    return np.clip(error, -FARTHEST, FARTHEST)


def calibrated_to_gap(solver: Solver, state: FitState) -> FitState:
    """State of the drivers with the own parameters that minimise the simulated gap error."""
    start = replaced(state, pieces=replace_gain(state.pieces, CLOSED_LOOP), variance=TYPICAL_ERROR**2, freedom=np.inf)
    solver.solve([start], iterations=20, tolerance=0.1)
    return start
