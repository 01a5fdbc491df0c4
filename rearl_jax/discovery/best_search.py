"""The search for what is missing, beside the car-following model that fits best with what is found.

Bare models are compared first, and what is missing pulls that comparison towards models that imitate it. So models are
compared again with what was found, and where what was found has no name, others are searched beside for one that has.
"""

import logging
from collections.abc import Sequence
from functools import partial

from rich.progress import Progress

from rearl_jax.config import DiscoverTask
from rearl_jax.discovery.comparison.comparison import Comparison, comparison_of
from rearl_jax.discovery.comparison.dependence import MOST_OTHERS, Beside, better_model, found_beside
from rearl_jax.discovery.observe.base import Base
from rearl_jax.discovery.observe.candidates import LENS
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import Solver, solver_of
from rearl_jax.discovery.report import tables
from rearl_jax.discovery.search.confirmation import clocks_confirmed, confirmed, lens_confirmed
from rearl_jax.discovery.search.explanation import is_explained, names_more, predicts_better
from rearl_jax.discovery.search.null import Null, null_of
from rearl_jax.discovery.search.procedure import Search, search
from rearl_jax.progress import shown
from rearl_jax.results import Study

log = logging.getLogger(__name__)

NULL_TABLE = "null"


def best_search(
    config: DiscoverTask, study: Study | None, priors: Sequence[Prior], parts: Parts, bar: Progress, whose: str
) -> tuple[Solver, Search, Comparison | None, list[Beside]]:
    """Search beside the model that fits best, and what was found in others; where another model surely fits better with
    what was found, or accounts for the drivers by names where this one leaves a curve or a doubt, the search goes on
    beside that one.
    """
    if len(priors) == 1:
        solver = solver_of(parts.fitted, priors[0])
        return solver, _search(config, study, solver, parts, None, bar, whose), None, []
    say = shown(bar, f"{whose}comparing car-following models")
    comparison = comparison_of(priors, parts, config.discover, say, study)
    solver = solver_of(parts.fitted, comparison.prior)
    outcome = _search(config, study, solver, parts, comparison.base, bar, whose)
    beside = found_beside(solver, outcome, comparison.others, parts.fitted)
    better = better_model(beside, config.discover.seed)
    if better is not None:
        log.info("with what was found, %s is surely more likely: the search begins anew beside it", better.name)
        comparison, solver = comparison.going_on_with(better), solver_of(parts.fitted, better)
        outcome = _search(config, None, solver, parts, None, bar, whose)  # simulated nulls are of the first model
        beside = found_beside(solver, outcome, comparison.others, parts.fitted)
    if is_explained(solver, outcome, config.discover.seed):
        return solver, outcome, comparison, beside
    for prior in comparison.next_best[:MOST_OTHERS]:
        other, words = solver_of(parts.fitted, prior), f"{whose}beside {prior.name}, "
        if not _is_promising(config, solver, outcome, other, parts, bar, words):
            continue
        named = _search(config, None, other, parts, None, bar, words)
        if names_more(solver, outcome, other, named, config.discover.seed):
            log.info("beside %s, what was found has a name, and other drivers are as likely", prior.name)
            comparison = comparison.going_on_with(prior)
            return other, named, comparison, found_beside(other, named, comparison.others, parts.fitted)
    return solver, outcome, comparison, beside


def _is_promising(
    config: DiscoverTask, solver: Solver, outcome: Search, other: Solver, parts: Parts, bar: Progress, words: str
) -> bool:
    """True if another model with one named effect predicts the check drivers better than all that was found beside the
    first one.

    This takes a small part of the time of a search, because neither nulls are simulated nor curves fitted.
    """
    kinds, known = other.layout.candidates, outcome.null.mean
    excluded = {term for term in kinds if term not in known or kinds[term].kind not in ("driver", "road")}
    line = bar.add_task(words, total=None)

    def report(what: str, done: int, total: int) -> None:
        bar.update(line, description=f"{words}{what}", completed=done, total=total)

    first = search(
        other,
        parts.fitted,
        parts.checked,
        lambda _: outcome.null,
        report,
        lane_changes=config.discover.lane_changes,
        excluded=frozenset({*excluded, CLOCK_OFFSET}),
        rounds=1,
    )
    return bool(first.added) and predicts_better(solver, outcome, other, first, config.discover.seed)


def _search(
    config: DiscoverTask,
    study: Study | None,
    solver: Solver,
    parts: Parts,
    calibrated: Base | None,
    bar: Progress,
    whose: str,
) -> Search:
    """Search for effects of car following beside a model, which may be calibrated; `whose` begins what the bar says."""
    options = config.discover
    line = bar.add_task(f"{whose}calibrating drivers", total=None)
    replicates = shown(bar, f"{whose}simulated nulls")

    def report(words: str, done: int, total: int) -> None:
        bar.update(line, description=f"{whose}{words}", completed=done, total=total)

    def null_for(base: Fit) -> Null:
        if study is not None and study.owns(NULL_TABLE):  # of a run that was killed
            return tables.read_null(study.path / f"{NULL_TABLE}.parquet")
        null = null_of(solver, base.state, base.noise, options.replicates, options.seed, replicates)
        if study is not None:
            study.write_table(NULL_TABLE, tables.null_table(null), seeds=f"discover.seed={options.seed}")
        return null

    look = partial(
        search,
        solver,
        parts.fitted,
        parts.checked,
        null_for,
        report,
        lane_changes=options.lane_changes,
        calibrated=calibrated,
    )
    outcome = look()
    if not clocks_confirmed(solver, outcome, parts.checked, options.seed):
        log.info("clocks put right make simulations of other drivers worse: left as they are")
        outcome = look(excluded=frozenset({CLOCK_OFFSET}))
    if not lens_confirmed(solver, outcome, options.seed):
        log.info("a camera's distortion makes simulations of other drivers worse: left as it is")
        outcome = look(excluded=outcome.excluded | {LENS})
    report("reporting", 0, 1)
    return confirmed(solver, outcome, options.seed)
