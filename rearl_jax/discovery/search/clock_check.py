"""Detection of clock offsets between vehicles, and correction of the data.

Clock offsets are compared with independent shifts of every leader-follower pair, as other faults cause them. Shifts
are estimated in a few iterations, because offsets of half a second are too large for a linear estimate. The gain of
each explanation is that of the data that it corrects over the data as measured.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks, Estimate, Pairs, Shifts
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
    """Clock offsets found in the fitted drivers and checked in the others.

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
    """Drivers with corrected leader positions.

    Attributes:
        data: The drivers.
        estimate: The corrected shifts.
        gain: Gain against the uncorrected data, less the complexity penalty [nats].
    """

    data: Measured
    estimate: Estimate
    gain: float


def check_clocks(solver: Solver, base: Fit, checked: Measured) -> ClockCheck | None:
    """Clock offsets that fitted and check drivers support, and not less than independent shifts of pairs; else None."""
    parts = (base.state.data, checked)
    fitted, others = (correct_shifts(solver, Clocks(part), base) for part in parts)
    gain = fitted.gain - THRESHOLDS.freedom_price
    if (
        gain < THRESHOLDS.least_gain
        or gain + others.gain < THRESHOLDS.least_total
        or others.gain < THRESHOLDS.worst_check
    ):
        return None
    by_pairs = sum(correct_shifts(solver, Pairs(part), base).gain for part in parts)
    if fitted.gain + others.gain < by_pairs + THRESHOLDS.clock_lead:
        return None
    return ClockCheck(base, gain, others.gain, float(np.std(fitted.estimate.values)), fitted.data, others.data)


def correct_shifts(solver: Solver, shifts: Shifts, base: Fit) -> ShiftCorrection:
    """The data corrected by a model of shifts, under the calibrated model; the best of all iterations."""
    (state,) = recalibrated(solver, shifts.data, [base])
    before, values, best = state.penalised(), shifts.values, None
    for _ in range(ITERATIONS):
        seen = scores(solver, [state])[0][CLOCK_OFFSET]
        estimate = shifts.estimate(values, seen.driver_score, seen.driver_information)
        values, data = estimate.values, shifts.corrected(estimate.values)
        (state,) = recalibrated(solver, data, [base])
        corrected = ShiftCorrection(
            data, estimate, float(bounded_gains(state.penalised() - before, data).sum()) - estimate.cost
        )
        best = corrected if best is None or corrected.gain > best.gain else best
    assert best is not None
    return best
