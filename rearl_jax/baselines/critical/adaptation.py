"""Shares proposed, tried out, proposed again: the loop around a function that tries mixtures out.

Every mixture is tried out with the same random numbers, so a mixture that comes again has the same figures.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from rearl_jax.baselines.critical.mixture import ALL_REGULAR, Mixture

GIVEN, START, KNOWN = "given", "start", "known"
"""Causes of mixtures that nobody was asked for: set by the user, the first one, known from the start."""


@dataclass(frozen=True)
class Assessment:
    """Result of rollouts of a mixture.

    Attributes:
        h: Mean Hellinger distance to the threshold scenes [-].
        mape: Mean error of the mean spacing to them [-].
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
    """A mixture that was tried out.

    Attributes:
        number: Round, from 0; all points of a grid are one round.
        mixture: Its shares.
        assessment: Its assessment.
        attempts: Answers that were asked for to get it.
        cause: `answered` where somebody gave it; else why it is that of the round before, or where it comes from.
    """

    number: int
    mixture: Mixture
    assessment: Assessment
    attempts: int
    cause: str


@dataclass(frozen=True)
class Adaptation:
    """Search that gave the mixture of an evaluation.

    Attributes:
        proposer: Origin of the proposals: stats, search, llm, or `GIVEN`.
        mixture: The one that is kept.
        trials: All that were tried out; none where it was given.
        kept: Index of the trial that is kept.
    """

    proposer: str
    mixture: Mixture
    trials: tuple[Trial, ...] = ()
    kept: int = 0

    @property
    def n_rounds(self) -> int:
        """Rounds of proposals; 0 where the mixture was given."""
        proposed = {trial.number for trial in self.trials if trial.cause != START}
        return len(proposed)


@dataclass(frozen=True)
class Proposal:
    """Result of a proposer in a round.

    Attributes:
        mixture: The shares; None where it has none, which leaves them as they are.
        attempts: Answers that were asked for.
        cause: `answered`, or why there is none.
    """

    mixture: Mixture | None
    attempts: int
    cause: str


Assess: TypeAlias = Callable[[Sequence[Mixture]], list[Assessment]]
"""Tries mixtures out, all in one batch."""

Propose: TypeAlias = Callable[[int, Sequence[Trial]], Proposal]
"""Proposes shares in a round, given all trials so far; the last one is what is now."""


def best_of(candidates: Sequence[Mixture], assess: Assess, proposer: str) -> Adaptation:
    """The best of some mixtures by the sum of both errors; of equals the first."""
    trials = tuple(
        Trial(0, mixture, assessment, 0, KNOWN)
        for mixture, assessment in zip(candidates, assess(candidates), strict=True)
    )
    best = int(np.argmin([trial.assessment.score for trial in trials]))
    return Adaptation(proposer, trials[best].mixture, trials, best)


def adapt_by_rounds(
    propose: Propose,
    assess: Assess,
    n_rounds: int,
    proposer: str,
    *,
    start: Mixture = ALL_REGULAR,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Adaptation:
    """The last valid proposal, whatever its figures.

    The start is tried out, then every round proposes and tries out; so the mixture that is kept has figures too.

    Source: CRITICAL, main.py: the configuration that was accepted last applies.
    """
    trials = [Trial(0, start, assess([start])[0], 0, START)]
    for number in range(1, n_rounds + 1):
        progress(number - 1, n_rounds)
        proposal, now = propose(number, trials), trials[-1]
        mixture = now.mixture if proposal.mixture is None else proposal.mixture
        assessment = now.assessment if mixture == now.mixture else assess([mixture])[0]
        trials.append(Trial(number, mixture, assessment, proposal.attempts, proposal.cause))
    progress(n_rounds, n_rounds)
    return Adaptation(proposer, trials[-1].mixture, tuple(trials), n_rounds)
