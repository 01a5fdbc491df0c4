"""Result of a search for missing effects, and of each of its rounds."""

from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.candidates import EARLY_LEADER, NAMED_KINDS, Layout, Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.clock_check import ClockCheck
from rearl_jax.discovery.search.decision import Trial, copies_leader, indistinguishable, is_everywhere, is_too_short
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.screen import Score
from rearl_jax.discovery.thresholds import THRESHOLDS


@dataclass(frozen=True)
class Round:
    """One round of the search: all candidates are scored without a fit (screen), the most likely ones are fitted, and
    the best one that is accepted is added to the model.

    Attributes:
        base: The model at the beginning of the round.
        evidence: Evidence for every candidate [nats].
        excess: Evidence for every candidate above the mean of the null distribution [nats].
        z_score: The excess in standard deviations of the null distribution [-].
        exceeding: Candidates whose evidence exceeds chance, and those that are easily confused with them.
        trials: All candidates that were fitted.
        accepted: Accepted trials that no later test rejected, the best first.
        clock_z_score: As `z_score`, for clock offsets.
        contradicted: Trials that the one-step predictions support and simulations contradict.
        dropped: Accepted trials that a later test rejected; after `simulation.confirmed`, also those ranked below.
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
    dropped: list[Trial] = field(default_factory=list)

    @property
    def chosen(self) -> Trial | None:
        """The trial whose candidate is added; None if no trial is accepted."""
        return self.accepted[0] if self.accepted else None

    @property
    def possible(self) -> list[Trial]:
        """All trials that may explain the drivers, and that neither simulations nor later tests reject."""
        denied = {trial.candidate.term for trial in (*self.contradicted, *self.dropped)}
        return [trial for trial in self.trials if may_explain(trial) and trial.candidate.term not in denied]

    @property
    def is_beaten(self) -> bool:
        """True if a significant trial that was not added is better than the added one."""
        chosen = self.chosen
        return chosen is not None and any(
            trial.beats(chosen) and is_significant(trial, self.exceeding) for trial in self.possible
        )

    @property
    def alternatives(self) -> list[Trial]:
        """Trials that the data cannot distinguish from the added one."""
        return indistinguishable(self.accepted)[1:] if self.accepted else []


def may_explain(trial: Trial) -> bool:
    """True unless the trial is a delay too short for a reaction, a copy of the leader's acceleration, or a section with
    no end in the data: these fit well for reasons that have nothing to do with drivers or roads.
    """
    return not (is_too_short(trial) or copies_leader(trial) or is_everywhere(trial))


def is_significant(trial: Trial, exceeding: Collection[Term]) -> bool:
    """True if a trial may explain the drivers, and the evidence for its candidate exceeds chance or its total gain
    after the fit is large enough.
    """
    return may_explain(trial) and (trial.candidate.term in exceeding or trial.total > THRESHOLDS.total_below_z_score)


@dataclass
class Search:
    """Result of a search, round by round.

    Attributes:
        layout: The candidates and their parameters.
        null: Null distribution of the evidence: that of drives simulated by the calibrated model, with nothing missing.
        first_scores: Scores of all candidates under the calibrated model.
        checked: The check drivers, with corrected clocks if those of the fitted drivers were corrected.
        clocks: Clock offsets that the data were corrected for; None without a correction.
        rounds: One round per added effect, and usually a last one in which none was added.
        lane_changes: Trials of the effects of lane changes, each against the model without it.
        rejected: Trials that were added and then removed, because they made the simulation of the check drivers worse
            or, if in `unpredictive`, because they did not predict the check drivers significantly better.
        excluded: Candidates, clock offsets included, that are not searched for.
        unpredictive: Rejected effects with which the check drivers are not predicted significantly better.
        of_bounds: Added effects that do not hold if drivers' parameters may leave their bounds.
        of_model: Added effects that another car-following model, about as likely, does without.
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
    of_model: frozenset[Term] = frozenset()
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
        return [round_.chosen for round_ in self.rounds if round_.chosen is not None]

    def fitted_trials(
        self, covariance: Float[np.ndarray, "free free"]
    ) -> list[tuple[Trial, list[Trial], Float[np.ndarray, "of_effect of_effect"]]]:
        """Effects of the final model, those of lane changes first: the trial of each, all trials that competed
        (including it), and its part of the covariance of the parameters of all effects.
        """
        trials = [(trial, [trial]) for trial in self.lane_changes]
        trials += [(round_.chosen, round_.possible) for round_ in self.rounds if round_.chosen is not None]
        stops = np.cumsum([len(trial.candidate.free) for trial, _ in trials], dtype=int)
        parts = [slice(stop - len(trial.candidate.free), stop) for (trial, _), stop in zip(trials, stops, strict=True)]
        return [(trial, rivals, covariance[part, part]) for (trial, rivals), part in zip(trials, parts, strict=True)]

    def is_stated(self, trial: Trial) -> bool:
        """True if a trial may be reported as an effect of drivers. Of the effects of lane changes, relaxation may be
        reported if it holds; the early response to the next leader may not, because it depends on when the lane column
        of the recording changes.
        """
        if not any(trial is other for other in self.lane_changes):
            return True
        return trial.holds and trial.candidate.term != EARLY_LEADER

    @property
    def is_named(self) -> bool:
        """True if effects were found, and all of them are named effects of drivers or of the road."""
        kinds = {trial.candidate.kind for trial in self.added}
        return bool(kinds) and kinds <= NAMED_KINDS

    @property
    def denied(self) -> list[Trial]:
        """Trials that the innovations (one-step prediction errors) support and that make simulations of the check
        drivers worse, or do not predict them better where that was required.
        """
        return [*self.rejected, *([] if self.added else self.rounds[-1].contradicted)]

    @property
    def is_contradicted(self) -> bool:
        """True if an effect or artefact was denied; a free curve imitates too much to count."""
        return any(not is_free(trial) for trial in self.denied)

    @property
    def leaves_shifts(self) -> bool:
        """True if time shifts between vehicles remain that neither clock offsets nor added effects explain."""
        return self.clocks is None and self.rounds[-1].clock_z_score > THRESHOLDS.unexplained_z_score

    @property
    def leaves_more(self) -> bool:
        """True if the evidence for some candidate still exceeds chance in the last round."""
        return any(z_score > THRESHOLDS.unexplained_z_score for z_score in self.rounds[-1].z_score.values())

    def is_doubtful(self, trial: Trial) -> bool:
        """True if the name of an effect is in doubt."""
        return bool(self.doubts(trial))

    def doubts(self, trial: Trial) -> list[str]:
        """Why the name of an effect is in doubt.

        `of_bounds`: it does not hold if drivers' parameters may leave their bounds. `of_model`: another car-following
        model, about as likely, does without it. `denied`: simulations contradict a trial. `surpassed`: a trial that was
        not added is better. `after_curve`: a free curve was added earlier, and the effect may only fit its remainder.
        `beside_curve`: a free curve over one of its variables was needed in addition, so the effect has another form.
        """
        earlier = takewhile(lambda other: other is not trial, self.added)
        curves = [other.candidate for other in (*self.added, *self.rejected) if is_free(other)]
        variables = set(trial.candidate.variables)
        holds = {
            "of_bounds": trial.candidate.term in self.of_bounds,
            "of_model": trial.candidate.term in self.of_model,
            "denied": self.is_contradicted,
            "surpassed": any(round_.is_beaten for round_ in self.rounds if round_.chosen is trial),
            "after_curve": not is_free(trial) and any(is_free(other) for other in earlier),
            "beside_curve": any(variables & set(curve.variables) for curve in curves if curve != trial.candidate),
        }
        return [reason for reason, is_one in holds.items() if is_one]


def is_free(trial: Trial) -> bool:
    """True if the trial is of a free curve, which can imitate any effect and the remainder of any effect."""
    return trial.candidate.kind == "generic"
