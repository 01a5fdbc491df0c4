"""The search for missing effects with the car-following model that predicts best once the effects found are added.

Car-following models without effects are compared first. A missing effect favours models that imitate it in this
comparison, so the models are compared again with the effects found. If these have no names (free curves), the search is
repeated with other models, where the effects may have names.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich.progress import Progress

from rearl_jax.config import DiscoverTask
from rearl_jax.data.recordings import has_one_clock
from rearl_jax.discovery.comparison.comparison import Comparison, comparison_of
from rearl_jax.discovery.comparison.dependence import (
    MOST_OTHERS,
    ModelTest,
    better_model,
    effects_in_other_models,
    with_doubts,
    without_bounds,
)
from rearl_jax.discovery.comparison.predictions import clocks_predict_better, predicting_effects
from rearl_jax.discovery.observe.base import Base
from rearl_jax.discovery.observe.candidates import NAMED_KINDS, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import Solver, solver_of
from rearl_jax.discovery.report import tables
from rearl_jax.discovery.search.adequacy import Adequacy, adequacy
from rearl_jax.discovery.search.explanation import is_explained, prediction_of, predicts_better
from rearl_jax.discovery.search.null import Null, null_of
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.procedure import NullFor, Report, search
from rearl_jax.discovery.search.simulation import confirmed
from rearl_jax.progress import shown
from rearl_jax.results import Study

log = logging.getLogger(__name__)

NULL_TABLE = "null"

REPLICATES_WITH_EFFECTS = 12
"""Simulated data sets per null distribution (evidence if nothing is missing) once effects are added; its mean is then
known to 0.3 standard deviations.
"""


@dataclass(frozen=True)
class BestSearch:
    """Result of the search with the chosen car-following model: its solver, the adequacy of the final model, the
    comparison of models (None if there is only one), and the effects found, tested in other models.
    """

    solver: Solver
    outcome: Search
    adequacy: Adequacy
    comparison: Comparison | None = None
    model_tests: Sequence[ModelTest] = ()


def best_search(
    config: DiscoverTask, study: Study | None, priors: Sequence[Prior], parts: Parts, bar: Progress, label: str
) -> BestSearch:
    """Search with the car-following model that fits best, and a test of the effects found in other models.

    If the effects found do not explain the drivers (see `is_explained`), clock offsets and effects are kept only if the
    check drivers are predicted significantly better with them. The `study`, if there is one, keeps the null
    distribution of an interrupted run; `label` is the beginning of the lines of the bar.
    """
    best = _with_best_model(config, study, priors, parts, bar, label)
    if is_explained(best.outcome, best.adequacy):
        return best
    solver, options, outcome = best.solver, config.discover, best.outcome
    if not clocks_predict_better(solver, outcome, parts.checked, options.seed):
        log.info(
            "corrected clocks do not predict other drivers significantly better: the search is repeated without them"
        )
        outcome = _search(config, None, solver, parts, bar, label, excluded=frozenset({CLOCK_OFFSET}))
        best = _tested(best, outcome, parts, options.seed)
        if is_explained(outcome, best.adequacy):
            return best
    null_for = _null_for(config, None, solver, bar, label)
    outcome = predicting_effects(solver, outcome, options.seed, null_for, _reported(bar, label))
    if outcome is best.outcome:
        return best
    left_out = ", ".join(sorted(map(str, outcome.unpredictive)))
    log.info("left out, because they do not predict other drivers significantly better: %s", left_out or "nothing")
    return _tested(best, without_bounds(solver, outcome, parts.fitted), parts, options.seed)


def _tested(best: BestSearch, outcome: Search, parts: Parts, seed: int) -> BestSearch:
    """`best` with another search with the same model, its adequacy, and its effects tested in other models."""
    outcome, model_tests = _in_other_models(best.solver, outcome, best.comparison, parts, seed)
    return replace(best, outcome=outcome, adequacy=adequacy(best.solver, outcome, seed), model_tests=model_tests)


def _in_other_models(
    solver: Solver, outcome: Search, comparison: Comparison | None, parts: Parts, seed: int
) -> tuple[Search, Sequence[ModelTest]]:
    """A search with its effects that other models do without, and the tests of its effects in these models."""
    others = () if comparison is None else comparison.rivals
    model_tests = effects_in_other_models(solver, outcome, others, parts.fitted)
    return with_doubts(outcome, model_tests, seed), model_tests


def _with_best_model(
    config: DiscoverTask, study: Study | None, priors: Sequence[Prior], parts: Parts, bar: Progress, label: str
) -> BestSearch:
    """Search with the car-following model that fits best, and a test of the effects found in other models.

    The search is repeated with another model in two cases: `better_model` prefers the other model with the effects
    found, and simulations do not contradict it; or the first model needs a free curve or an effect with a doubtful
    name, while the other one needs named effects only and predicts significantly better.
    """
    seed = config.discover.seed
    if len(priors) == 1:
        solver = solver_of(parts.fitted, priors[0])
        outcome = _search(config, study, solver, parts, bar, label)
        return BestSearch(solver, outcome, adequacy(solver, outcome, seed))
    progress = shown(bar, f"{label}comparing car-following models")
    comparison = comparison_of(priors, parts, config.discover, progress, study)
    solver = solver_of(parts.fitted, comparison.prior)
    outcome = _search(config, study, solver, parts, bar, label, calibrated=comparison.base)
    outcome, model_tests = _in_other_models(solver, outcome, comparison, parts, seed)
    better = better_model(model_tests, seed)
    if better is not None and not comparison.denies(better):
        log.info("with the effects found, or without one, %s fits better: the search is repeated with it", better.name)
        comparison, solver = comparison.with_choice(better), solver_of(parts.fitted, better)
        # Not stored, because the stored null distribution is that of the first model.
        outcome = _search(config, None, solver, parts, bar, label)
        outcome, model_tests = _in_other_models(solver, outcome, comparison, parts, seed)
    found = BestSearch(solver, outcome, adequacy(solver, outcome, seed), comparison, model_tests)
    if is_explained(outcome, found.adequacy):
        return found
    prediction = prediction_of(solver, outcome)
    undenied = [prior for prior in comparison.next_best if not comparison.denies(prior)]
    for prior in undenied[:MOST_OTHERS]:
        other, other_label = solver_of(parts.fitted, prior), f"{label}with {prior.name}, "
        first_round = _first_round(config, outcome, other, parts, bar, other_label)
        if not first_round.added or not predicts_better(prediction, prediction_of(other, first_round), seed):
            continue
        no_clocks = frozenset({CLOCK_OFFSET})
        named = _search(config, None, other, parts, bar, other_label, excluded=no_clocks, names_only=True)
        # An artefact of the recording that appears with the other model only is evidence against that model.
        if not named.is_named:
            continue
        named_adequacy = adequacy(other, named, seed)
        is_better = predicts_better(prediction, prediction_of(other, named), seed)
        if is_better and is_explained(named, named_adequacy):
            log.info("with %s, the effects found have names, and the check drivers are predicted better", prior.name)
            comparison = comparison.with_choice(prior)
            named, model_tests = _in_other_models(other, named, comparison, parts, seed)
            return BestSearch(other, named, named_adequacy, comparison, model_tests)
    return found


def _first_round(
    config: DiscoverTask, outcome: Search, other: Solver, parts: Parts, bar: Progress, label: str
) -> Search:
    """The first round of a search for named effects only, with another car-following model (`other`).

    It takes a small part of the time of a whole search: it reuses the null distribution of the search `outcome`, and
    fits no curves.
    """
    candidates, in_null = other.layout.candidates, outcome.null.mean
    excluded = {term for term in candidates if term not in in_null or candidates[term].kind not in NAMED_KINDS}
    return search(
        other,
        parts.fitted,
        parts.checked,
        lambda *_: outcome.null,
        _reported(bar, label),
        lane_changes=config.discover.lane_changes,
        excluded=frozenset({*excluded, CLOCK_OFFSET}),
        rounds=1,
    )


def _reported(bar: Progress, label: str) -> Report:
    """Function that shows the present step of a search in a line of the bar, which begins with `label`."""
    line = bar.add_task(f"{label}calibrating drivers", total=None)
    return lambda step, done, total: bar.update(line, description=f"{label}{step}", completed=done, total=total)


def _search(
    config: DiscoverTask,
    study: Study | None,
    solver: Solver,
    parts: Parts,
    bar: Progress,
    label: str,
    *,
    calibrated: Base | None = None,
    excluded: frozenset[Term] = frozenset(),
    names_only: bool = False,
) -> Search:
    """Search for effects of car following with one car-following model, without additions that simulations contradict;
    without clock offsets between vehicles if a recording has one clock.

    Lines of the bar begin with `label`; keyword arguments are those of `search`.
    """
    options = config.discover
    report = _reported(bar, label)
    if has_one_clock(config.data):
        excluded = excluded | {CLOCK_OFFSET}
    outcome = search(
        solver,
        parts.fitted,
        parts.checked,
        _null_for(config, study, solver, bar, label),
        report,
        lane_changes=options.lane_changes,
        calibrated=calibrated,
        excluded=excluded,
        names_only=names_only,
    )
    report("reporting", 0, 1)
    return without_bounds(solver, confirmed(solver, outcome, options.seed), parts.fitted)


def _null_for(config: DiscoverTask, study: Study | None, solver: Solver, bar: Progress, label: str) -> NullFor:
    """Function that simulates null distributions; that of the model without added effects is stored in the study."""
    options = config.discover

    def null_for(base: Fit, n_added: int) -> Null:
        store = study if not n_added else None
        if store is not None and store.owns(NULL_TABLE):  # stored by an interrupted run
            return tables.read_null(store.path / f"{NULL_TABLE}.parquet")
        progress = shown(bar, f"{label}simulating null distributions")
        n = min(options.replicates, REPLICATES_WITH_EFFECTS) if n_added else options.replicates
        null = null_of(solver, base.state, base.noise, n, options.seed, progress)
        if store is not None:
            store.write_table(NULL_TABLE, tables.null_table(null), seeds=f"discover.seed={options.seed}")
        return null

    return null_for
