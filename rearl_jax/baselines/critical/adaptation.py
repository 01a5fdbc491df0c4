"""Adaptation of the driver-class shares in rounds: a proposer suggests mixtures, a simulation evaluates them.

Every mixture is simulated with the same random numbers, so a mixture that is proposed again has the same figures.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from rearl_jax.baselines.critical.mixture import ALL_REGULAR, Mixture

GIVEN, START, KNOWN = "given", "start", "known"
"""Origins of mixtures that no proposer gave: set by the user, start of the rounds, known beforehand."""


@dataclass(frozen=True)
class Assessment:
    """Result of rollouts of a mixture.

    Attributes:
        h: Mean Hellinger distance to the threshold scenes [-].
        mape: Mean error of the mean spacing against these scenes [-].
        crashed: Vehicles that crashed.
        near_misses: Vehicle-seconds with a short time to collision.
        n_vehicles: Vehicles of all rollouts.
    """

    h: float
    mape: float
    crashed: int
    near_misses: int
    n_vehicles: int

    @property
    def score(self) -> float:
        """Objective that the search minimises [-]."""
        return self.h + self.mape

    @property
    def crashed_share(self) -> float:
        """Share of the vehicles that crashed [-]."""
        return self.crashed / self.n_vehicles


@dataclass(frozen=True)
class Trial:
    """A mixture that was simulated.

    Attributes:
        number: Number of the round, from 0; all points of a grid are one round.
        mixture: Shares of the classes.
        assessment: Assessment of the mixture.
        attempts: Answers that were requested until one contained the mixture.
        cause: `answered` if a proposer gave the mixture; else the reason why the mixture of the round before was kept,
            or the origin of the mixture.
    """

    number: int
    mixture: Mixture
    assessment: Assessment
    attempts: int
    cause: str


@dataclass(frozen=True)
class Adaptation:
    """The trials of mixtures, and the mixture that was selected for an evaluation.

    Attributes:
        proposer: Origin of the proposals: stats, search, llm, or `GIVEN`.
        mixture: The selected mixture.
        trials: All mixtures that were simulated; none if the user gave the mixture.
        selected: Index of the trial of the selected mixture.
    """

    proposer: str
    mixture: Mixture
    trials: tuple[Trial, ...] = ()
    selected: int = 0

    @property
    def n_rounds(self) -> int:
        """Rounds of proposals; 0 if the mixture was given."""
        proposed = {trial.number for trial in self.trials if trial.cause != START}
        return len(proposed)


@dataclass(frozen=True)
class Proposal:
    """Result of a proposer in a round.

    Attributes:
        mixture: Proposed shares; None without a proposal, which leaves the shares as they are.
        attempts: Answers that were requested.
        cause: `answered`, or the reason why there is no proposal.
    """

    mixture: Mixture | None
    attempts: int
    cause: str


Assess: TypeAlias = Callable[[Sequence[Mixture]], list[Assessment]]
"""Function that simulates mixtures, all in one batch."""

Propose: TypeAlias = Callable[[int, Sequence[Trial]], Proposal]
"""Function that proposes shares in a round, given all trials so far; the last trial has the present shares."""


def best_of(candidates: Sequence[Mixture], assess: Assess, proposer: str) -> Adaptation:
    """The candidate with the lowest score (`Assessment.score`); of equally good candidates the first."""
    trials = tuple(
        Trial(0, mixture, assessment, 0, KNOWN)
        for mixture, assessment in zip(candidates, assess(candidates), strict=True)
    )
    best = int(np.argmin([trial.assessment.score for trial in trials]))
    return Adaptation(proposer, trials[best].mixture, trials, selected=best)


def adapt_by_rounds(
    propose: Propose,
    assess: Assess,
    n_rounds: int,
    proposer: str,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Adaptation:
    """The last valid proposal, whatever its score.

    `ALL_REGULAR` is simulated, then every round proposes and simulates another mixture. So the selected mixture has
    been simulated, too.

    Source: CRITICAL, main.py: the configuration that was accepted last applies.
    """
    trials = [Trial(0, ALL_REGULAR, assess([ALL_REGULAR])[0], 0, START)]
    for number in range(1, n_rounds + 1):
        progress(number - 1, n_rounds)
        proposal, present = propose(number, trials), trials[-1]
        mixture = present.mixture if proposal.mixture is None else proposal.mixture
        assessment = present.assessment if mixture == present.mixture else assess([mixture])[0]
        trials.append(Trial(number, mixture, assessment, proposal.attempts, proposal.cause))
    progress(n_rounds, n_rounds)
    return Adaptation(proposer, trials[-1].mixture, tuple(trials), selected=n_rounds)
