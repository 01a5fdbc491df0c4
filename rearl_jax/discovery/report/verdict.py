"""The verdict of a discovery, the content of verdict.json: missing effects, confidence, and equally good alternatives.

In all entries `before` is the calibrated model, `after` the final model with the effects found; fitted drivers are
those whom models are fitted to, check drivers those whom candidates are checked on, and report (held-out) drivers those
whose errors are stated.

verdict      named | improved | artefact | unexplained | nothing; improved: a curve without a library effect
             predicts other drivers significantly better
effects      [{name, kind: driver | road | artefact | generic, parameters: {name: {value, low, high, unit}},
             variables, confidence, evidence, depends_on_base}]; low and high are null for parameters that were not
             estimated; `depends_on_base`: names of other car-following models under which the effect is not found
candidates   [{name, kind, variables, evidence, z_score, gain, check, ambiguous, told_apart_by, result}], the best
             first; candidates of car following precede those of lane choice. `z_score` of the evidence: of car
             following in standard deviations of the null distribution, of lane choice in standard deviations of the
             slope between drivers; `told_apart_by`: data that would distinguish the candidate from the named effect;
             `result`, of car following: added, or the test that failed, see `candidate_results.RESULTS`
lane_changes [{name, parameters, gain, check, is_sure}]: effects of lane changes in the calibrated model; empty if too
             few leaders change
unseen       [{name, parameter, strength, unit}]: smallest strength at which each effect that the calibrated model
             lacks would be accepted in these data, null if they contain no information on it
base         {chosen, driver, differs, before, compared, drivers: {fitted, checked}, equilibrium_time_gap}:
             car-following models compared on check drivers, null without a comparison; all other entries of the
             verdict refer to the `chosen` model. `driver`: model of the configuration; `before`: model chosen before
             effects were found, if `chosen` is significantly more likely with these effects, else null; `compared`:
             [{name, n_parameters, log_likelihood [nats], gain: log-likelihood above that of `driver`, better_share:
             share of resamples of drivers in which it is more likely than `driver`, best_share: share in which it is
             the most likely of all, is_vetoed: whether simulations contradict it, protocols: {name: {n_drivers,
             gap_rmse, gap_nrmse, speed_rmse}}, null if not simulated}]; `equilibrium_time_gap` {speed [m/s]: {value,
             low, high}} [s]: median of gap over speed behind a leader of that speed, over the fitted drivers whose
             desired speed is higher, null if these are fewer than half; without a comparison, this is an entry of the
             verdict
error        {measure, protocol, n_drivers, before, after, change, floor, noise_alone, oracle, explained_share, all,
             protocols, response_time}: `measure` under `protocol` as figures {value, low, high}; `noise_alone`: error
             of drives simulated with the drivers' own noise under the final model; `floor`: the same, at most the
             error after; `explained_share`: share of the squared error above the floor that the effects remove, null
             if no error is above it or the noise alone significantly exceeds the error; `all`: before, after and
             change of every measure, each driver with parameters calibrated to its drive; `protocols`: {population |
             first_half | other_runs | in_sample: {n_drivers, left_out, gap_rmse, gap_nrmse, speed_rmse}}, null if no
             driver could be tested; each measure is {mean | median | pooled: {before, after, change, change_share,
             population, population_share, idm, idm_share}}, where `change_share` is the change as a share of before,
             `population` the error on the same drives with population parameters in the model before, `idm` that of
             IDM alone calibrated to the same drivers, and `population_share` and `idm_share` the relative difference
             of after from these; `response_time`: {before, after} [s], delay of drivers behind the
             model's acceleration, null if not identified
population   {parameter: {value, unit, spread, identified, at_bound}}: the calibrated drivers, see `population`
time_gap_variation  {sd, time, noise_share, start_share, time_gap, energy_score}: variation within a driver, see
             `variation`
adequacy     {kurtosis, autocorrelation, autocorrelation_by_noise, misjudgement, staleness, remaining, ...}: remaining
             misfit of the final model, see `search.adequacy`
lane_choice  {changes, opportunities, loss: {before, after, change}, prediction}: number of discretionary lane changes
             and of opportunities, and mean log-loss of the report drivers' choices [nats], null if there were too few;
             effects of lane choice are in `effects` and `candidates`, see `words.is_lane_choice`. `prediction`, for
             held-out drivers, null if there are too few changes: {recorded: all changes, ramp: changes from or to ramp
             lanes, fitted: {drivers, changes}, mobil: {parameter: {value, low, high, unit}}, refused_share: share of
             the changes that calibrated MOBIL refuses, strata: {all | left | right | no_advantage | small_advantage |
             large_advantage | mandatory: {drivers, seconds, opportunities, changes, models}}}; `models`: {base_rate |
             mobil | mobil_rates | mobil_calibrated | hazard: {log_loss, less_base_rate [nats per driver-second],
             balanced_accuracy: {value, low, high}, expected: number of changes}}, null if undefined, see
             `lane_choice_scores`
data         {id, recordings, generated, drivers: {fitted, checked, reported}, driver_seconds, step, position_noise,
             properties: {smoothing [s], position_noise [m], ...}: properties of the measurement, findings, notes}
failed_tests [{test, names, value, limit}]: tests that the final model fails, at least one if `unexplained`; `names`:
             effects concerned, `value` and `limit` null for tests without a number, see `failed_tests.TESTS`
thresholds   {name: value}: every number that decides a claim, see `thresholds.py`
seconds      computation time [s]
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from rearl_jax.core.effects import EFFECTS
from rearl_jax.discovery.claims import Claim, Estimate, share_of
from rearl_jax.discovery.observe.candidates import (
    CANDIDATE_EFFECTS,
    EARLY_LEADER,
    NAMED_KINDS,
    REACTION_DELAY,
    TWINS,
    Candidate,
    Layout,
    Term,
)
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET
from rearl_jax.discovery.observe.uncertainty import interval
from rearl_jax.discovery.read.gate import Finding
from rearl_jax.discovery.report.candidate_results import result_of
from rearl_jax.discovery.search.adequacy import Adequacy
from rearl_jax.discovery.search.clock_check import ClockCheck
from rearl_jax.discovery.search.decision import Trial, shortest_delay
from rearl_jax.discovery.search.families import distinguishing_data
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.screen import least_strength
from rearl_jax.discovery.thresholds import THRESHOLDS


def claim_of(
    trial: Trial,
    others: Sequence[Trial],
    theta: np.ndarray,
    covariance: np.ndarray,
    layout: Layout,
    confidence: float,
    reliability: float,
) -> Claim:
    """An accepted candidate as an effect of the verdict. It competed with the trials `others`; `theta` are the
    parameters of all candidates in the final model, `covariance` that of its own parameters, `confidence` that of their
    intervals [-], and `reliability` the upper bound of the confidence in the effect [-].
    """
    candidate = trial.candidate
    parameters, deviations = {}, np.sqrt(np.diag(covariance))
    for (name, unit), place, deviation in zip(names_and_units(candidate), candidate.free, deviations, strict=True):
        value = float(theta[place])
        if candidate.term == REACTION_DELAY:
            deviation = np.hypot(deviation, THRESHOLDS.delay_deviation * trial.fit.state.data.dt)
        low, high = interval(value, THRESHOLDS.interval_stretch * float(deviation), confidence)
        low, high = max(low, float(layout.low[place])), min(high, float(layout.high[place]))
        parameters[name] = Estimate(value, low, high, unit)
    share = share_of(trial.total, [other.total for other in others if other is not trial])
    probability = min(share, reliability)
    return Claim(candidate.term.effect, candidate.kind, parameters, candidate.variables, probability, trial.total)


def names_and_units(candidate: Candidate) -> list[tuple[str, str]]:
    """Names and units of a candidate's fitted parameters; the values of a curve are numbered."""
    if candidate.term.is_effect:
        return [(parameter.name, parameter.unit) for parameter in CANDIDATE_EFFECTS[candidate.term.effect].parameters]
    unit = {"lens": "m", "time_gap_dependence": "-"}.get(candidate.term.effect, "m/s^2")
    return [(f"value_{k}", unit) for k in range(len(candidate.free))]


def is_on(trial: Trial, theta: np.ndarray, covariance: np.ndarray, layout: Layout, confidence: float) -> bool:
    """True if the interval of a strength, or the confidence region of all strengths together, excludes the values at
    which the effect is off; arguments as of `claim_of`. With two lanes, for example, the data may tell the difference
    of their desired speeds, but not each of them.
    """
    free = list(trial.candidate.free)
    strengths = np.isin(free, list(trial.candidate.directions))
    if trial.candidate.kind == "generic" or not trial.candidate.term.is_effect or not strengths.any():
        return True  # curves, such as a camera's distortion, and sections have no single strength that could be off
    away = (theta - layout.reference)[free][strengths]
    widened = THRESHOLDS.interval_stretch**2 * covariance[np.ix_(strengths, strengths)]
    single = np.abs(away) > interval(0.0, 1.0, confidence)[1] * np.sqrt(np.diag(widened))
    together = away @ np.linalg.pinv(widened) @ away > chi2.ppf(confidence, len(away))
    return bool(single.any() or together)


def lane_changes_block(search: Search, covariance: np.ndarray, confidence: float) -> list[dict[str, Any]]:
    """Entry `lane_changes` of the verdict; `covariance` is that of all searched elements of theta."""
    theta, layout, rows = search.last.state.theta, search.layout, []
    for trial, rivals, of_effect in search.fitted_trials(covariance)[: len(search.lane_changes)]:
        claim = claim_of(trial, rivals, theta, of_effect, layout, confidence, THRESHOLDS.most_confidence)
        is_sure = trial.holds and is_on(trial, theta, of_effect, layout, confidence)
        row = {"name": claim.name, "parameters": claim.plain()["parameters"], "gain": trial.gain, "check": trial.check}
        rows.append(row | {"is_sure": is_sure})
    return rows


def found_in_columns(finding: Finding, confidence: float) -> Claim:
    """A measurement artefact that the columns show, as an effect of the verdict; nothing was fitted, so there is no
    evidence.
    """
    low, high = interval(finding.value, finding.deviation, confidence)
    estimate = Estimate(finding.value, low, high, finding.unit)
    return Claim(finding.name, "artefact", {finding.parameter: estimate}, (), THRESHOLDS.most_confidence, None)


def differing_clocks(check: ClockCheck, reliability: float) -> Claim:
    """Clock offsets as an effect of the verdict, with their stated confidence."""
    spread = {"sd": Estimate(check.spread, None, None, "s")}
    return Claim(CLOCK_OFFSET.effect, "artefact", spread, ("clock",), reliability, check.total)


def verdict_of(search: Search, effects: Sequence[Claim], adequacy: Adequacy, *, predicts_better: bool) -> str:
    """The verdict in one word; `predicts_better` is true if the report drivers are predicted better with the effects
    found, see `error_block.lowers_predicting_errors`.
    """
    added = {trial.candidate.kind for trial in search.added}
    names = {effect.name for effect in effects}
    # An added effect is not stated if it may be off, see `is_on`; the verdict cannot be that effect then.
    unstated = {trial.candidate.kind for trial in search.added if trial.candidate.term.effect not in names}
    if added & NAMED_KINDS:
        is_doubtful = any(search.is_doubtful(trial) for trial in search.added) or search.leaves_shifts
        return "named" if not unstated & NAMED_KINDS and adequacy.is_adequate and not is_doubtful else "unexplained"
    if any(effect.kind in NAMED_KINDS for effect in effects):  # effects of lane changes
        is_doubtful = search.is_contradicted or search.leaves_more or search.leaves_shifts
        return "named" if adequacy.is_adequate and not is_doubtful else "unexplained"
    if added == {"generic"} and not unstated and predicts_better:
        return "improved"
    if any(effect.kind == "artefact" and effect.evidence is None for effect in effects):
        return "artefact"  # visible in the columns
    if search.clocks is not None and not adequacy.is_of_clocks:
        return "unexplained"
    if "artefact" in added:
        is_explained = "artefact" not in unstated and adequacy.is_adequate and not search.is_contradicted
        return "artefact" if is_explained else "unexplained"
    if search.clocks is not None:
        return "artefact"
    if added or search.rejected or search.leaves_more or search.leaves_shifts or not adequacy.is_adequate:
        return "unexplained"
    return "nothing"


def candidate_rows(search: Search) -> list[dict[str, Any]]:
    """Entry `candidates` of the verdict, candidates of the first round: fitted ones by their total, then the others by
    evidence. Effects that are indistinguishable from an added one (TWINS) follow it.
    """
    first = search.rounds[0]
    trials = {trial.candidate.term: trial for round_ in reversed(search.rounds) for trial in round_.trials}
    ambiguous = {trial.candidate.term for round_ in search.rounds for trial in round_.alternatives}
    chosen = [trial.candidate.term for trial in search.added]
    terms = sorted(
        first.evidence, key=lambda term: (-trials[term].total if term in trials else np.inf, -first.z_score[term])
    )
    rows = []
    for term in terms:
        candidate, trial = search.layout.candidates[term], trials.get(term)
        rows.append(
            {
                "name": term.effect,
                "kind": candidate.kind,
                "variables": list(candidate.variables),
                "evidence": first.evidence[term],
                "z_score": first.z_score[term],
                "gain": None if trial is None else trial.gain,
                "check": None if trial is None else trial.check,
                "ambiguous": term in ambiguous,
                "told_apart_by": distinguishing_data(term, chosen) if term in ambiguous else None,
                "result": result_of(search, term),
            }
        )
    for term in chosen:
        for twin in TWINS.get(term.effect, ()):
            place = next(place for place, row in enumerate(rows) if row["name"] == term.effect)
            of_twin = {"name": twin, "ambiguous": True, "told_apart_by": distinguishing_data(Term(twin), chosen)}
            rows.insert(place + 1, rows[place] | of_twin | {"result": "not_distinguished"})
    return rows


def unseen(search: Search) -> list[dict[str, Any]]:
    """Smallest strength at which each named effect that the calibrated model lacks would be accepted in these data,
    entry `unseen` of the verdict; null if the data contain no information on it.

    The strength is that of the effect's first parameter, with the evidence that its expected score gives. Fitted and
    check drivers must reach the evidence that exceeds chance and the least total, or the total that suffices alone. A
    delay must also be long enough to be a reaction time.
    """
    rows, threshold = [], search.null.threshold(THRESHOLDS.candidate_z_score)
    for term, score in search.first_scores.items():
        candidate = search.layout.candidates.get(term)
        if (
            candidate is None
            or term == EARLY_LEADER
            or term in search.first.state.active
            or not term.is_effect
            or candidate.directions != candidate.free[: len(candidate.directions)]
        ):
            continue
        parameter, by_chance = EFFECTS[term.effect].parameters[0], search.null.null_mean(term)
        needed = max(
            THRESHOLDS.least_total + by_chance, min(threshold[term], THRESHOLDS.total_below_z_score + by_chance)
        )
        strength = least_strength(score.information, search.layout.scale[list(candidate.directions)], needed)
        if term == REACTION_DELAY:
            strength = max(strength, shortest_delay(search.first.state.data))
        rows.append(
            {
                "name": term.effect,
                "parameter": parameter.name,
                "strength": strength if np.isfinite(strength) else None,
                "unit": parameter.unit,
            }
        )
    return rows
