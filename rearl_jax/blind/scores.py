"""Rates of a blind study, with exact binomial intervals and with the goals that were set in advance."""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import beta

from rearl_jax.blind.questions import QUESTIONS, Judged, Question

CONFIDENCE = 0.95
"""Confidence level of the intervals of rates [-]."""


@dataclass(frozen=True)
class Score:
    """A rate: the share of data sets (cases) that count as a hit.

    Attributes:
        name: Name in tables.
        title: Title in documents.
        n_hits, n_cases: Number of hits and of cases.
        low, high: Bounds of the exact interval of the rate [-] (Clopper & Pearson 1934).
        goal: Goal as a text, such as "≥ 95 %".
        is_met: Whether the rate meets the goal.
    """

    name: str
    title: str
    n_hits: int
    n_cases: int
    low: float
    high: float
    goal: str
    is_met: bool

    @property
    def rate(self) -> float:
        """Share of the cases that are hits [-]."""
        return self.n_hits / self.n_cases


def binomial_interval(n_hits: int, n_cases: int) -> tuple[float, float]:
    """Bounds of the exact interval of a rate [-].

    Source: Clopper & Pearson, Biometrika 26 (1934) 404.
    """
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = 0.0 if n_hits == 0 else float(beta.ppf(tail, n_hits, n_cases - n_hits + 1))
    high = 1.0 if n_hits == n_cases else float(beta.ppf(1.0 - tail, n_hits + 1, n_cases - n_hits))
    return low, high


def rate_of(n_hits: int, n_cases: int, names: Sequence[str] = ("rate", "low", "high")) -> dict[str, float | None]:
    """A rate and the bounds of its exact interval, under `names`; None if there are no cases."""
    figures = (n_hits / n_cases, *binomial_interval(n_hits, n_cases)) if n_cases else (None, None, None)
    return dict(zip(names, figures, strict=True))


def score_all(cases: Sequence[Judged], questions: Sequence[Question] = QUESTIONS) -> list[Score]:
    """Scores of the questions that apply to at least one case, in the order of the questions."""
    scores = []
    for question in questions:
        applicable = [case for case in cases if question.applies(case)]
        if applicable:
            scores.append(_scored(question, sum(map(question.is_hit, applicable)), len(applicable)))
    return scores


def _scored(question: Question, n_hits: int, n_cases: int) -> Score:
    low, high = binomial_interval(n_hits, n_cases)
    rate = n_hits / n_cases
    is_met = rate <= question.goal if question.at_most else rate >= question.goal
    goal = f"{'≤' if question.at_most else '≥'} {100 * question.goal:.3g} %"
    return Score(question.name, question.title, n_hits, n_cases, low, high, goal, is_met)
