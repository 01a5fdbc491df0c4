"""One estimate per row of the table and metric: mean, spread over runs, interval over scenes.

The figures behind it are those of pairs, each of a rollout or recording and the scene it is scored against.

Every interval comes from the same resamples of the scenes (paired bootstrap), so that the difference of two rows is
resampled scene by scene; differences between scenes that both rows share do not widen its interval. Where the same
rollouts serve all scenes (eval.seed_scope=run), figures of rollouts alone do not vary over scenes and have none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from rearl_jax._typing import SceneIndices
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope
from rearl_jax.evaluation.scores import COMPARING, TITLES, Scores, reference_of
from rearl_jax.metrics import METRICS

BASE = Method.base.name
"""Row of the method without interventions."""

LESS_BASE = ("less_base", "less_base_low", "less_base_high")
"""Fields of an estimate with its difference from base, and the ends of the interval."""

FEW_SCENES = 20
"""Number of scenes below which intervals are called too narrow: those of 95 % cover the mean of normal values in 93 %
of the cases with 20 scenes, in 82 % with 5.
"""

# Largest number of resampling weights in a block, about 30 MB.
_MAX_WEIGHTS = 4_000_000


@dataclass(frozen=True)
class Estimate:
    """One metric of one row; None if there is no such figure.

    Attributes:
        value: Mean over scenes of the mean over runs.
        sd: Standard deviation over runs of the mean over scenes (n - 1 in the denominator).
        low: Lower end of the bootstrap interval of the value, over scenes.
        high: Upper end.
        compared_with: Row the difference is taken to: `real` if the recorded scenes have the metric themselves, else
            `real_vs_real`; None for these rows.
        difference: Value less that of the row `compared_with`, over the scenes that both have.
        difference_low: Lower end of its paired bootstrap interval.
        difference_high: Upper end.
        less_base: Value less that of the row base, for methods other than base.
        less_base_low: Lower end of its paired bootstrap interval.
        less_base_high: Upper end.
        n_scenes: Scenes with a figure.
    """

    value: float
    sd: float | None = None
    low: float | None = None
    high: float | None = None
    compared_with: str | None = None
    difference: float | None = None
    difference_low: float | None = None
    difference_high: float | None = None
    less_base: float | None = None
    less_base_low: float | None = None
    less_base_high: float | None = None
    n_scenes: int = 0


def estimates(rows: list[Scores], held_out: SceneIndices, eval: EvaluationConfig) -> dict[tuple[str, str], Estimate]:
    """Estimates by row and metric, resampled over the held-out scenes; pairs without any figure are left out.

    Source: percentile bootstrap, Efron & Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
    """
    means: dict[tuple[str, str], np.ndarray] = {}
    spread: dict[tuple[str, str], float | None] = {}
    for row in rows:
        for name in METRICS:
            values = scene_means(row, name, held_out)
            if np.isfinite(values).any():
                means[row.row, name] = values
                spread[row.row, name] = spread_over_runs(row, name)
    result = {
        key: Estimate(value, spread[key], low, high, n_scenes=int(np.isfinite(means[key]).sum()))
        for key, (value, low, high) in zip(means, means_with_intervals(list(means.values()), eval), strict=True)
    }
    simulated = [key for key in means if key[0] not in TITLES]
    recorded_of = {(row, name): (reference_of(name), name) for row, name in simulated}
    base_of = {(row, name): (BASE, name) for row, name in simulated if row != BASE}
    for key in simulated:
        if not _varies_over_scenes(key[1], eval):
            result[key] = replace(result[key], low=None, high=None)
    for field, others in (("difference", recorded_of), ("less_base", base_of)):
        differences = _differences(means, others)
        names = (field, f"{field}_low", f"{field}_high")
        for key, figures in zip(differences, means_with_intervals(list(differences.values()), eval), strict=True):
            shown = figures if _varies_over_scenes(key[1], eval) else (figures[0], None, None)
            result[key] = replace(result[key], **dict(zip(names, shown, strict=True)))
            if field == "difference":
                result[key] = replace(result[key], compared_with=others[key][0])
    return result


def _varies_over_scenes(name: str, eval: EvaluationConfig) -> bool:
    """True if the scenes have rollouts of their own, or the metric compares rollouts with the scene."""
    return eval.seed_scope is SeedScope.run_x_scene or name in COMPARING


def _differences(
    means: dict[tuple[str, str], Float[np.ndarray, " scenes"]], others: dict[tuple[str, str], tuple[str, str]]
) -> dict[tuple[str, str], Float[np.ndarray, " scenes"]]:
    """Means less those of the row and metric in `others`, scene by scene; without differences that no scene has."""
    differences = {key: means[key] - means[other] for key, other in others.items() if other in means}
    return {key: values for key, values in differences.items() if np.isfinite(values).any()}


def scene_means(row: Scores, name: str, held_out: SceneIndices) -> Float[np.ndarray, " scenes"]:
    """Figure of each held-out scene: mean over runs, or figure of the pooled runs; NaN where there is none."""
    if name in row.pooled:
        return row.pooled[name]
    if name not in row.values:
        return np.full(len(held_out), np.nan)
    return grouped_mean(row.values[name], np.searchsorted(held_out, row.scene), len(held_out))


def spread_over_runs(row: Scores, name: str) -> float | None:
    """Standard deviation over runs of the mean over scenes; None with fewer than two runs,
    or if single runs have no figure.
    """
    if name not in row.values:
        return None
    means = grouped_mean(row.values[name], row.run, int(row.run.max(initial=0)) + 1)
    means = means[np.isfinite(means)]
    return float(np.std(means, ddof=1)) if len(means) > 1 else None


def grouped_mean(
    values: Float[np.ndarray, " values"], group: Int[np.ndarray, " values"], n_groups: int
) -> Float[np.ndarray, " groups"]:
    """Mean of the finite values of each group; NaN for a group without any."""
    valid = np.isfinite(values)
    counts = np.bincount(group[valid], minlength=n_groups)
    sums = np.bincount(group[valid], weights=values[valid], minlength=n_groups)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def finite_mean(values: Float[np.ndarray, " values"]) -> float:
    """Mean of the finite values; NaN without any."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def means_with_intervals(
    figures: Sequence[Float[np.ndarray, " scenes"]], eval: EvaluationConfig
) -> list[tuple[float, float | None, float | None]]:
    """Mean of each figure over the scenes, NaN without a value, with the ends of its interval, as in `intervals`."""
    if not figures:
        return []
    ends = intervals(np.stack(figures, axis=1), eval)
    return [(finite_mean(values), *bounds) for values, bounds in zip(figures, ends, strict=True)]


def intervals(
    values: Float[np.ndarray, "scenes columns"], eval: EvaluationConfig
) -> list[tuple[float | None, float | None]]:
    """Ends of the percentile bootstrap interval of the mean over scenes, for each column; all columns have the same
    resamples.

    A missing value (NaN) does not count. None if fewer than two scenes have a value.
    """
    valid = np.isfinite(values)
    known = np.where(valid, values, 0.0)
    means = []
    for weights in _weights(len(values), eval):
        counts = weights @ valid
        means.append(np.where(counts > 0, (weights @ known) / np.maximum(counts, 1), np.nan))
    resampled = np.concatenate(means)
    tail = (1 - eval.confidence) / 2
    ends: list[tuple[float | None, float | None]] = []
    for column, n_valid in zip(resampled.T, valid.sum(axis=0), strict=True):
        if n_valid < 2:
            ends.append((None, None))
            continue
        low, high = np.quantile(column[np.isfinite(column)], [tail, 1 - tail])
        ends.append((float(low), float(high)))
    return ends


def bootstrap_over(n_scenes: int, scenes: str, confidence: float) -> str:
    """Phrase on intervals over a number of scenes (such as `held-out scenes`), and on too few of them."""
    few = ", rough and too narrow with so few" if n_scenes < FEW_SCENES else ""
    return f"{100 * confidence:g} % bootstrap over {n_scenes} {scenes}{few}"


def _weights(n_scenes: int, eval: EvaluationConfig) -> Iterator[Float[np.ndarray, "draws scenes"]]:
    """Number of times that each scene is drawn in each resample, block by block."""
    rng = np.random.default_rng([eval.seed, n_scenes])
    block = max(1, _MAX_WEIGHTS // n_scenes)
    for start in range(0, eval.resamples, block):
        size = min(block, eval.resamples - start)
        yield rng.multinomial(n_scenes, np.full(n_scenes, 1 / n_scenes), size).astype(np.float64)
