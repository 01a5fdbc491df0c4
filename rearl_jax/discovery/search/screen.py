"""The screen: evidence for each candidate, from derivatives at the base model alone.

The score of a candidate is the product of the innovations with its derivative, after projecting out everything that
drivers' own parameters, their population and already added candidates can imitate. Its Laplace evidence includes a
penalty for the width of the prior. The smallest evidence over leaving out one driver is used, so that no single driver
decides.

Source: score (Lagrange multiplier) test, Rao (1948); Laplace approximation of the evidence, MacKay, Neural Comput. 4
(1992) 415.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe import clocks
from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.projection import mean_projections, own_projection
from rearl_jax.discovery.observe.solver import Solver

PRIOR_WIDTHS = (0.35, 1.0, 2.0)
"""Tested widths of the prior, as multiples of the candidate's scale [-]; the best one is used."""


@dataclass(frozen=True)
class Score:
    """Score and information of one candidate's directions, with everything that imitates them projected out.

    Attributes:
        score: Scores of all drivers together.
        information: Information of all drivers together.
        driver_score, driver_information: Score and information of each driver.
    """

    score: Float[np.ndarray, " directions"]
    information: Float[np.ndarray, "directions directions"]
    driver_score: Float[np.ndarray, "drivers directions"]
    driver_information: Float[np.ndarray, "drivers directions directions"]

    def fitted(self) -> Float[np.ndarray, " directions"]:
        """The linear fit of theta, without a prior."""
        return np.linalg.lstsq(self.information, self.score, rcond=1e-9)[0]


def scores(solver: Solver, states: Sequence[FitState]) -> list[dict[Term, Score]]:
    """Scores of every candidate in solved states with the same added candidates."""
    layout = solver.layout
    blocks = layout.blocks
    numbered = {
        term: (blocks.index(candidate.directions), candidate.directions)
        for term, candidate in layout.candidates.items()
    }
    numbered[clocks.CLOCK_OFFSET] = len(blocks), tuple(range(layout.size, layout.size + clocks.MOST_LEADERS))
    return [
        _scores(state, sums, numbered, solver.free(state), layout)
        for state, sums in zip(states, solver.sensitivity_sums(states), strict=True)
    ]


def _scores(
    state: FitState,
    sums: dict[str, np.ndarray],
    groups: dict[Term, tuple[int, tuple[int, ...]]],
    free: np.ndarray,
    layout: Layout,
) -> dict[Term, Score]:
    """Scores of one solved state, with nuisance parameters projected out one after the other: the drivers' own
    parameters, the population means of cars and of trucks, and the parameters of added effects, at the indices `free`
    of theta (Schur complements). `groups` are, for each candidate, the number of the block in `sums` and the indices
    among all directions of theta.
    """
    n_kept, n_own = len(free), layout.prior.size
    variances = state.variances
    gradient, nuisance = sums["gradient"] / variances[:, None], sums["nuisance"] / variances[:, None, None]
    own = own_projection(state, gradient, nuisance[:, :n_own])
    coupling, response, driver_score = own.coupling, own.response, -own.gradient
    score = driver_score.sum(axis=0)
    kept = nuisance[:, n_own:, n_own:] - np.einsum("dij,dik->djk", coupling[:, :, free], response)
    kept = kept.sum(axis=0)  # [kept, parameters and clocks]
    means = list(mean_projections(state, layout.prior, own))
    for mean in means:
        score = score + mean.answer.T @ mean.pull
        kept = kept - mean.coupled[:, free].T @ mean.answer
    across = np.zeros((score.size, n_kept))
    if n_kept:
        scale = layout.scale[free]
        inner = kept[:, free] + np.diag(scale**-2.0)
        across = np.linalg.solve(inner, kept).T
        score = score - across @ (score[free] - (state.theta - layout.reference)[free] / scale**2)
    scores = {}
    for term, (number, group) in groups.items():
        index = np.array(group)
        block_of_driver = sums[f"block_{number}"] / variances[:, None, None]
        block_of_driver = block_of_driver - np.einsum("dij,dik->djk", coupling[:, :, index], response[:, :, index])
        information = block_of_driver.sum(axis=0) - across[index] @ kept[:, index]
        for mean in means:
            information = information - mean.coupled[:, index].T @ mean.answer[:, index]
        scores[term] = Score(score[index], (information + information.T) / 2, driver_score[:, index], block_of_driver)
    return scores


def clock_evidence(state: FitState, scores: dict[Term, Score]) -> float:
    """Evidence [nats] for clock offsets, from the scores of a state."""
    score = scores[clocks.CLOCK_OFFSET]
    return clocks.Clocks(state.data).evidence(score.driver_score, score.driver_information)


def evidences(state: FitState, scores: dict[Term, Score], layout: Layout) -> dict[Term, float]:
    """Evidence [nats] for every candidate; if it is positive, the smallest value over leaving out one driver."""
    evidence = {clocks.CLOCK_OFFSET: clock_evidence(state, scores)}
    for term, candidate in layout.candidates.items():
        score, scale = scores[term], layout.scale[list(candidate.directions)]
        value = float(_evidence(score.score[None], score.information[None], scale)[0])
        if value > 0 and len(score.driver_score) > 1:
            score_without = score.score - score.driver_score
            information_without = score.information - score.driver_information
            value = float(min(value, _evidence(score_without, information_without, scale).min()))
        evidence[term] = value
    return evidence


def least_strength(
    information: Float[np.ndarray, "directions directions"], scale: Float[np.ndarray, " directions"], evidence: float
) -> float:
    """Strength along the first direction at which the expected score gives this evidence, as of `evidences`; inf if the
    data contain no information on it. `scale` is that of the prior of each direction.
    """
    strengths = []
    for width in PRIOR_WIDTHS:
        # The score at the strength 1; the gain grows with the square of the strength.
        (gain,), (penalty,) = _gain_and_penalty(information[None, :, 0], information[None], width * scale)
        strengths.append(np.sqrt((evidence + penalty) / gain) if gain > 0 else np.inf)
    return float(min(strengths))


def _evidence(score: np.ndarray, information: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Laplace evidence for a linear model with a Gaussian prior, the largest over PRIOR_WIDTHS [nats]."""
    best = np.full(len(score), -np.inf)
    for width in PRIOR_WIDTHS:
        gain, penalty = _gain_and_penalty(score, information, width * scale)
        best = np.maximum(best, gain - penalty)
    return best


def _gain_and_penalty(score: np.ndarray, information: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain of log-likelihood by the best fit under a prior of this scale, and complexity penalty [nats]."""
    inner = np.eye(score.shape[1]) + scale[:, None] * information * scale[None, :]
    scaled = score * scale
    fitted = np.linalg.solve(inner, scaled[:, :, None])[:, :, 0]
    return 0.5 * (scaled * fitted).sum(axis=1), 0.5 * np.linalg.slogdet(inner)[1]
