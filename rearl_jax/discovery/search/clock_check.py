"""Clocks that differ between vehicles, and the data with the clocks put right.

Clocks are held against shifts of every pair of vehicles, each account at its best: shifts are found in a few looks, for
half a second is far from small, and what each account gains is counted from the data as it puts them right.
"""

from dataclasses import dataclass

import numpy as np

from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks, Estimate, Pairs, Shifts
from rearl_jax.discovery.observe.fit import Fit, on_others
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import bounded_gains
from rearl_jax.discovery.search.screen import scores
from rearl_jax.discovery.thresholds import THRESHOLDS

LOOKS = 3
"""Times that shifts are looked at and put right."""


@dataclass(frozen=True)
class ClockCheck:
    """Clocks that differ, found in the fitted drivers and checked in the others.

    Attributes:
        base: The calibrated model on the data as they were.
        gain, check: Of both, what freedom costs paid [nats].
        spread: Standard deviation of the offsets [s].
        fitted, checked: The drivers with their clocks put right.
    """

    base: Fit
    gain: float
    check: float
    spread: float
    fitted: Measured
    checked: Measured

    @property
    def total(self) -> float:
        """Total that it is compared by [nats]."""
        return self.gain + self.check


@dataclass(frozen=True)
class PutRight:
    """Drivers whose leaders have been shifted back.

    Attributes:
        data: The drivers.
        estimate: By how much.
        gain: Against the data as they were, what freedom costs paid [nats].
    """

    data: Measured
    estimate: Estimate
    gain: float


def check_clocks(solver: Solver, base: Fit, checked: Measured) -> ClockCheck | None:
    """Clocks that differ, by the fitted drivers and by the others; None if they do not."""
    parts = (base.state.data, checked)
    fitted, others = (put_right(solver, Clocks(part), base) for part in parts)
    gain = fitted.gain - THRESHOLDS.freedom_price
    if (
        gain < THRESHOLDS.least_gain
        or gain + others.gain < THRESHOLDS.least_total
        or others.gain < THRESHOLDS.worst_check
    ):
        return None
    by_pairs = sum(put_right(solver, Pairs(part), base).gain for part in parts)
    if fitted.gain + others.gain < by_pairs + THRESHOLDS.clock_lead:
        return None
    return ClockCheck(base, gain, others.gain, float(np.std(fitted.estimate.values)), fitted.data, others.data)


def put_right(solver: Solver, shifts: Shifts, base: Fit) -> PutRight:
    """The data as an account of shifts puts them right, under the calibrated model; of all looks the best one."""
    (state,) = on_others(solver, shifts.data, [base])
    before, values, best = state.penalised(), shifts.values, None
    for _ in range(LOOKS):
        seen = scores(solver, [state])[0][CLOCK_OFFSET]
        estimate = shifts.estimate(values, seen.driver_score, seen.driver_information)
        values, data = estimate.values, shifts.corrected(estimate.values)
        (state,) = on_others(solver, data, [base])
        corrected = PutRight(
            data, estimate, float(bounded_gains(state.penalised() - before, data).sum()) - estimate.cost
        )
        best = corrected if best is None or corrected.gain > best.gain else best
    assert best is not None
    return best
