"""From measured drivers to what the model lacks: calibrate, screen, fit, check on other drivers, and again."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.base import Base, base_of
from rearl_jax.discovery.observe.candidates import EARLY_LEADER, Layout, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks
from rearl_jax.discovery.observe.fit import Fit, joint_fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.clock_check import ClockCheck, check_clocks, correct_shifts
from rearl_jax.discovery.search.decision import Trial, believed, not_told_apart, trial_of
from rearl_jax.discovery.search.families import confounded, with_families
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.refit import nested, rebased, refit
from rearl_jax.discovery.search.screen import Score, clock_evidence, evidences, scores
from rearl_jax.discovery.search.simulation import simulated
from rearl_jax.discovery.thresholds import THRESHOLDS

UNDERSTATED = frozenset({Term("reaction_delay")})
"""Candidates that are fitted wherever they exceed chance: drivers who were calibrated without a delay have taken most
of it in, and the score, which looks at delays close to none, sees little.
"""

Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Round:
    """One turn of the loop.

    Attributes:
        base: The model at its beginning.
        evidence: Evidence of every candidate [nats].
        excess: Above the null's mean [nats].
        z_score: The same in standard deviations of the null [-].
        exceeding: Candidates whose evidence exceeds chance, with their families.
        trials: All that were fitted.
        accepted: Trials that are accepted, the best first.
        clock_z_score: As `z_score`, of clocks that differ.
        contradicted: Trials that evidence asks for and simulations contradict.
    """

    base: Fit
    evidence: dict[Term, float]
    excess: dict[Term, float]
    z_score: dict[Term, float]
    exceeding: frozenset[Term]
    trials: list[Trial]
    accepted: list[Trial]
    clock_z_score: float = 0.0
    contradicted: list[Trial] = field(default_factory=list)

    @property
    def chosen(self) -> Trial | None:
        """The trial that is added."""
        return self.accepted[0] if self.accepted else None

    @property
    def possible(self) -> list[Trial]:
        """All that were fitted and that simulations do not contradict."""
        denied = {trial.candidate.term for trial in self.contradicted}
        return [trial for trial in self.trials if trial.candidate.term not in denied]

    @property
    def is_beaten(self) -> bool:
        """True if something possible that is not believed fares better than what is added."""
        chosen = self.chosen
        return chosen is not None and any(
            trial.beats(chosen) and _is_significant(trial, self.exceeding) for trial in self.possible
        )

    @property
    def alternatives(self) -> list[Trial]:
        """Trials that cannot be told apart from it."""
        return not_told_apart(self.accepted)[1:] if self.accepted else []


@dataclass
class Search:
    """Everything that was found, round by round.

    Attributes:
        layout: What was looked for.
        null: Evidence where nothing is missing.
        first_scores: Scores of the calibrated model.
        checked: The other drivers as the final model takes them, see `in_time`.
        clocks: Differences between clocks, where the data were corrected for them.
        rounds: One per effect that was added, and the last one, which added none.
        lane_changes: What changes of lane bring with them, against the model without it.
        rejected: What had been added, and made the simulation of other drivers worse.
        excluded: Candidates, or clocks, that are not looked for.
        of_bounds: Added effects that do not hold once drivers' parameters may leave their bounds.
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

    @property
    def before(self) -> Fit:
        """The calibrated model on the data as they were."""
        return self.first if self.clocks is None else self.clocks.base

    @property
    def first(self) -> Fit:
        """The calibrated model without additions."""
        return self.rounds[0].base

    @property
    def last(self) -> Fit:
        """The model with all that was added."""
        chosen = self.rounds[-1].chosen
        return chosen.fit if chosen is not None else self.rounds[-1].base

    @property
    def added(self) -> list[Trial]:
        """Trials that were added, in order."""
        return [turn.chosen for turn in self.rounds if turn.chosen is not None]

    def fitted_trials(
        self, deviations: Float[np.ndarray, " free"]
    ) -> list[tuple[Trial, list[Trial], Float[np.ndarray, " own"]]]:
        """What the final model has beside its drivers, first what changes of lane bring with them.

        Each trial with the possible ones it competed with, and its part of the standard deviations of all numbers that
        were searched.
        """
        trials = [(trial, [trial]) for trial in self.lane_changes]
        trials += [(turn.chosen, turn.possible) for turn in self.rounds if turn.chosen is not None]
        ends = np.cumsum([len(trial.candidate.free) for trial, _ in trials], dtype=int)
        parts = np.split(deviations, ends)[:-1]
        return [(trial, rivals, own) for (trial, rivals), own in zip(trials, parts, strict=True)]

    def is_stated(self, trial: Trial) -> bool:
        """True if a trial may be stated as an effect: what changes of lane bring with them only where it is sure, and
        early answers never, for when a lane column flips is of the recording.
        """
        if not any(trial is other for other in self.lane_changes):
            return True
        return trial.holds and trial.candidate.term != EARLY_LEADER

    @property
    def is_contradicted(self) -> bool:
        """True if an effect or artefact that the drivers' innovations ask for makes their simulation worse."""
        denied = self.rounds[-1].contradicted if not self.added else []
        return any(not is_free(trial) for trial in (*self.rejected, *denied))

    @property
    def leaves_shifts(self) -> bool:
        """True if something is left that shifts pairs of vehicles in time, and is neither clocks nor what was added."""
        return self.clocks is None and self.rounds[-1].clock_z_score > THRESHOLDS.unexplained_z_score

    @property
    def leaves_more(self) -> bool:
        """True if something is left that the other drivers do not confirm in any form, and that is not chance."""
        return any(z_score > THRESHOLDS.unexplained_z_score for z_score in self.rounds[-1].z_score.values())

    def is_doubtful(self, trial: Trial) -> bool:
        """True if a named effect is beaten by what is not believed, comes before what simulations contradict or after a
        free curve, whose remainder it may be, does not hold without bounds of the drivers' parameters, or leaves a
        dependence on what it acts by, which then is another one than it says.
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
    """True if it is a free curve, which approximates whatever there is, and fits what any other form has left."""
    return trial.candidate.kind == "generic"


def search(
    solver: Solver,
    fitted: Measured,
    checked: Measured,
    null_for: Callable[[Fit], Null],
    report: Report,
    *,
    lane_changes: bool = True,
    calibrated: Base | None = None,
    excluded: frozenset[Term] = frozenset(),
    rounds: int | None = None,
) -> Search:
    """The loop: until nothing exceeds chance any more, or nothing that does is accepted.

    Args:
        solver: Fits.
        fitted: Drivers everything is fitted to.
        checked: Other drivers, for the check.
        null_for: The null of the calibrated model.
        report: Called with what is being done, and how far it is.
        lane_changes: Whether what changes of lane bring with them is part of the calibrated model.
        calibrated: The calibrated model where it is known; None to calibrate.
        excluded: Candidates, or clocks, that are not looked for.
        rounds: Rounds after which the loop ends; None for as many as there are effects to add.
    """
    report("calibrating drivers", 0, 1)
    of_lanes = calibrated or base_of(solver, fitted, lane_changes=lane_changes)
    base = of_lanes.fit
    everybody = joint_fit(solver, base, checked)
    null = null_for(everybody)
    (seen,) = scores(solver, [everybody.state])
    outcome = Search(solver.layout, null, seen, checked, excluded=excluded)
    outcome.lane_changes = lane_change_trials(solver, of_lanes, checked)
    clocks = None
    of_clocks = null.z_scores({CLOCK_OFFSET: clock_evidence(everybody.state, seen)})[CLOCK_OFFSET]
    if CLOCK_OFFSET not in excluded and of_clocks > THRESHOLDS.candidate_z_score:
        report("comparing clocks", 0, 1)
        clocks = check_clocks(solver, base, checked)
    while len(outcome.added) <= THRESHOLDS.most_effects:
        turn = _round(solver, base, everybody.state, seen, outcome, report)
        if clocks is not None and not outcome.rounds and (turn.chosen is None or clocks.total > turn.chosen.total):
            # The clocks are corrected in the data, and the loop begins again.
            outcome.clocks, outcome.checked = clocks, clocks.checked
            of_lanes, clocks = base_of(solver, clocks.fitted, lane_changes=lane_changes), None
            base = of_lanes.fit
            outcome.lane_changes = lane_change_trials(solver, of_lanes, outcome.checked)
        else:
            outcome.rounds.append(turn)
            if turn.chosen is None or len(outcome.rounds) == rounds:
                break
            base = turn.chosen.fit
        everybody = joint_fit(solver, base, outcome.checked)
        (seen,) = scores(solver, [everybody.state])
    return outcome


def in_time(solver: Solver, outcome: Search, data: Measured) -> Measured:
    """Drivers as the final model takes them: with their clocks corrected where the fitted ones' were."""
    return data if outcome.clocks is None else correct_shifts(solver, Clocks(data), outcome.clocks.base).data


def _round(
    solver: Solver, base: Fit, everybody: FitState, seen: dict[Term, Score], outcome: Search, report: Report
) -> Round:
    """The next turn from a model and its scores."""
    layout, null, added = solver.layout, outcome.null, outcome.added
    report(f"looking for effects, round {len(added) + 1}", 0, 1)
    left = {CLOCK_OFFSET, *layout.candidates} - {EARLY_LEADER, *base.state.active, *outcome.excluded - {CLOCK_OFFSET}}
    evidence = {term: value for term, value in evidences(everybody, seen, layout).items() if term in left}
    exceeds = {term for term, z_score in null.z_scores(evidence).items() if z_score > THRESHOLDS.candidate_z_score}
    clock_z_score = null.z_scores({CLOCK_OFFSET: evidence.pop(CLOCK_OFFSET)})[CLOCK_OFFSET]
    excess, z_score, known = null.excess(evidence), null.z_scores(evidence), set(evidence)
    if len(added) == THRESHOLDS.most_effects or not exceeds:
        return Round(base, evidence, excess, z_score, frozenset(exceeds & known), [], [], clock_z_score)
    order = sorted(evidence, key=lambda term: -excess[term])
    exceeding = with_families(exceeds, known) & known
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
            [trial for trial in trials if _is_significant(trial, exceeding) and _is_additional(trial, added)]
        )
        # Nothing is added before all that it is easily taken for have been tried as well.
        accepted, contradicted = simulated(solver, other_base, accepted)
        asked = {trial.candidate.term: trial for trial in (*accepted, *contradicted)}
        trials = [asked.get(trial.candidate.term, trial) for trial in trials]
        tried = with_families({trial.candidate.term for trial in accepted[:1]}, known)
        if tried <= fits.keys():
            z_score |= {trial.candidate.term: 0.0 for trial in trials if _is_of_numerics(trial)}
            return Round(
                base, evidence, excess, z_score, frozenset(exceeding), trials, accepted, clock_z_score, contradicted
            )


def lane_change_trials(solver: Solver, base: Base, checked: Measured) -> list[Trial]:
    """Gains of each thing that changes of lane bring with them, against the model with those before it."""
    if not base.extended:
        return []
    fits = [base.bare, *base.extended]
    others = recalibrated(solver, checked, fits)
    return [
        trial_of(solver, after, before.state, other, other_before, 0.0)
        for before, after, other_before, other in zip(fits[:-1], fits[1:], others[:-1], others[1:], strict=True)
    ]


def _is_significant(trial: Trial, exceeding: Collection[Term]) -> bool:
    """True if a candidate exceeds chance in the screen, or gains so much when it is fitted that it needs not."""
    return not _is_of_numerics(trial) and (
        trial.candidate.term in exceeding or trial.total > THRESHOLDS.total_below_z_score
    )


def _is_of_numerics(trial: Trial) -> bool:
    """True if it is a reaction delay of less than two time steps, or than the kernel that positions were smoothed with.

    Whoever decides once in a time step, and has it carried out in the next one, is as late as that without any delay.
    """
    if trial.candidate.term != Term("reaction_delay"):
        return False
    data, delays = trial.fit.state.data, trial.fit.state.theta[list(trial.candidate.free)]
    return bool(np.abs(delays).max() < max(2 * data.dt, data.smoothing))


def _is_additional(trial: Trial, added: list[Trial]) -> bool:
    """True if an effect is more than what another form of an earlier one would have taken in."""
    if added and trial.total < THRESHOLDS.later_share * max(other.total for other in added):
        return False

    def may_be_remainder(other: Trial) -> bool:
        return is_free(trial) or is_free(other) or confounded(trial.candidate.term, other.candidate.term)

    return all(trial.total > THRESHOLDS.confounded_share * other.total for other in added if may_be_remainder(other))
