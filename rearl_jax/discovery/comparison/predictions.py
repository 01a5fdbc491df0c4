"""Additions to a model that are kept only if they predict other drivers significantly better."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.comparison.choice import DRAWS
from rearl_jax.discovery.observe.clocks import Clocks
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.training import halves
from rearl_jax.discovery.report.protocols import (
    FIRST_HALF,
    PREDICTING,
    ProtocolErrors,
    first_half_errors,
    prediction_errors,
)
from rearl_jax.discovery.resampling import resamples
from rearl_jax.discovery.search.clock_check import correct_shifts
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.headway import START_SHARES, TimeGapVariation, VariationSearch
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.procedure import NullFor, Report, with_predictive_effects
from rearl_jax.discovery.thresholds import THRESHOLDS

GapErrors = Mapping[str, Float[np.ndarray, " drivers"]]
"""Gap error of each tested driver [m], by protocol."""


def predicting_effects(solver: Solver, outcome: Search, seed: int, null_for: NullFor, report: Report) -> Search:
    """The search with only those additions that predict the check drivers significantly better, see
    `with_predictive_effects`.

    Evidence comes from one-step predictions, and in simulations the calibrated parameters can compensate for a wrong
    effect. An effect that may not be the right one must therefore improve predictions of drivers, or parts of drives,
    to which no parameter was calibrated. A response to the vehicle behind is never kept, because its simulations are no
    evidence, see `Trial.is_of_follower`.
    """

    def errors_of(fit: Fit) -> GapErrors:
        return _gap_errors(prediction_errors(solver, recalibrated(solver, outcome.checked, fit), fit))

    def most_predictive(base: Fit, trials: Sequence[Trial]) -> Trial | None:
        if not trials:
            return None
        before = errors_of(base)
        return next(
            (
                trial
                for trial in trials
                if not trial.is_of_follower and is_significantly_better(before, errors_of(trial.fit), seed)
            ),
            None,
        )

    return with_predictive_effects(solver, outcome, most_predictive, null_for, report)


def clocks_predict_better(solver: Solver, outcome: Search, checked: Measured, seed: int) -> bool:
    """True if no clocks were corrected, or if corrected clocks predict the check drivers significantly better;
    `checked` are these drivers with clocks as measured.

    The second half of each drive is predicted, with clock offsets from the first halves: offsets from whole drives also
    fit what each driver happened to do.
    """
    if outcome.clocks is None:
        return True
    earlier = correct_shifts(solver, Clocks(halves(checked).training), outcome.before).data
    corrected = replace(earlier, weight=checked.weight)
    before = first_half_errors(solver, checked, outcome.before)
    after = first_half_errors(solver, corrected, outcome.first)
    return is_significantly_better(_gap_errors({FIRST_HALF: before}), _gap_errors({FIRST_HALF: after}), seed)


def predicting_variation(solver: Solver, outcome: Search, seed: int) -> TimeGapVariation:
    """The variation of drivers' time gaps under the final model of a search.

    The gap at the start of a drive is used to predict the variation only as far as it predicts the check drivers
    significantly better: the more drivers are off equilibrium there for other reasons, the smaller is the share of the
    departure that lasts, so smaller shares are tried after one that fails.
    """
    fit, variations = outcome.last, VariationSearch(solver, outcome.last, seed)
    variation = variations.best()
    if not variation.start_share:
        return variation
    state = recalibrated(solver, outcome.checked, fit)
    before = _gap_errors(prediction_errors(solver, state, fit))
    while variation.start_share:
        after = _gap_errors(prediction_errors(solver, state, fit, variation=variation))
        if is_significantly_better(before, after, seed):
            break
        variation = variations.best([share for share in START_SHARES if share < variation.start_share])
    return variation


def _gap_errors(found: Mapping[str, ProtocolErrors | None]) -> GapErrors:
    return {name: errors.by_driver["gap_rmse"] for name, errors in found.items() if errors}


def is_significantly_better(before: GapErrors, after: GapErrors, seed: int) -> bool:
    """True if the mean gap error of the same drivers is significantly smaller `after` than `before` the additions under
    one predicting protocol and probably smaller under all.

    The share of resamples that is significant is higher the more protocols there are, because any one suffices.

    Source: Bonferroni's inequality, Dunn, J. Am. Stat. Assoc. 56 (1961) 52.
    """
    shares = []
    for name in PREDICTING:
        if name in before:
            drawn = resamples(len(before[name]), DRAWS, seed)
            smaller = after[name][drawn].mean(axis=1) < before[name][drawn].mean(axis=1)
            shares.append(float(smaller.mean()))
    if not shares:
        return False
    significant = 1 - (1 - THRESHOLDS.prediction_share) / len(shares)
    return min(shares) > 0.5 and max(shares) >= significant
