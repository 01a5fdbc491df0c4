"""Probability that an opportunity to change lanes is taken: a logit in the own gain, and a score test of further
columns.

Source: discrete choice of lanes, Ahmed, thesis, MIT (1999), ch. 3; Toledo, Koutsopoulos & Ben-Akiva, Transp. Res. Rec.
1857 (2003) 30. Score test: Rao, Proc. Camb. Phil. Soc. 44 (1948) 50; variance by drivers, whose decisions are not
independent: Liang & Zeger, Biometrika 73 (1986) 13.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

RIDGE = 1e-3
"""Precision of a weak prior of every coefficient [-], so that a fit stays finite if a column has no information."""

LEAST_UNEXPLAINED = 1e-4
"""Smallest share of a column's information that the other columns do not explain [-]; below it the column counts as a
combination of them.
"""

NEWTON_STEPS = 40
"""Maximum number of Newton steps."""

KNOT_SHARES = (0.25, 0.5, 0.75, 0.9)
"""Quantiles of the gain among taken opportunities at which the slope of the log-odds may change."""


@dataclass(frozen=True)
class Logit:
    """A fitted logit: coefficients of the columns [log-odds per unit], and their covariance, by the scatter between
    drivers.
    """

    coefficients: Float[np.ndarray, " columns"]
    covariance: Float[np.ndarray, "columns columns"]

    def chance(self, columns: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, " rows"]:
        """Probability that each opportunity is taken [-]."""
        return _chance(columns, self.coefficients)

    def log_likelihood(
        self, columns: Float[np.ndarray, "rows columns"], taken: Bool[np.ndarray, " rows"]
    ) -> Float[np.ndarray, " rows"]:
        """Log-likelihood of every opportunity [nats]."""
        log_odds = columns @ self.coefficients
        return taken * log_odds - np.logaddexp(0.0, log_odds)


def knots(gain: Float[np.ndarray, " rows"], taken: Bool[np.ndarray, " rows"]) -> Float[np.ndarray, " knots"]:
    """Gains at which the slope of the log-odds may change [m/s^2]."""
    return np.quantile(gain[taken], KNOT_SHARES)


def baseline(gain: Float[np.ndarray, " rows"], bends: Float[np.ndarray, " knots"]) -> Float[np.ndarray, "rows columns"]:
    """Columns of a constant and of a piecewise linear function of the own gain [m/s^2], with knots `bends`."""
    return np.column_stack([np.ones(len(gain)), gain, *(np.maximum(gain - bend, 0.0) for bend in bends)])


def fit(
    columns: Float[np.ndarray, "rows columns"],
    taken: Bool[np.ndarray, " rows"],
    driver: Int[np.ndarray, " rows"],
    start: Float[np.ndarray, " columns"] | None = None,
) -> Logit:
    """Maximum-likelihood logit, by Newton's method; a step that lowers the likelihood is halved.

    Args:
        columns: Explanatory columns.
        taken: Whether each opportunity was taken.
        driver: Driver of each opportunity, numbered from 0.
        start: Coefficients at which the search begins; None for zeros.
    """
    size = columns.shape[1]
    beta = np.zeros(size) if start is None else start

    def objective(coefficients: np.ndarray) -> float:
        log_odds = columns @ coefficients
        return float((taken * log_odds - np.logaddexp(0.0, log_odds)).sum() - 0.5 * RIDGE * coefficients @ coefficients)

    best = objective(beta)
    for _ in range(NEWTON_STEPS):
        gradient, information = _derivatives(columns, taken, beta)
        step = np.linalg.solve(information, gradient)
        while (new := objective(beta + step)) < best and np.abs(step).max() > 1e-9:
            step = step / 2
        beta, gain, best = beta + step, new - best, new
        if gain < 1e-8:
            break
    _, information = _derivatives(columns, taken, beta)
    scores = _by_driver(columns * (taken - _chance(columns, beta))[:, None], driver)
    inverse = np.linalg.inv(information)
    n_informative = max(int((np.abs(scores).sum(axis=1) > 0).sum()), 2)  # drivers
    return Logit(beta, inverse @ (scores.T @ scores * n_informative / (n_informative - 1)) @ inverse)


def score_test(
    coefficients: Float[np.ndarray, " columns"],
    columns: Float[np.ndarray, "rows columns"],
    taken: Bool[np.ndarray, " rows"],
    driver: Int[np.ndarray, " rows"],
    extra: Float[np.ndarray, " rows"],
) -> float:
    """Score test: slope of the likelihood along a column outside the model, in standard deviations between drivers [-].

    It is positive if changes become more frequent as the column grows.

    Args:
        coefficients: Maximum-likelihood coefficients of `columns`.
        columns, taken, driver: As of `fit`.
        extra: The column outside the model.
    """
    chance = _chance(columns, coefficients)
    weight = chance * (1.0 - chance)
    weighted = columns * weight[:, None]
    # The part of the column that the model's columns explain is projected out.
    projection = np.linalg.solve(columns.T @ weighted + RIDGE * np.eye(columns.shape[1]), weighted.T @ extra)
    unexplained = extra - columns @ projection
    scores = _by_driver((unexplained * (taken - chance))[:, None], driver)[:, 0]
    spread = float(np.sqrt((scores**2).sum()))
    information = float((weight * unexplained * extra).sum())
    if spread <= 0.0 or information <= LEAST_UNEXPLAINED * float((weight * extra**2).sum()):
        return 0.0  # the column is a combination of the model's columns, or there were no opportunities
    return float(scores.sum()) / spread


def _chance(columns: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Probability that each opportunity is taken [-]; `beta` are coefficients of the columns."""
    return 1.0 / (1.0 + np.exp(-np.clip(columns @ beta, -50.0, 50.0)))


def _derivatives(columns: np.ndarray, taken: np.ndarray, beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and information (negative second derivatives) of the penalised log-likelihood."""
    chance = _chance(columns, beta)
    weight = chance * (1.0 - chance)
    information = columns.T @ (columns * weight[:, None]) + RIDGE * np.eye(len(beta))
    return columns.T @ (taken - chance) - RIDGE * beta, information


def _by_driver(values: np.ndarray, driver: np.ndarray) -> np.ndarray:
    """Sums of each column over the drivers' rows."""
    n = int(driver.max()) + 1 if len(driver) else 0
    return np.stack([np.bincount(driver, column, n) for column in values.T], axis=1)
