"""The search for missing effects, in rounds: calibrate the model, screen all candidates, fit the likely ones, check
them on other drivers, add the best one.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rearl_jax.discovery.observe.base import Base, base_of
from rearl_jax.discovery.observe.candidates import EARLY_LEADER, LENS, NAMED_KINDS, REACTION_DELAY, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks
from rearl_jax.discovery.observe.fit import Fit, joint_fit, recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.clock_check import check_clocks, correct_shifts
from rearl_jax.discovery.search.decision import (
    Trial,
    believed,
    imitating,
    is_too_short,
    lane_change_trials,
    trial_of,
)
from rearl_jax.discovery.search.families import confounded, with_families
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.outcome import Round, Search, is_free, is_significant
from rearl_jax.discovery.search.refit import nested, rebased, refit
from rearl_jax.discovery.search.screen import Score, clock_evidence, evidences, scores
from rearl_jax.discovery.search.simulation import is_wrong_lens, makes_simulations_worse, simulated
from rearl_jax.discovery.thresholds import THRESHOLDS

log = logging.getLogger(__name__)

UNDERSTATED = frozenset({REACTION_DELAY})
"""Candidates that are fitted whenever their evidence exceeds chance. Drivers who are calibrated without a delay imitate
most of it, so the score at a delay of zero understates it.
"""

Report = Callable[[str, int, int], None]
"""Function of a description of the present step, the number of its parts done, and that of all parts."""

NullFor = Callable[[Fit, int], Null]
"""Function from a calibrated model and the number of effects added to it to its null distribution."""


def search(
    solver: Solver,
    fitted: Measured,
    checked: Measured,
    null_for: NullFor,
    report: Report,
    *,
    lane_changes: bool = True,
    calibrated: Base | None = None,
    excluded: frozenset[Term] = frozenset(),
    rounds: int | None = None,
    names_only: bool = False,
) -> Search:
    """Search in rounds, until no candidate exceeds chance, or none of those that do is accepted.

    Args:
        solver: Solver of the car-following model.
        fitted: Drivers that all models are fitted to.
        checked: Other drivers, for the check.
        null_for: Null distributions, see `NullFor`.
        report: Called with the progress, see `Report`.
        lane_changes: Whether the calibrated model contains the effects of lane changes.
        calibrated: The calibrated model if it is known; None to calibrate it.
        excluded: Candidates, clock offsets included, that are not searched for.
        rounds: Largest number of rounds; None for no limit.
        names_only: Whether the search ends once a free curve or an artefact is added, because only named effects count.
    """
    report("calibrating drivers", 0, 1)
    of_lanes = calibrated or base_of(solver, fitted, lane_changes=lane_changes)
    base = of_lanes.fit
    all_drivers = joint_fit(solver, base, checked)
    null = null_for(all_drivers, 0)
    (seen,) = scores(solver, [all_drivers.state])
    screen = _Screen(all_drivers, seen, null)
    outcome = Search(solver.layout, null, seen, checked, excluded=excluded)
    outcome.lane_changes = lane_change_trials(solver, of_lanes, checked)
    clocks = None
    of_clocks = null.z_scores({CLOCK_OFFSET: clock_evidence(all_drivers.state, seen)})[CLOCK_OFFSET]
    if CLOCK_OFFSET not in excluded and of_clocks > THRESHOLDS.candidate_z_score:
        report("comparing clocks", 0, 1)
        clocks = check_clocks(solver, base, checked)
    while True:
        round_ = _round(solver, base, screen, outcome, report)
        corrected = None
        if clocks is not None and not outcome.rounds and (round_.chosen is None or clocks.total > round_.chosen.total):
            corrected = base_of(solver, clocks.fitted, lane_changes=lane_changes)
            before = recalibrated(solver, checked, base)
            if makes_simulations_worse(solver, before, recalibrated(solver, clocks.checked, corrected.fit)):
                log.info("corrected clocks make simulations of the check drivers worse: not corrected")
                corrected, clocks = None, None
        if clocks is not None and corrected is not None:
            # The data are replaced by those with corrected clocks, and the first round is repeated.
            outcome.clocks, outcome.checked = clocks, clocks.checked
            base, clocks = corrected.fit, None
            outcome.lane_changes = lane_change_trials(solver, corrected, outcome.checked)
        elif is_wrong_lens(solver, round_.base, round_.chosen, outcome.checked):
            log.info("a corrected camera distortion makes simulations of the check drivers worse: not corrected")
            outcome.excluded |= {LENS}
            continue
        else:
            outcome.rounds.append(round_)
            if round_.chosen is None or len(outcome.rounds) == rounds:
                break
            if names_only and round_.chosen.candidate.kind not in NAMED_KINDS:
                break
            base = round_.chosen.fit
        screen = _screen(solver, base, outcome, null_for)
    return outcome


def with_predictive_effects(
    solver: Solver,
    outcome: Search,
    most_predictive: Callable[[Fit, Sequence[Trial]], Trial | None],
    null_for: NullFor,
    report: Report,
) -> Search:
    """The search with only those additions that predict other drivers better; `outcome` itself if all of them do.

    `most_predictive` gets a model and trials that were added to it, the best first; it returns the first trial that
    predicts other drivers better than the model, None if none does.

    An addition that does not is replaced by the next best trial of its round, and the rounds after it are repeated
    without its candidate.
    """
    kept = replace(outcome, rounds=[], rejected=list(outcome.rejected))
    stored = list(outcome.rounds)
    round_ = stored.pop(0)
    while True:
        report(f"predicting other drivers, round {len(kept.added) + 1}", 0, 1)
        rejected = {trial.candidate.term for trial in kept.rejected}
        possible = [trial for trial in (*round_.dropped, *round_.accepted) if trial.candidate.term not in rejected]
        chosen = most_predictive(round_.base, possible)
        first = len(possible) if chosen is None else possible.index(chosen)
        failed, accepted = possible[:first], possible[first:]
        if failed or chosen is not round_.chosen:
            stored.clear()
        terms = frozenset(trial.candidate.term for trial in failed)
        kept = replace(
            kept,
            rounds=[*kept.rounds, replace(round_, accepted=accepted, dropped=[*round_.dropped, *failed])],
            rejected=[*kept.rejected, *failed],
            unpredictive=kept.unpredictive | terms,
            excluded=kept.excluded | terms,
        )
        if chosen is None:
            is_unchanged = not kept.unpredictive and len(kept.added) == len(outcome.added)
            return outcome if is_unchanged else kept
        round_ = (
            stored.pop(0)
            if stored
            else _round(solver, chosen.fit, _screen(solver, chosen.fit, kept, null_for), kept, report)
        )


def in_time(solver: Solver, outcome: Search, data: Measured) -> Measured:
    """Other drivers with corrected clocks if those of the fitted drivers were corrected."""
    return data if outcome.clocks is None else correct_shifts(solver, Clocks(data), outcome.clocks.base).data


@dataclass(frozen=True)
class _Screen:
    """Scores of all candidates under a model that is calibrated to the fitted and the check drivers, and their null
    distribution.
    """

    all_drivers: Fit
    seen: dict[Term, Score]
    null: Null


def _screen(solver: Solver, base: Fit, outcome: Search, null_for: NullFor) -> _Screen:
    """Scores of all candidates under a model with the effects added so far."""
    all_drivers, null = joint_fit(solver, base, outcome.checked), outcome.null
    (seen,) = scores(solver, [all_drivers.state])
    if outcome.added and base.state.data.fused_errors is not None:
        # The added effect had counted as drivers' noise. With less noise, position errors have more influence on the
        # evidence, so the null distribution is simulated again.
        null = null_for(all_drivers, len(outcome.added))
    return _Screen(all_drivers, seen, null)


def _round(solver: Solver, base: Fit, screen: _Screen, outcome: Search, report: Report) -> Round:
    """The next round, from a model and the scores of candidates under it."""
    report(f"searching for effects, round {len(outcome.added) + 1}", 0, 1)
    screened, exceeds = _screened(solver, base, screen, outcome)
    if len(outcome.added) == THRESHOLDS.most_effects or not exceeds:
        return screened
    known = set(screened.evidence)
    screened = replace(screened, exceeding=frozenset(with_families(exceeds, known) & known))
    order = sorted(screened.evidence, key=lambda term: -screened.excess[term])
    tried, fits = _tried_first(screened, order, exceeds), {}
    while True:
        new = [solver.layout.candidates[term] for term in order if term in tried - fits.keys()]
        fits |= refit(solver, base, new, screen.seen, lambda k, n: report("fitting candidates", k, n))
        base = rebased(solver, base, fits)
        fits = nested(solver, base, fits)
        report("checking on other drivers", 0, 1)
        checked = _checked(solver, replace(screened, base=base), fits, screen.null, outcome)
        # A candidate is added only after all candidates that it is easily confused with have been tried.
        tried = with_families({trial.candidate.term for trial in checked.accepted[:1]}, known)
        if tried <= fits.keys():
            return checked


def _screened(solver: Solver, base: Fit, screen: _Screen, outcome: Search) -> tuple[Round, set[Term]]:
    """A round without trials, and all terms whose evidence exceeds chance, clock offsets included."""
    layout, null = solver.layout, screen.null
    excluded = {EARLY_LEADER, *base.state.active, *outcome.excluded - {CLOCK_OFFSET}}
    remaining = {CLOCK_OFFSET, *layout.candidates} - excluded
    evidence = {
        term: value
        for term, value in evidences(screen.all_drivers.state, screen.seen, layout).items()
        if term in remaining
    }
    exceeds = {term for term, z_score in null.z_scores(evidence).items() if z_score > THRESHOLDS.candidate_z_score}
    clock_z_score = null.z_scores({CLOCK_OFFSET: evidence.pop(CLOCK_OFFSET)})[CLOCK_OFFSET]
    screened = Round(
        base=base,
        evidence=evidence,
        excess=null.excess(evidence),
        z_score=null.z_scores(evidence),
        exceeding=frozenset(exceeds & evidence.keys()),
        trials=[],
        accepted=[],
        clock_z_score=clock_z_score,
    )
    return screened, exceeds


def _tried_first(screened: Round, order: Sequence[Term], exceeds: set[Term]) -> set[Term]:
    """Candidates that are fitted first, of all in the order of their excess: the leading ones, those that are easily
    confused with the best two or with clock offsets, and understated ones.
    """
    known = set(screened.evidence)
    tried = {term for term in order[: THRESHOLDS.leading_fitted] if screened.excess[term] > THRESHOLDS.fitting_excess}
    tried |= with_families({term for term in order[:2] if term in tried} | exceeds & {CLOCK_OFFSET}, known) & known
    return tried | exceeds & UNDERSTATED & known


def _checked(solver: Solver, screened: Round, fits: Mapping[Term, Fit], null: Null, outcome: Search) -> Round:
    """The round with a trial of every fit on the check drivers, and with the accepted trials."""
    base = screened.base
    other_base, *others = (recalibrated(solver, outcome.checked, fit) for fit in (base, *fits.values()))
    trials = [
        trial_of(solver, fit, base.state, other, other_base, null.null_mean(term))
        for (term, fit), other in zip(fits.items(), others, strict=True)
    ]
    imitations = imitating(trials)
    significant = [
        trial for trial in trials if is_significant(trial, screened.exceeding) and _is_additional(trial, outcome.added)
    ]
    accepted = believed([trial for trial in significant if trial.candidate.term not in imitations])
    accepted, contradicted = simulated(solver, other_base, accepted)
    simulated_trials = {trial.candidate.term: trial for trial in (*accepted, *contradicted)}
    trials = [simulated_trials.get(trial.candidate.term, trial) for trial in trials]
    otherwise_explained = [*(trial.candidate.term for trial in trials if is_too_short(trial)), *imitations]
    z_score = screened.z_score | dict.fromkeys(otherwise_explained, 0.0)
    return replace(screened, z_score=z_score, trials=trials, accepted=accepted, contradicted=contradicted)


def _is_additional(trial: Trial, added: list[Trial]) -> bool:
    """True if an effect gains more than it would by only fitting the remainder of an earlier effect."""
    if added and trial.total < THRESHOLDS.later_share * max(other.total for other in added):
        return False

    def may_be_remainder(other: Trial) -> bool:
        return is_free(trial) or is_free(other) or confounded(trial.candidate.term, other.candidate.term)

    return all(trial.total > THRESHOLDS.confounded_share * other.total for other in added if may_be_remainder(other))
