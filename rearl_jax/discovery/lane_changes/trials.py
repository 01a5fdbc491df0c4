"""Trials of lane-choice candidates in addition to the effects already added.

Drivers are divided into parts 0, 1 and 2. Models fitted to part 0 are checked on part 1 and vice versa. Changes are
rare, so both parts together decide whether a candidate exceeds chance; part 2 is not used.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.stats import norm

from rearl_jax.discovery.lane_changes.candidates import CANDIDATES, Form, LaneCandidate, own_gain
from rearl_jax.discovery.lane_changes.hazard import knots, score_test
from rearl_jax.discovery.lane_changes.opportunities import Opportunities
from rearl_jax.discovery.lane_changes.strengths import Choices, IncentiveModel, fit_incentive
from rearl_jax.discovery.resampling import resamples
from rearl_jax.discovery.thresholds import THRESHOLDS

RESAMPLES = 1000
"""Resamples of drivers for the gain on held-out drivers."""

NAMEABLE = tuple(candidate for candidate in CANDIDATES if not candidate.is_circumstance)
"""Candidates that may be added."""

LEAST_Z_SCORE = float(norm.isf(THRESHOLDS.lane_false_rate / 2 / sum(len(candidate.forms) for candidate in NAMEABLE)))
"""Z-score that a column must exceed in the score test, by Bonferroni over all columns."""


@dataclass(frozen=True)
class Trial:
    """A candidate in its best form, tested in addition to the effects added before.

    Attributes:
        candidate, form: The candidate and its best form.
        z: Slope of the likelihood, in standard deviations between drivers [-].
        gain: Gain of log-likelihood on the fitted drivers [nats]; None if z is already too small.
        check: Gain of log-likelihood of each part under the strengths fitted to the other part [nats]; None as `gain`.
        is_confirmed: Whether the slope exceeds chance and the held-out drivers gain too.
    """

    candidate: LaneCandidate
    form: Form
    z: float
    gain: float | None
    check: float | None
    is_confirmed: bool

    @property
    def total(self) -> float:
        """Total gain by which candidates are compared [nats]."""
        return self.check or 0.0


class CandidateColumns:
    """All opportunities with the columns of the candidates, in three parts that share no driver.

    Attributes:
        part: Part of each opportunity: 0, 1 or 2.
        seed: Seed of the resamples of drivers.
        of_form: Column of each form of the candidates.
        data: Choices of the drivers, with their own gains and the columns of circumstances.
        bends: Knots of the model in the driver's own gain [m/s^2].
    """

    def __init__(self, table: Opportunities, part: Int[np.ndarray, " rows"], seed: int) -> None:
        self.part, self.seed = part, seed
        self.of_form = {form: form.column(table) for candidate in CANDIDATES for form in candidate.forms}
        held = [candidate.forms[0] for candidate in CANDIDATES if candidate.is_circumstance]
        others = np.column_stack([self.of_form[form] for form in held])
        driver = np.unique(table.vehicle, return_inverse=True)[1]
        self.data = Choices(own_gain(table), others, table.changes, driver)
        self.bends = knots(self.data.gain[part == 0], table.changes[part == 0])

    def effects(self, added: Sequence[Trial]) -> Float[np.ndarray, "rows effects"]:
        """Columns of the added effects."""
        columns = [self.of_form[trial.form] for trial in added]
        return np.stack(columns, axis=1) if columns else np.empty((len(self.part), 0))

    def rows(self, *parts: int) -> Bool[np.ndarray, " rows"]:
        """True for opportunities of drivers in the given parts."""
        return np.isin(self.part, parts)

    def fitted(self, effects: Float[np.ndarray, "rows effects"], *parts: int) -> IncentiveModel:
        """The model fitted to drivers of the given parts."""
        rows = self.rows(*parts)
        return fit_incentive(self.data.take(rows), effects[rows], self.bends)

    def score(
        self, model: IncentiveModel, effects: Float[np.ndarray, "rows effects"], extra: Float[np.ndarray, " rows"]
    ) -> float:
        """Score test of one more effect on the first two parts, see `score_test` [-]."""
        rows = self.rows(0, 1)
        data, added = self.data.take(rows), effects[rows]
        slope = model.slope(data, added)[:, None]
        columns = np.column_stack([model.columns(data, added), slope * added])
        # The strengths are in the incentive already, so the columns of their changes have the coefficient 0.
        coefficients = np.concatenate([model.line.coefficients, np.zeros(added.shape[1])])
        return score_test(coefficients, columns, data.taken, data.driver, slope[:, 0] * extra[rows])

    def cross_validated(self, effects: Float[np.ndarray, "rows effects"]) -> Float[np.ndarray, " rows"]:
        """Log-likelihood of parts 0 and 1, each under the model fitted to the other [nats]; 0 for part 2."""
        value = np.zeros(len(self.part))
        for fitted, checked in ((0, 1), (1, 0)):
            rows = self.rows(checked)
            value[rows] = self.fitted(effects, fitted).log_likelihood(self.data.take(rows), effects[rows])
        return value

    def resampled(self, values: Float[np.ndarray, " rows"], *parts: int) -> Float[np.ndarray, " draws"]:
        """Sums of the values over all opportunities of the drivers in each resample of the given parts' drivers."""
        rows = self.rows(*parts)
        sums = np.bincount(np.unique(self.data.driver[rows], return_inverse=True)[1], values[rows])
        return sums[resamples(len(sums), RESAMPLES, self.seed)].sum(axis=1)


def trials_of(columns: CandidateColumns, added: Sequence[Trial]) -> list[Trial]:
    """A trial of every candidate that has not been added yet, in its best form."""
    effects = columns.effects(added)
    model = columns.fitted(effects, 0, 1)
    fitted_before, checked_before = model.log_likelihood(columns.data, effects), columns.cross_validated(effects)
    rows = columns.rows(0, 1)
    added_keys = {trial.candidate.key for trial in added}
    trials = []
    for candidate in NAMEABLE:
        if candidate.key in added_keys:
            continue
        forms = []
        for form in candidate.forms:
            extra = columns.of_form[form]
            z = columns.score(model, effects, extra)
            if abs(z) < LEAST_Z_SCORE or (z < 0 and candidate.low >= 0):
                forms.append(Trial(candidate, form, z, None, None, False))
                continue
            wider = np.column_stack([effects, extra])
            gains = columns.fitted(wider, 0, 1).log_likelihood(columns.data, wider) - fitted_before
            checks = columns.cross_validated(wider) - checked_before
            is_confirmed = bool(np.quantile(columns.resampled(checks, 0, 1), THRESHOLDS.lane_check_quantile) > 0.0)
            gain, check = float(gains[rows].sum()), float(checks.sum())
            forms.append(Trial(candidate, form, z, gain, check, is_confirmed))
        trials.append(max(forms, key=lambda trial: (trial.is_confirmed, trial.total, abs(trial.z))))
    return trials
