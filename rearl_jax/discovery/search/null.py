"""Null distribution of the evidence, from drives that are simulated with the calibrated model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.screen import evidences, scores
from rearl_jax.discovery.search.simulated_drives import noise_alone
from rearl_jax.discovery.search.slow_variation import slow_variation
from rearl_jax.discovery.thresholds import THRESHOLDS


@dataclass(frozen=True)
class Null:
    """Mean and standard deviation of each candidate's evidence if no effect is missing [nats], from a number of
    simulated data sets, `replicates`.
    """

    mean: dict[Term, float]
    spread: dict[Term, float]
    replicates: int

    def excess(self, evidence: dict[Term, float]) -> dict[Term, float]:
        """Evidence above the null's mean [nats]."""
        return {term: value - max(self.mean[term], THRESHOLDS.least_null_mean) for term, value in evidence.items()}

    def null_mean(self, term: Term) -> float:
        """Mean evidence for a candidate if no effect is missing [nats], at least 0: gains are reduced by it."""
        return max(self.mean[term], 0.0)

    def z_scores(self, evidence: dict[Term, float]) -> dict[Term, float]:
        """Evidence above the null's mean in standard deviations of the null [-]."""
        excess = self.excess(evidence)
        return {term: value / max(self.spread[term], THRESHOLDS.least_null_spread) for term, value in excess.items()}

    def threshold(self, z_score: float) -> dict[Term, float]:
        """Evidence of each candidate at a z-score [nats]."""
        return {
            name: max(self.mean[name], THRESHOLDS.least_null_mean)
            + z_score * max(self.spread[name], THRESHOLDS.least_null_spread)
            for name in self.mean
        }


def null_of(
    solver: Solver,
    state: FitState,
    noise: Noise,
    replicates: int,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> Null:
    """The null distribution of a calibrated state; `progress` is called with the finished and the total replicates.

    Drivers of the simulated data sets change their time gap as slowly as the measured ones do.
    """
    replicated: list[dict[Term, float]] = []
    variation, prior = slow_variation(solver, state, noise, seed), solver.layout.prior
    for states in noise_alone(solver, state, noise, replicates, seed, partial(variation.drawn, state, prior)):
        seen = scores(solver, states)
        replicated += [evidences(state, score, solver.layout) for state, score in zip(states, seen, strict=True)]
        if progress is not None:
            progress(len(replicated), replicates)
    return summarise(replicated)


def summarise(replicated: Sequence[dict[Term, float]]) -> Null:
    """Null distribution from replicates."""
    names = replicated[0]
    values = {name: np.array([evidence[name] for evidence in replicated]) for name in names}
    return Null(
        mean={name: float(value.mean()) for name, value in values.items()},
        spread={name: float(value.std(ddof=1)) if len(value) > 1 else 1.0 for name, value in values.items()},
        replicates=len(replicated),
    )
