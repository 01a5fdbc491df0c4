"""The open-ended finder: variables that the acceleration residual depends on, found without a list of effects.

Method: sparse regression of the residual on two curves over every variable: one adds acceleration, the other changes
the time gap. The columns of the design matrix that belong to the knots of one curve form a group. Groups are added one
after the other while the evidence for the best one exceeds what the best of as many groups reaches by chance. The
selection is repeated on random halves of the drivers. The share of halves in which a variable is selected measures its
stability; a variable that matters to a few drivers only has a small share.

Source: stability selection with complementary halves, Shah & Samworth, J. R. Stat. Soc. B 75 (2013) 55; forward
selection of groups, Lozano, Swirszcz & Abe, NeurIPS (2009); Laplace evidence, MacKay, Neural Comput. 4 (1992) 415.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.discovery.observe.forcing import DriverScores
from rearl_jax.discovery.thresholds import THRESHOLDS

PAIRS = 25
"""Random divisions of the drivers into two halves."""

MOST_GROUPS = 4
"""Largest number of groups selected in one half."""

CURVE_SCALE = 0.3
"""Prior standard deviation of a curve's values: acceleration [m/s^2], change of the logarithm of the time gap [-]."""


@dataclass(frozen=True)
class Group:
    """The curve of one variable that acts on `acceleration` or `time_gap`: `columns` are the indices of the columns of
    its knots in the design matrix.
    """

    variable: str
    acts_on: str
    columns: Int[np.ndarray, " knots"]


@dataclass(frozen=True)
class Selected:
    """A variable, the share of the halves in which one or both of its curves were selected (`frequency`), and of those
    in which one was the first (`first`) [-].
    """

    variable: str
    frequency: float
    first: float


def stability_selection(scores: DriverScores, groups: Sequence[Group], seed: int) -> list[Selected]:
    """All variables: the most often selected as the first variable come first, then those most often selected.

    `scores` contain the columns of all groups.
    """
    rng = np.random.default_rng(seed)
    n, chosen, first = len(scores.score), Counter(), Counter()
    for _ in range(PAIRS):
        order = rng.permutation(n)
        for half in (order[: n // 2], order[n // 2 : 2 * (n // 2)]):
            in_half = forward_selection(scores, half, groups)
            chosen.update({group.variable for group in in_half})
            first.update(group.variable for group in in_half[:1])
    n_halves = 2 * PAIRS
    names = dict.fromkeys(group.variable for group in groups)
    selected = [Selected(name, chosen[name] / n_halves, first[name] / n_halves) for name in names]
    return sorted(selected, key=lambda variable: (-variable.first, -variable.frequency))


def forward_selection(scores: DriverScores, drivers: Int[np.ndarray, " some"], groups: Sequence[Group]) -> list[Group]:
    """Groups in the order in which they are added, for the given drivers."""
    gram, score = scores.gram[drivers].sum(axis=0), scores.score[drivers].sum(axis=0)
    for group in groups:
        gram[group.columns, group.columns] += scores.variance / CURVE_SCALE**2
    unselected, selected = list(groups), []
    bound = np.log(len(groups)) + THRESHOLDS.finder_evidence
    while unselected and len(selected) < MOST_GROUPS:
        evidence = [_evidence(gram, score, group, scores.variance) for group in unselected]
        best = int(np.argmax(evidence))
        if evidence[best] < bound:
            break
        group = unselected.pop(best)
        selected.append(group)
        # Scores of the other groups with this one in the model (partial regression).
        across = np.linalg.solve(gram[np.ix_(group.columns, group.columns)], gram[group.columns])
        score = score - across.T @ score[group.columns]
        gram = gram - gram[:, group.columns] @ across
    return selected


def _evidence(
    gram: Float[np.ndarray, "columns columns"], score: Float[np.ndarray, " columns"], group: Group, variance: float
) -> float:
    """Laplace evidence for a group [nats], whose prior is in the diagonal of `gram`; the penalty is for its width."""
    block, group_score = gram[np.ix_(group.columns, group.columns)], score[group.columns]
    penalty = np.linalg.slogdet(block * (CURVE_SCALE**2 / variance))[1]
    return float(0.5 * group_score @ np.linalg.solve(block, group_score) / variance - 0.5 * penalty)
