"""One round of the search for missing effects."""

from collections.abc import Collection
from dataclasses import dataclass, field

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.search.decision import Trial, copies_leader, indistinguishable, is_everywhere, is_of_numerics
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
        dropped: Accepted trials that a later test rejected; after the test of `confirmation`, also those ranked below.
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
    """True unless the trial is a delay within the time resolution, a copy of the leader's acceleration, or a section
    with no end in the data: these fit well for reasons that have nothing to do with drivers or roads.
    """
    return not (is_of_numerics(trial) or copies_leader(trial) or is_everywhere(trial))


def is_significant(trial: Trial, exceeding: Collection[Term]) -> bool:
    """True if a trial may explain the drivers, and the evidence for its candidate exceeds chance or its total gain
    after the fit is large enough.
    """
    return may_explain(trial) and (trial.candidate.term in exceeding or trial.total > THRESHOLDS.total_below_z_score)
