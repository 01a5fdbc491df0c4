"""Detection of clock offsets between vehicles, and correction of the data.

One clock offset per vehicle is compared with one independent time shift per leader-follower pair, which other faults
cause. Both are estimated in a few iterations, because offsets of half a second are too large for a linear estimate. The
gain of each explanation is that of the data it corrects over the data as measured.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks, Pairs, ShiftEstimate, Shifts
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import bounded_gains
from rearl_jax.discovery.search.screen import scores
from rearl_jax.discovery.thresholds import THRESHOLDS

ITERATIONS = 3
"""Iterations of estimating and correcting shifts."""


@dataclass(frozen=True)
class ClockCheck:
    """Clock offsets of the fitted drivers, estimated for the check drivers as well.

    Attributes:
        base: The calibrated model on the uncorrected data.
        gain, check: Gains of the fitted and the check drivers, less the complexity penalty [nats].
        spread: Standard deviation of the offsets [s].
        fitted, checked: The drivers with corrected clocks.
    """

    base: Fit
    gain: float
    check: float
    spread: float
    fitted: Measured
    checked: Measured

    @property
    def total(self) -> float:
        """Total gain, for comparison with other candidates [nats]."""
        return self.gain + self.check


@dataclass(frozen=True)
class ShiftCorrection:
    """Drivers with corrected leader positions, the corrected shifts, and the gain against the uncorrected data, less
    the complexity penalty [nats].
    """

    data: Measured
    estimate: ShiftEstimate
    gain: float


def check_clocks(solver: Solver, base: Fit, checked: Measured) -> ClockCheck | None:
    """Clock offsets if fitted and check drivers support them, and hardly less than shifts of pairs; else None."""
    parts = (base.state.data, checked)
    fitted, of_check = (correct_shifts(solver, Clocks(part), base) for part in parts)
    gain = fitted.gain - THRESHOLDS.freedom_price
    if (
        gain < THRESHOLDS.least_gain
        or gain + of_check.gain < THRESHOLDS.least_total
        or of_check.gain < THRESHOLDS.worst_check
    ):
        return None
    gain_by_pairs = sum(correct_shifts(solver, Pairs(part), base).gain for part in parts)
    if fitted.gain + of_check.gain < gain_by_pairs + THRESHOLDS.clock_lead:
        return None
    return ClockCheck(base, gain, of_check.gain, float(np.std(fitted.estimate.values)), fitted.data, of_check.data)


def correct_shifts(solver: Solver, shifts: Shifts, base: Fit) -> ShiftCorrection:
    """The data of `shifts`, corrected by these shifts under the calibrated model `base`; the best of all iterations."""
    state = recalibrated(solver, shifts.data, base)
    uncorrected, values, best = state.penalised(), shifts.values, None
    for _ in range(ITERATIONS):
        score = scores(solver, [state])[0][CLOCK_OFFSET]
        estimate = shifts.estimate(values, score.driver_score, score.driver_information)
        values, data = estimate.values, shifts.corrected(estimate.values)
        state = recalibrated(solver, data, base)
        gain = float(bounded_gains(state.penalised() - uncorrected, data).sum()) - estimate.cost
        corrected = ShiftCorrection(data, estimate, gain)
        best = corrected if best is None or corrected.gain > best.gain else best
    assert best is not None
    return best
