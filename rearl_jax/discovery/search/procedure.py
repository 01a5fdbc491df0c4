"""The search for missing effects, in rounds: calibrate the model, screen all candidates, fit the likely ones, check
them on other drivers, add the best one.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.base import Base, base_of
from rearl_jax.discovery.observe.candidates import EARLY_LEADER, LENS, Layout, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks
from rearl_jax.discovery.observe.fit import Fit, joint_fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.clock_check import ClockCheck, check_clocks, correct_shifts
from rearl_jax.discovery.search.decision import (
    Trial,
    believed,
    is_of_numerics,
    lane_change_trials,
    trial_of,
)
from rearl_jax.discovery.search.families import confounded, with_families
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.refit import nested, rebased, refit
from rearl_jax.discovery.search.round import Round, is_significant
from rearl_jax.discovery.search.screen import Score, clock_evidence, evidences, scores
from rearl_jax.discovery.search.simulation import is_wrong_lens, makes_simulations_worse, simulated
from rearl_jax.discovery.thresholds import THRESHOLDS

log = logging.getLogger(__name__)

UNDERSTATED = frozenset({Term("reaction_delay")})
"""Candidates that are fitted whenever their evidence exceeds chance. Drivers who are calibrated without a delay imitate
most of it, so the score at a delay of zero understates it.
"""

Report = Callable[[str, int, int], None]


@dataclass
class Search:
    """Result of a search, round by round.

    Attributes:
        layout: The candidates and their parameters.
        null: Distribution of the evidence under the calibrated model if no effect is missing.
        first_scores: Scores of all candidates under the calibrated model.
        checked: The checked drivers, with corrected clocks if those of the fitted drivers were corrected.
        clocks: Clock offsets that the data were corrected for; None without a correction.
        rounds: One round per added effect, and usually a last one in which none was added.
        lane_changes: Trials of the effects of lane changes, each against the model without it.
        rejected: Trials that were added and then removed, because they made the simulation of other drivers worse or,
            if in `unpredictive`, because they did not surely improve their prediction.
        excluded: Candidates, possibly clock offsets, that are not searched for.
        unpredictive: Rejected effects with which predictions of other drivers are not surely better.
        of_bounds: Added effects that do not hold if drivers' parameters may leave their bounds.
    """

    layout: Layout
    null: Null
    first_scores: dict[Term, Score]
    checked: Measured
    clocks: ClockCheck | None = None
    rounds: list[Round] = field(default_factory=list)
    lane_changes: list[Trial] = field(default_factory=list)
    rejected: list[Trial] = field(default_factory=list)
    excluded: frozenset[Term] = frozenset()
    of_bounds: frozenset[Term] = frozenset()
    unpredictive: frozenset[Term] = frozenset()

    @property
    def before(self) -> Fit:
        """The calibrated model on the data as measured, without corrected clocks."""
        return self.first if self.clocks is None else self.clocks.base

    @property
    def first(self) -> Fit:
        """The calibrated model without added effects, on the data that were searched."""
        return self.rounds[0].base

    @property
    def last(self) -> Fit:
        """The model with all added effects."""
        chosen = self.rounds[-1].chosen
        return chosen.fit if chosen is not None else self.rounds[-1].base

    @property
    def added(self) -> list[Trial]:
        """Added trials, in their order."""
        return [turn.chosen for turn in self.rounds if turn.chosen is not None]

    def fitted_trials(
        self, deviations: Float[np.ndarray, " free"]
    ) -> list[tuple[Trial, list[Trial], Float[np.ndarray, " own"]]]:
        """Effects of the final model, those of lane changes first: the trial of each, the trials it competed with, and
        the standard deviations of its parameters.

        Args:
            deviations: Standard deviations of the parameters of all effects, concatenated.
        """
        trials = [(trial, [trial]) for trial in self.lane_changes]
        trials += [(turn.chosen, turn.possible) for turn in self.rounds if turn.chosen is not None]
        stops = np.cumsum([len(trial.candidate.free) for trial, _ in trials], dtype=int)
        parts = np.split(deviations, stops)[:-1]
        return [(trial, rivals, part) for (trial, rivals), part in zip(trials, parts, strict=True)]

    def is_stated(self, trial: Trial) -> bool:
        """True if a trial may be reported as an effect of drivers. An effect of lane changes may be if it holds, but
        not the early response to the next leader, because the recording decides when its lane column changes.
        """
        if not any(trial is other for other in self.lane_changes):
            return True
        return trial.holds and trial.candidate.term != EARLY_LEADER

    @property
    def is_contradicted(self) -> bool:
        """True if an effect or artefact that the innovations support makes the simulation of drivers worse."""
        denied = self.rounds[-1].contradicted if not self.added else []
        return any(not is_free(trial) for trial in (*self.rejected, *denied))

    @property
    def leaves_shifts(self) -> bool:
        """True if time shifts between vehicles remain that neither clock offsets nor added effects explain."""
        return self.clocks is None and self.rounds[-1].clock_z_score > THRESHOLDS.unexplained_z_score

    @property
    def leaves_more(self) -> bool:
        """True if the evidence for some candidate still exceeds chance although no candidate is confirmed by the other
        drivers.
        """
        return any(z_score > THRESHOLDS.unexplained_z_score for z_score in self.rounds[-1].z_score.values())

    def is_doubtful(self, trial: Trial) -> bool:
        """True if the name of an effect is in doubt.

        There are five reasons: it does not hold if drivers' parameters may leave their bounds; simulations contradict a
        trial; a trial that was not added is better; a free curve was added earlier, whose remainder it may be; or a
        free curve over one of its variables was needed in addition, so that the dependence on it is another one.
        """
        if trial.candidate.term in self.of_bounds:
            return True
        if self.is_contradicted or any(turn.is_beaten for turn in self.rounds if turn.chosen is trial):
            return True
        earlier = takewhile(lambda other: other is not trial, self.added)
        if not is_free(trial) and any(is_free(other) for other in earlier):
            return True
        curves = [other.candidate for other in (*self.added, *self.rejected) if is_free(other)]
        return any(
            set(curve.variables) & set(trial.candidate.variables) for curve in curves if curve != trial.candidate
        )


def is_free(trial: Trial) -> bool:
    """True if the trial is of a free curve, which can imitate any effect and the remainder of any effect."""
    return trial.candidate.kind == "generic"


def search(
    solver: Solver,
    fitted: Measured,
    checked: Measured,
    null_for: Callable[[Fit, int], Null],
    report: Report,
    *,
    lane_changes: bool = True,
    calibrated: Base | None = None,
    excluded: frozenset[Term] = frozenset(),
    rounds: int | None = None,
) -> Search:
    """Rounds until no candidate exceeds chance, or none of those that do is accepted.

    Args:
        solver: Solver of the car-following model.
        fitted: Drivers that all models are fitted to.
        checked: Other drivers, for the check.
        null_for: Function from a calibrated model and the number of effects added to it to its null distribution.
        report: Called with a description of the present step, the number of its parts done, and that of all parts.
        lane_changes: Whether the calibrated model contains the effects of lane changes.
        calibrated: The calibrated model if it is known; None to calibrate it.
        excluded: Candidates, possibly clock offsets, that are not searched for.
        rounds: Largest number of rounds; None for no limit.
    """
    report("calibrating drivers", 0, 1)
    of_lanes = calibrated or base_of(solver, fitted, lane_changes=lane_changes)
    base = of_lanes.fit
    all_drivers = joint_fit(solver, base, checked)
    null = null_for(all_drivers, 0)
    (seen,) = scores(solver, [all_drivers.state])
    outcome = Search(solver.layout, null, seen, checked, excluded=excluded)
    outcome.lane_changes = lane_change_trials(solver, of_lanes, checked)
    clocks = None
    of_clocks = null.z_scores({CLOCK_OFFSET: clock_evidence(all_drivers.state, seen)})[CLOCK_OFFSET]
    if CLOCK_OFFSET not in excluded and of_clocks > THRESHOLDS.candidate_z_score:
        report("comparing clocks", 0, 1)
        clocks = check_clocks(solver, base, checked)
    while len(outcome.added) <= THRESHOLDS.most_effects:
        turn = _round(solver, base, all_drivers.state, seen, null, outcome, report)
        corrected = None
        if clocks is not None and not outcome.rounds and (turn.chosen is None or clocks.total > turn.chosen.total):
            corrected = base_of(solver, clocks.fitted, lane_changes=lane_changes)
            (before,), (after,) = (
                recalibrated(solver, data, [fit]) for data, fit in ((checked, base), (clocks.checked, corrected.fit))
            )
            if makes_simulations_worse(solver, before, after):
                log.info("corrected clocks make simulations of the check drivers worse: not corrected")
                corrected, clocks = None, None
        if clocks is not None and corrected is not None:
            # The data are replaced by those with corrected clocks, and the first round is repeated.
            outcome.clocks, outcome.checked = clocks, clocks.checked
            base, clocks = corrected.fit, None
            outcome.lane_changes = lane_change_trials(solver, corrected, outcome.checked)
        elif is_wrong_lens(solver, turn.base, turn.chosen, outcome.checked):
            log.info("a corrected camera distortion makes simulations of the check drivers worse: not corrected")
            outcome.excluded |= {LENS}
            continue
        else:
            outcome.rounds.append(turn)
            if turn.chosen is None or len(outcome.rounds) == rounds:
                break
            base = turn.chosen.fit
        all_drivers = joint_fit(solver, base, outcome.checked)
        (seen,) = scores(solver, [all_drivers.state])
        if outcome.added and fitted.fused_errors is not None:
            # What the added effect explains had counted as drivers' noise, beside which errors of positions show less.
            null = null_for(all_drivers, len(outcome.added))
    return outcome


def in_time(solver: Solver, outcome: Search, data: Measured) -> Measured:
    """Other drivers with corrected clocks if those of the fitted drivers were corrected."""
    return data if outcome.clocks is None else correct_shifts(solver, Clocks(data), outcome.clocks.base).data


def _round(
    solver: Solver,
    base: Fit,
    all_drivers: FitState,
    seen: dict[Term, Score],
    null: Null,
    outcome: Search,
    report: Report,
) -> Round:
    """The next round, from a model, its scores and their null distribution."""
    layout, added = solver.layout, outcome.added
    report(f"searching for effects, round {len(added) + 1}", 0, 1)
    excluded = {EARLY_LEADER, *base.state.active, *outcome.excluded - {CLOCK_OFFSET}}
    remaining = {CLOCK_OFFSET, *layout.candidates} - excluded
    evidence = {term: value for term, value in evidences(all_drivers, seen, layout).items() if term in remaining}
    exceeds = {term for term, z_score in null.z_scores(evidence).items() if z_score > THRESHOLDS.candidate_z_score}
    clock_z_score = null.z_scores({CLOCK_OFFSET: evidence.pop(CLOCK_OFFSET)})[CLOCK_OFFSET]
    excess, z_score, known = null.excess(evidence), null.z_scores(evidence), set(evidence)
    screened = partial(Round, evidence=evidence, excess=excess, z_score=z_score, clock_z_score=clock_z_score)
    if len(added) == THRESHOLDS.most_effects or not exceeds:
        return screened(base=base, exceeding=frozenset(exceeds & known), trials=[], accepted=[])
    order = sorted(evidence, key=lambda term: -excess[term])
    exceeding = frozenset(with_families(exceeds, known) & known)
    tried = {term for term in order[: THRESHOLDS.leading_fitted] if excess[term] > THRESHOLDS.fitting_excess}
    tried |= with_families({term for term in order[:2] if term in tried} | exceeds & {CLOCK_OFFSET}, known) & known
    tried |= exceeds & UNDERSTATED & known
    fits: dict[Term, Fit] = {}
    while True:
        new = [layout.candidates[term] for term in order if term in tried - fits.keys()]
        fits |= refit(solver, base, new, seen, lambda k, n: report("fitting candidates", k, n))
        base = rebased(solver, base, fits)
        fits = nested(solver, base, fits)
        report("checking on other drivers", 0, 1)
        other_base, *others = recalibrated(solver, outcome.checked, [base, *fits.values()])
        trials = [
            trial_of(solver, fit, base.state, other, other_base, null.null_mean(term))
            for (term, fit), other in zip(fits.items(), others, strict=True)
        ]
        accepted = believed(
            [trial for trial in trials if is_significant(trial, exceeding) and _is_additional(trial, added)]
        )
        # A candidate is added only after all candidates that it is easily confused with have been tried.
        accepted, contradicted = simulated(solver, other_base, accepted)
        simulated_trials = {trial.candidate.term: trial for trial in (*accepted, *contradicted)}
        trials = [simulated_trials.get(trial.candidate.term, trial) for trial in trials]
        tried = with_families({trial.candidate.term for trial in accepted[:1]}, known)
        if tried <= fits.keys():
            z_score |= {trial.candidate.term: 0.0 for trial in trials if is_of_numerics(trial)}
            return screened(base=base, exceeding=exceeding, trials=trials, accepted=accepted, contradicted=contradicted)


def _is_additional(trial: Trial, added: list[Trial]) -> bool:
    """True if an effect gains more than the remainder of an earlier effect of another form would."""
    if added and trial.total < THRESHOLDS.later_share * max(other.total for other in added):
        return False

    def may_be_remainder(other: Trial) -> bool:
        return is_free(trial) or is_free(other) or confounded(trial.candidate.term, other.candidate.term)

    return all(trial.total > THRESHOLDS.confounded_share * other.total for other in added if may_be_remainder(other))
