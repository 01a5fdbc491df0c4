"""The threshold pair that is best on the tuning scenes, from the scores of all pairs, and how certain the choice is."""

import itertools
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from rearl_jax._typing import SceneIndices
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.sweep import SweepConfig
from rearl_jax.evaluation.estimates import grouped_mean
from rearl_jax.evaluation.percentiles import BaseValues
from rearl_jax.problems import InvalidInputError, Problem


def pair_name(h_pct: float, m_pct: float) -> str:
    """Title of a pair in tables and figures, by its percentiles [%]."""
    return f"{h_pct:g} % / {m_pct:g} %"


@dataclass(frozen=True)
class Pair:
    """A pair of thresholds of the detector.

    Attributes:
        h_pct: Percentile of the Hellinger distances of Base, the uncorrected simulation [%].
        m_pct: Percentile of the spacing errors of Base [%].
        threshold_h: Threshold of the Hellinger distance [-].
        threshold_m: Threshold of the spacing error [-].
    """

    h_pct: float
    m_pct: float
    threshold_h: float
    threshold_m: float

    @property
    def name(self) -> str:
        """Title in tables and figures."""
        return pair_name(self.h_pct, self.m_pct)


def threshold_pairs(sweep: SweepConfig, base: BaseValues) -> list[Pair]:
    """All combinations of the percentiles, those of the spacing error varying fastest."""
    return [
        Pair(h, m, base.threshold_h(h), base.threshold_m(m)) for h, m in itertools.product(sweep.h_pct, sweep.m_pct)
    ]


@dataclass(frozen=True)
class Choice:
    """The best pair, and whether the tuning scenes can distinguish it from the next best.

    The score of a pair is its mean Hellinger distance plus its mean spacing error.

    Attributes:
        best: Index of the pair with the lowest score; of equal ones the first.
        runner_up: Index of the second best pair.
        is_scored: Whether each scene has values of all pairs; only such scenes count for the scores.
        score: Score of each pair.
        win_share: Share of the resamples of the scenes in which each pair is best.
        lead: Score of the runner-up minus that of the best pair.
        lead_low: Lower bound of the paired bootstrap interval of the lead; None from fewer than two scenes.
        lead_high: Upper bound of the same interval.
    """

    best: int
    runner_up: int
    is_scored: Bool[np.ndarray, " scenes"]
    score: Float[np.ndarray, " pairs"]
    win_share: Float[np.ndarray, " pairs"]
    lead: float
    lead_low: float | None
    lead_high: float | None

    @property
    def is_distinguishable(self) -> bool:
        """True if the interval of the lead excludes zero."""
        return self.lead_low is not None and self.lead_low > 0


def choose(
    h: Float[np.ndarray, "pairs scenes"], mape: Float[np.ndarray, "pairs scenes"], eval: EvaluationConfig
) -> Choice:
    """The pair with the lowest mean Hellinger distance plus mean spacing error.

    Scenes without a value for any one of the pairs are excluded for all pairs.

    Args:
        h: Mean Hellinger distance over runs of every pair and scene [-].
        mape: Mean spacing error over runs of every pair and scene [-].
        eval: Resamples, confidence and seed of the bootstrap over scenes.

    Raises:
        InvalidInputError: No scene has values of all pairs.

    Source: REARL (Bi et al.) does not state how its pair (30 %, 5 %) was chosen; in its Table 3 it has the smallest
    sum. Percentile bootstrap: Efron & Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
    """
    total = h + mape
    is_scored = np.asarray(np.isfinite(total).all(axis=0))
    total = total[:, is_scored]
    if not total.size:
        message = "in every tuning scene some pair of thresholds has no value: raise eval.n_runs, or use more data"
        raise InvalidInputError(Problem("no-figure", message))
    score = total.mean(axis=1)
    order = np.argsort(score, kind="stable")
    best, runner_up = int(order[0]), int(order[min(1, len(order) - 1)])  # a single pair is its own runner-up
    n_scenes = total.shape[1]
    drawn = np.random.default_rng(eval.seed).integers(n_scenes, size=(eval.resamples, n_scenes))
    weights = np.stack([np.bincount(row, minlength=n_scenes) for row in drawn]) / n_scenes
    resampled = weights @ total.T
    wins = np.bincount(resampled.argmin(axis=1), minlength=len(score)) / eval.resamples
    lead, low, high = float(score[runner_up] - score[best]), None, None
    if n_scenes > 1:
        tail = 50 * (1 - eval.confidence)
        low, high = map(float, np.percentile(resampled[:, runner_up] - resampled[:, best], [tail, 100 - tail]))
    return Choice(best, runner_up, is_scored, score, wins, lead, low, high)


def base_score(
    h: Float[np.ndarray, " scenes"], mape: Float[np.ndarray, " scenes"], is_scored: Bool[np.ndarray, " scenes"]
) -> float:
    """Score of base on the scenes on which the pairs are scored, so that the two can be compared.

    Args:
        h: Mean Hellinger distance over runs of base in every scene [-].
        mape: Mean spacing error over runs of base in every scene [-].
        is_scored: As of `Choice`.
    """
    return float(np.nanmean(h[is_scored])) + float(np.nanmean(mape[is_scored]))


def pair_table(
    pairs: list[Pair], scene_values: dict[str, Float[np.ndarray, "pairs scenes"]], choice: Choice
) -> pd.DataFrame:
    """One row per pair: percentiles, thresholds, means of `scene_values` over scenes, score, `win_share`, `is_best`."""
    frame = pd.DataFrame([vars(pair) for pair in pairs])
    for name, values in scene_values.items():
        frame[name] = np.nanmean(values, axis=1)
    frame["score"] = choice.score
    frame["win_share"] = choice.win_share
    frame["is_best"] = np.arange(len(pairs)) == choice.best
    return frame


def scene_means(
    values: Float[np.ndarray, " rollouts"],
    pair: Int[np.ndarray, " rollouts"],
    scene: Int[np.ndarray, " rollouts"],
    subset: SceneIndices,
) -> Float[np.ndarray, "pairs scenes"]:
    """Mean over runs of every pair and scene; NaN where no run has a value.

    Args:
        values: One value per rollout.
        pair: Index of each rollout's pair.
        scene: Number of each rollout's scene.
        subset: Numbers of the scenes, in ascending order.
    """
    n_pairs = int(pair.max()) + 1
    group = pair * len(subset) + np.searchsorted(subset, scene)
    return grouped_mean(values, group, n_pairs * len(subset)).reshape(n_pairs, len(subset))
