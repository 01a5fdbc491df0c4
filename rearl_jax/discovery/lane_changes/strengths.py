"""Lane-choice effects as part of the incentive of a change [m/s^2]: they act through the same log-odds curve as the own
gain.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.discovery.lane_changes.hazard import Logit, baseline, fit

ROUNDS = 25
"""Maximum number of iterations."""

CLOSE = 1e-3
"""Change of the strengths, times their columns' standard deviation, below which the search has converged [m/s^2]."""

LONGEST_STEP = 0.5
"""Bound of a step of a strength, times its column's standard deviation [m/s^2]."""

LEAST_SLOPE = 0.02
"""Smallest slope of the curve as a share of its largest [-]: probabilities level off but never fall as the gain grows.
"""


@dataclass(frozen=True)
class Choices:
    """Opportunities with their gains and outcomes.

    Attributes:
        gain: Own acceleration gained [m/s^2].
        others: Further columns of every model, which are not part of the incentive.
        taken: True where an opportunity was taken.
        driver: Driver of each opportunity, numbered from 0.
    """

    gain: Float[np.ndarray, " rows"]
    others: Float[np.ndarray, "rows others"]
    taken: Bool[np.ndarray, " rows"]
    driver: Int[np.ndarray, " rows"]

    def take(self, rows: Bool[np.ndarray, " rows"]) -> "Choices":
        """The opportunities of the given rows."""
        return Choices(self.gain[rows], self.others[rows], self.taken[rows], self.driver[rows])


@dataclass(frozen=True)
class IncentiveModel:
    """Log-odds: a piecewise linear function of `gain + effects @ strengths`, plus a linear term in other columns.

    Attributes:
        bends: Incentives at which the slope may change [m/s^2].
        strengths: Strengths of the effects, in m/s^2 per unit of their columns.
        covariance: Covariance of the strengths, by the scatter between drivers.
        line: Logit of the piecewise linear function and the other columns.
    """

    bends: Float[np.ndarray, " knots"]
    strengths: Float[np.ndarray, " effects"]
    covariance: Float[np.ndarray, "effects effects"]
    line: Logit

    def incentive(self, data: Choices, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, " rows"]:
        """Incentive of a change, effects included [m/s^2]."""
        return data.gain + effects @ self.strengths

    def columns(self, data: Choices, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, "rows columns"]:
        """Columns of `line`."""
        return np.column_stack([baseline(self.incentive(data, effects), self.bends), data.others])

    def chance(self, data: Choices, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, " rows"]:
        """Probability that each opportunity is taken [-]."""
        return self.line.chance(self.columns(data, effects))

    def log_likelihood(self, data: Choices, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, " rows"]:
        """Log-likelihood of every opportunity [nats]."""
        return self.line.log_likelihood(self.columns(data, effects), data.taken)

    def slope(self, data: Choices, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, " rows"]:
        """Slope of the curve at each opportunity's incentive [log-odds per m/s^2]."""
        first, *changes = self.line.coefficients[1 : 2 + len(self.bends)]  # below the first bend, and at each bend
        slopes = first + np.concatenate([[0.0], np.cumsum(changes)])
        slopes = np.maximum(slopes, LEAST_SLOPE * max(float(slopes.max()), 1e-6))
        return slopes[np.searchsorted(self.bends, self.incentive(data, effects))]


def fit_incentive(
    data: Choices, effects: Float[np.ndarray, "rows effects"], bends: Float[np.ndarray, " knots"]
) -> IncentiveModel:
    """Model with maximum-likelihood strengths, by iteration: each step linearises the curve, which gives a logit with
    the effects times the curve's slope as further columns. `effects` are columns in m/s^2 per unit of strength, `bends`
    the incentives at which the slope may change [m/s^2].
    """
    n = effects.shape[1]
    spread = np.maximum(effects.std(axis=0), 1e-6)

    def model_at(strengths: np.ndarray, covariance: np.ndarray, previous: IncentiveModel | None) -> IncentiveModel:
        start = None if previous is None else previous.line.coefficients
        columns = np.column_stack([baseline(data.gain + effects @ strengths, bends), data.others])
        return IncentiveModel(bends, strengths, covariance, fit(columns, data.taken, data.driver, start))

    model = model_at(np.zeros(n), np.zeros((n, n)), None)
    for _ in range(ROUNDS if n else 0):
        columns = model.columns(data, effects)
        wider = np.column_stack([columns, model.slope(data, effects)[:, None] * effects])
        start = np.concatenate([model.line.coefficients, np.zeros(n)])
        logit = fit(wider, data.taken, data.driver, start)
        step = np.clip(logit.coefficients[-n:], -LONGEST_STEP / spread, LONGEST_STEP / spread)
        model = model_at(model.strengths + step, logit.covariance[-n:, -n:], model)
        if (np.abs(step) * spread).max() < CLOSE:
            break
    return model
