"""The discovery of missing effects: from the drivers of recordings to a verdict, its tables and the repaired model."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from rich.progress import Progress

from rearl_jax.config import DiscoverTask
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.discovery.best_search import NULL_TABLE, BestSearch, best_search
from rearl_jax.discovery.claims import Claim
from rearl_jax.discovery.comparison.compared import compared_table
from rearl_jax.discovery.comparison.comparison import BASE_TABLE, base_block
from rearl_jax.discovery.comparison.dependence import dependent_effects
from rearl_jax.discovery.comparison.predictions import predicting_variation
from rearl_jax.discovery.lane_changes import LaneChangeFindings
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, prior_of
from rearl_jax.discovery.observe.parts import Parts
from rearl_jax.discovery.observe.solver import Solver, solver_of
from rearl_jax.discovery.observe.uncertainty import covariance
from rearl_jax.discovery.read.gate import Finding
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.report import tables
from rearl_jax.discovery.report.equilibrium import equilibrium_time_gaps
from rearl_jax.discovery.report.error_block import IDM, error_block, lowers_predicting_errors
from rearl_jax.discovery.report.errors import ModelErrors, model_errors
from rearl_jax.discovery.report.failed_tests import failed_tests
from rearl_jax.discovery.report.lane_choice_scores import LANE_CHANGE_TABLE, prediction_block, prediction_table
from rearl_jax.discovery.report.population import population_block
from rearl_jax.discovery.report.repaired import repaired_model
from rearl_jax.discovery.report.variation import variation_block
from rearl_jax.discovery.report.verdict import (
    candidate_rows,
    claim_of,
    differing_clocks,
    found_in_columns,
    is_on,
    lane_changes_block,
    unseen,
    verdict_of,
)
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.search.adequacy import Adequacy
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP
from rearl_jax.discovery.search.lane_choice import lane_choice, with_lane_choice
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.procedure import in_time
from rearl_jax.discovery.search.refit import rebased, refit
from rearl_jax.discovery.search.screen import scores
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.models.record import RepairedModel
from rearl_jax.problems import out_of_range
from rearl_jax.results import Study


@dataclass(frozen=True)
class PageData:
    """Data of the figures and the page: `parts` are the drivers as measured, `reported` the report drivers, with
    corrected clocks if those of the fitted drivers were corrected, and `errors` those of the models without (`before`)
    and with (`after`) the effects found, and of IDM (`idm`).
    """

    solver: Solver
    search: Search
    parts: Parts
    reported: Measured
    errors: dict[str, ModelErrors]


@dataclass(frozen=True)
class Discovery:
    """Result of a discovery: the effects that the traffic model lacks in measured trajectories.

    Attributes:
        config: The task.
        data_id: Identity of the data.
        verdict: Content of verdict.json, see `report.verdict`.
        tables: Parquet tables by name; empty if `discover.oracle` is set.
        model: The repaired model; None if `discover.oracle` is set, and for groups whose results were written.
        page_data: Data of the figures and of the page; None if `model` is None.
        groups: Discoveries of groups of drivers by name; empty if drivers are not divided into groups.
        infos: Descriptions of the recordings of groups.
    """

    config: DiscoverTask
    data_id: str
    verdict: dict[str, Any]
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    model: RepairedModel | None = None
    page_data: PageData | None = None
    groups: Mapping[str, "Discovery"] = field(default_factory=dict)
    infos: tuple[RecordingInfo, ...] = ()


def discovery_of(
    config: DiscoverTask,
    parts: Parts,
    recordings: Sequence[Recording],
    bar: Progress,
    study: Study | None = None,
    name: str = "",
) -> Discovery:
    """Discovery of the effects that the traffic model lacks for some drivers.

    The `study`, if there is one, stores intermediate results, so that an interrupted run can continue; `name` is that
    of the group of drivers, shown in the bar.

    Raises:
        ValueError: `discover.oracle` names no candidate.
    """
    begin = time.perf_counter()
    priors, label = [prior_of(driver) for driver in config.compared], f"{name}: " if name else ""
    if config.discover.oracle is not None:
        discovery = Discovery(config, parts.id, _oracle(config, solver_of(parts.fitted, priors[0]), parts))
    else:
        found = best_search(config, study, priors, parts, bar, label)
        lanes = lane_choice(found.solver, found.outcome, parts, recordings, config.discover)
        discovery = _discovery(config, parts, found, lanes)
    discovery.verdict["seconds"] = time.perf_counter() - begin
    return discovery


def _discovery(config: DiscoverTask, parts: Parts, found: BestSearch, lanes: LaneChangeFindings) -> Discovery:
    """The result of a search and of the analysis of lane choice, with verdict, tables and repaired model."""
    options, comparison, adequacy = config.discover, found.comparison, found.adequacy
    solver, outcome = found.solver, found.outcome
    reported = in_time(solver, outcome, parts.reported)
    errors = {"before": model_errors(solver, parts.reported, outcome.before, options.seed)}
    variation = predicting_variation(solver, outcome, options.seed)
    if outcome.added or outcome.clocks is not None or variation != CONSTANT_TIME_GAP:
        errors["after"] = model_errors(solver, reported, outcome.last, options.seed, variation)
    errors[IDM] = _errors_of_idm(config, found, parts, errors["before"])
    resampling = Resampling(options.confidence, options.draws, options.seed)
    of_effects = covariance(solver, outcome.last.state)
    effects = _effects(of_effects, outcome, adequacy, parts.findings, options.confidence)
    not_found_with = {
        (term.effect, outcome.layout.candidates[term].variables): names
        for term, names in dependent_effects(outcome, found.model_tests).items()
    }
    effects = [
        replace(claim, depends_on_base=not_found_with.get((claim.name, claim.variables), ())) for claim in effects
    ]
    error = error_block(errors, resampling)
    time_gaps = equilibrium_time_gaps(solver, outcome.first.state, options)
    verdict_on_following = {
        "verdict": verdict_of(outcome, effects, adequacy, predicts_better=lowers_predicting_errors(error)),
        "effects": [effect.plain() for effect in effects],
        "candidates": candidate_rows(outcome),
        "lane_changes": lane_changes_block(outcome, of_effects, options.confidence),
        "unseen": unseen(outcome),
        "error": error,
        "base": None if comparison is None else base_block(comparison, options, time_gaps),
        **({"equilibrium_time_gap": time_gaps} if comparison is None else {}),
        "population": population_block(solver, outcome.first.state),
        "time_gap_variation": variation_block(
            solver, (outcome.before, parts.reported), (outcome.last, reported), variation, resampling
        ),
        "adequacy": {
            "kurtosis": adequacy.kurtosis,
            "kurtosis_before": adequacy.kurtosis_before,
            "autocorrelation": adequacy.autocorrelation,
            "autocorrelation_by_noise": adequacy.autocorrelation_by_noise,
            "unequal_noise": adequacy.unequal_noise,
            "misjudgement": adequacy.misjudgement,
            "staleness": adequacy.staleness,
            "remaining": {"name": str(adequacy.remaining[0]), "z_score": adequacy.remaining[1]},
        },
        "failed_tests": [failed.plain() for failed in failed_tests(outcome, effects, adequacy)],
        "data": _described(parts, solver),
        "thresholds": THRESHOLDS.plain(),
    }
    verdict = with_lane_choice(verdict_on_following, lanes)
    verdict["lane_choice"]["prediction"] = prediction_block(lanes.prediction, resampling)
    model = repaired_model(
        calibrated=outcome.first,
        repaired=outcome.last,
        lane_changes=[trial for trial in outcome.lane_changes if trial.holds],
        added=outcome.added,
        lane_choice=lanes,
        variation=variation,
        data=parts.fitted,
        layout=solver.layout,
        data_id=parts.id,
        study=config.study,
    )
    result_tables = {
        "candidates": tables.candidate_table(verdict),
        "errors": tables.error_table(errors),
        "drivers": tables.driver_table(solver, outcome),
        NULL_TABLE: tables.null_table(outcome.null),
    }
    if comparison is not None:
        result_tables[BASE_TABLE] = compared_table(comparison.found)
    if lanes.prediction is not None:
        result_tables[LANE_CHANGE_TABLE] = prediction_table(lanes.prediction)
    page_data = PageData(solver, outcome, parts, reported, errors)
    return Discovery(config, parts.id, verdict, result_tables, model, page_data)


def _errors_of_idm(config: DiscoverTask, found: BestSearch, parts: Parts, before: ModelErrors) -> ModelErrors:
    """Errors of IDM without any effect, calibrated to the same drivers, as a reference: those of the calibrated model,
    `before`, if it is IDM without effects of lane changes.
    """
    if found.solver.layout.prior.name == IDM_PRIOR.name and not found.outcome.before.state.active:
        return before
    solver = solver_of(parts.fitted, IDM_PRIOR)
    fit = base_of(solver, parts.fitted, lane_changes=False).fit
    return model_errors(solver, parts.reported, fit, config.discover.seed)


def _effects(
    of_effects: np.ndarray, outcome: Search, adequacy: Adequacy, findings: Sequence[Finding], confidence: float
) -> list[Claim]:
    """Claims: artefacts that the data check found, then clock offsets, then the added effects; `of_effects` is the
    covariance of the effects' parameters in the final model, `confidence` that of their intervals [-].
    """
    effects = [found_in_columns(finding, confidence) for finding in findings if finding.is_artefact]
    most, doubtful = THRESHOLDS.most_confidence, THRESHOLDS.doubtful_confidence
    highest = most if adequacy.is_adequate and not outcome.leaves_shifts else doubtful
    if outcome.clocks is not None:
        effects.append(differing_clocks(outcome.clocks, most if adequacy.is_of_clocks else doubtful))
    theta = outcome.last.state.theta
    for trial, rivals, of_effect in outcome.fitted_trials(of_effects):
        if not outcome.is_stated(trial) or not is_on(trial, theta, of_effect, outcome.layout, confidence):
            continue
        reliability = doubtful if outcome.is_doubtful(trial) else highest
        claim = claim_of(trial, rivals, theta, of_effect, outcome.layout, confidence, reliability)
        if claim.confidence >= THRESHOLDS.least_confidence:
            effects.append(claim)
    return effects


def _oracle(config: DiscoverTask, solver: Solver, parts: Parts) -> dict[str, Any]:
    """Verdict with the error of the oracle, the model with the effect that `discover.oracle` names (in generated data,
    the hidden one). No other effect is searched for.
    """
    assert config.discover.oracle is not None
    term, candidates = Term.read(config.discover.oracle), solver.layout.candidates
    if term not in candidates:
        known_terms = ", ".join(sorted(map(str, candidates)))
        raise out_of_range("discover.oracle", f"must be a candidate for these data: {known_terms}", str(term))
    base = base_of(solver, parts.fitted, lane_changes=config.discover.lane_changes).fit
    (scores_of_terms,) = scores(solver, [base.state])
    fits = refit(solver, base, [candidates[term]], scores_of_terms)
    base, options = rebased(solver, base, fits), config.discover
    models = {"before": base, "oracle": fits[term]}
    errors = {name: model_errors(solver, parts.reported, fit, options.seed) for name, fit in models.items()}
    return {
        "verdict": "named",
        "effects": [],
        "candidates": [],
        "unseen": [],
        "error": error_block(errors, Resampling(options.confidence, options.draws, options.seed)),
        "base": None,
        "adequacy": None,
        "failed_tests": [],
        "lane_choice": None,
        "data": _described(parts, solver),
    }


def _described(parts: Parts, solver: Solver) -> dict[str, Any]:
    """Entry `data` of the verdict."""
    return {
        "id": parts.id,
        "car_following": solver.layout.prior.name,
        "recordings": len(parts.infos),
        "generated": parts.generated,
        "drivers": {
            "fitted": parts.fitted.n_drivers,
            "checked": parts.checked.n_drivers,
            "reported": parts.reported.n_drivers,
        },
        "driver_seconds": parts.fitted.seconds + parts.checked.seconds + parts.reported.seconds,
        "step": parts.fitted.dt,
        "position_noise": parts.fitted.noise,
        "properties": {finding.name: finding.value for finding in parts.findings if not finding.is_artefact},
        "findings": [finding.words for finding in parts.findings],
        "notes": list(parts.notes),
    }
