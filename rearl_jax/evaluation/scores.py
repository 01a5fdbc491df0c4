"""Scores of one row of the table: figures of every scored pair; construction of the reference rows."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cache, partial

import jax
import numpy as np
from jaxtyping import Array, Float, Float32, Int, Shaped

from rearl_jax._typing import SceneIndices
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.metrics import HistConfig, OutOfBounds, RealismConfig
from rearl_jax.core.batch import join_scenarios
from rearl_jax.data.scenes.scene_set import SceneSet, recorded_lane_change_rate
from rearl_jax.metrics import MEASURED, METRICS
from rearl_jax.metrics.histograms import legacy_scale, noise_floor, speed_edges
from rearl_jax.metrics.measure import Measure
from rearl_jax.metrics.realism import Realism, RealismCounts, realism_scores
from rearl_jax.metrics.scene import SceneMetrics, SceneSeries
from rearl_jax.problems import InvalidInputError, Problem

REAL, REAL_VS_REAL, NOISE_FLOOR = "real", "real_vs_real", "noise_floor"
"""Reference rows: the recorded scenes themselves, other recorded scenes in the place of a simulation, and two samples
of the speeds of one scene.
"""

TITLES = {REAL_VS_REAL: "real against real", NOISE_FLOOR: "noise floor", REAL: "real"}
"""Titles of the reference rows, in their order in tables; the title of a method is its name."""

WITH_EFFECT = "_effect"
"""Suffix of the names of rows on the traffic of a repaired model with its effects."""

LIKELIHOODS = {"realism": "meta", "ttc_likelihood": "ttc", "thw_likelihood": "headway"}
"""Metrics for which the runs of a scene are pooled before scoring, with their fields of `Realism`."""

COMPARING = tuple(name for name, metric in METRICS.items() if metric.compares)
"""Metrics that compare two scenes, which say nothing about a scene scored against itself."""

NEEDS_LANES = tuple(name for name, metric in METRICS.items() if metric.needs_lanes)
"""Metrics that are undefined for recordings without lanes."""


def reference_of(metric: str) -> str:
    """Reference row of a metric of simulated traffic: `real` if recorded scenes have the metric themselves."""
    return REAL_VS_REAL if metric in COMPARING else REAL


def title_of(row: str) -> str:
    """Title of a row in tables and figures."""
    if row.endswith(WITH_EFFECT):
        return f"{row.removesuffix(WITH_EFFECT)} + effect"
    return TITLES.get(row, row)


@dataclass(frozen=True)
class Scores:
    """Figures of one row of the table, pair by pair: a rollout or recording, and the scene it is scored on.

    Attributes:
        row: Name of the method or reference row.
        scene: Index of the scene scored against.
        run: Run, from 0.
        values: Figures by metric; NaN where there was nothing to measure.
        counts: Number of samples of each figure, by metric.
        partner: Index of the recorded scene in place of a simulation; None for a simulation.
        series: Figures by window and frame; None if there are none.
        realism: Bin counts of the realism features; None if there are none.
        pooled: Metrics for which the runs of a scene are pooled before scoring: one figure per scene, in the order of
            the held-out scenes.
        n_rollouts: Simulations behind the row.
        seconds: Wall time of simulating and scoring, compilation included [s].
    """

    row: str
    scene: Int[np.ndarray, " pairs"]
    run: Int[np.ndarray, " pairs"]
    values: dict[str, Float[np.ndarray, " pairs"]]
    counts: dict[str, Int[np.ndarray, " pairs"]]
    partner: Int[np.ndarray, " pairs"] | None = None
    series: SceneSeries | None = None
    realism: RealismCounts | None = None
    pooled: dict[str, Float[np.ndarray, " scenes"]] = field(default_factory=dict)
    n_rollouts: int = 0
    seconds: float = 0.0

    @property
    def title(self) -> str:
        """Title in tables and figures."""
        return title_of(self.row)

    def without(self, names: tuple[str, ...]) -> "Scores":
        """The scores without some metrics."""
        values, counts, pooled = (
            {name: figures for name, figures in by_metric.items() if name not in names}
            for by_metric in (self.values, self.counts, self.pooled)
        )
        return replace(self, values=values, counts=counts, pooled=pooled)


def scores_of(
    row: str,
    scene: Int[np.ndarray, " pairs"],
    run: Int[np.ndarray, " pairs"],
    metrics: SceneMetrics,
    *,
    partner: Int[np.ndarray, " pairs"] | None = None,
    n_rollouts: int = 0,
    seconds: float = 0.0,
) -> Scores:
    """Scores of pairs whose metrics are known; see `Scores`."""
    measures = {name: metrics.measure(name) for name in MEASURED}
    return Scores(
        row,
        scene,
        run,
        {name: known_values(measure) for name, measure in measures.items()},
        {name: np.asarray(measure.count) for name, measure in measures.items()},
        partner=partner,
        series=metrics.series,
        realism=metrics.realism,
        n_rollouts=n_rollouts,
        seconds=seconds,
    )


def known_values(measure: Measure) -> Float[np.ndarray, " pairs"]:
    """Values of a measure; NaN without samples."""
    return np.where(np.asarray(measure.count) > 0, np.asarray(measure.value, np.float64), np.nan)


def row_named(rows: Iterable[Scores], name: str) -> Scores:
    """The row with a name."""
    return next(row for row in rows if row.row == name)


def of_recordings(scores: Scores, scenes: SceneSet) -> Scores:
    """Scores of recorded scenes, without metrics that recordings do not determine.

    Recorded lane-change rates count every vehicle of a snapshot over the second after it, also those that are not
    among the picked ones of the next snapshot. A scene scored against itself keeps only the metrics that describe
    one scene.

    Raises:
        InvalidInputError: The scores are those of a simulation.
    """
    if scores.partner is None:
        message = f"row {scores.row} is a simulation: its lane-change rate is already measured"
        raise InvalidInputError(Problem("row-simulated", message))
    if (scenes.lane < 0).any():
        return replace(scores.without(NEEDS_LANES), realism=None)
    values = scores.values | {"lcr": recorded_lane_change_rate(scenes)[scores.partner]}
    scores = replace(scores, values=values)
    if scores.row == REAL:
        return scores.without(COMPARING)
    return scores


def partners(scenes: SceneSet, held_out: SceneIndices, eval: EvaluationConfig) -> tuple[Int[np.ndarray, " pairs"], ...]:
    """Pairs for the row real against real: indices of partner and scene, and the run.

    Every held-out scene gets `eval.n_runs` other scenes, drawn without replacement among all that share no
    second of traffic with it (fewer if there are fewer). The draw depends on the seed and the scene alone.
    """
    partner, scene, run = [], [], []
    for index in held_out:
        is_near = np.abs(scenes.start_time - scenes.start_time[index]) < scenes.seconds - 1e-6
        candidates = np.flatnonzero(~(is_near & (scenes.recording == scenes.recording[index])))
        rng = np.random.default_rng([eval.seed, int(scenes.scene_id[index])])
        drawn = rng.permutation(candidates)[: eval.n_runs]
        partner.append(drawn)
        scene.append(np.full(len(drawn), index))
        run.append(np.arange(len(drawn)))
    return np.concatenate(partner), np.concatenate(scene), np.concatenate(run)


def noise_floor_scores(scenes: SceneSet, held_out: SceneIndices, hist: HistConfig, eval: EvaluationConfig) -> Scores:
    """Hellinger distance of two samples, as large as a window, drawn from the speeds of the same held-out scene.

    Mean over `eval.noise_draws` pairs of samples per scene; NaN for a scene whose speeds are all left out of the
    histogram.
    """
    shares = np.stack([_speed_shares(scenes.scaled_speed[index], hist) for index in held_out])
    ids = scenes.scene_id[held_out].astype(np.int32)
    draws = _floor_program(hist.window * scenes.n_slots, eval.noise_draws)(shares, ids, np.int32(eval.seed))
    has_speeds = shares.any(axis=1)
    h = np.where(has_speeds, np.asarray(draws, np.float64).mean(axis=1), np.nan)
    counts = np.where(has_speeds, eval.noise_draws, 0)
    return Scores(
        NOISE_FLOOR,
        held_out,
        np.zeros(len(held_out), np.int64),
        {"h": h, "h_legacy": h * legacy_scale(hist)},
        {"h": counts, "h_legacy": counts},
    )


@cache
def _floor_program(n_samples: int, n_draws: int) -> Callable[..., Array]:
    """Compiled once for all studies of a process: from speed shares, scene ids and the seed to distances."""

    def of_scene(shares: Array, scene_id: Array, seed: Array) -> Array:
        key = jax.random.fold_in(jax.random.key(seed), scene_id)
        return noise_floor(shares, n_samples=n_samples, n_draws=n_draws, key=key)

    return jax.jit(jax.vmap(of_scene, in_axes=(0, 0, None)))


@cache
def _realism_program(realism: RealismConfig) -> Callable[..., Realism]:
    """Compiled once for all studies of a process: from bin counts to scores."""
    return jax.jit(partial(realism_scores, realism=realism, dtype=np.dtype(np.float32)))


def with_realism(rows: list[Scores], real: Scores, realism: RealismConfig) -> list[Scores]:
    """The rows with the likelihoods of the recorded scenes under each row, where a row has bin counts.

    A pair's figure is of its rollout alone; the row's figure pools the runs of a scene, as the measure is defined. One
    compiled call serves all rows.

    Args:
        rows: Rows to complete.
        real: The held-out scenes themselves, one pair for each.
        realism: Pseudocounts and weights.
    """
    counted = [row for row in rows if row.realism is not None and row.row != REAL]
    if not counted or real.realism is None:
        return rows
    n_scenes = len(real.scene)
    order = np.argsort(real.scene)
    simulated, scene_columns = [], []
    for row in counted:
        of_pairs = order[np.searchsorted(real.scene, row.scene, sorter=order)]
        simulated += [row.realism, jax.tree.map(partial(_summed, group=of_pairs, n_groups=n_scenes), row.realism)]
        scene_columns += [of_pairs, np.arange(n_scenes)]
    counts = join_scenarios(simulated)
    recorded = jax.tree.map(lambda leaf: leaf[..., np.concatenate(scene_columns)], real.realism)
    likelihoods = _realism_program(realism)(counts, recorded)
    ends = np.cumsum([len(columns) for columns in scene_columns])[:-1]
    complete = {row.row: row for row in counted}
    for name, feature in LIKELIHOODS.items():
        measure = getattr(likelihoods, feature)
        # Each row has two parts, its pairs and its scenes, so the iterator is consumed twice per row.
        parts = zip(np.split(known_values(measure), ends), np.split(np.asarray(measure.count), ends), strict=True)
        for row, (single, n_single), (pooled, _) in zip(counted, parts, parts, strict=True):
            scores = complete[row.row]
            complete[row.row] = replace(
                scores,
                values=scores.values | {name: single},
                counts=scores.counts | {name: n_single},
                pooled=scores.pooled | {name: pooled},
            )
    return [complete.get(row.row, row) for row in rows]


def _speed_shares(speed: Float[np.ndarray, "seconds slots"], hist: HistConfig) -> Float32[np.ndarray, " bins"]:
    """Share of the speeds [m/s] in each bin of the Hellinger distance."""
    if hist.oob is OutOfBounds.clip:
        speed = np.clip(speed, hist.low, hist.high)
    counts, _ = np.histogram(speed, np.array(speed_edges(hist)))
    return (counts / max(counts.sum(), 1)).astype(np.float32)


def _summed(
    counts: Shaped[np.ndarray, "*bins pairs"], group: Int[np.ndarray, " pairs"], n_groups: int
) -> Shaped[np.ndarray, "*bins groups"]:
    """Bin counts added up by group."""
    total = np.zeros((n_groups, *counts.shape[:-1]), counts.dtype)
    np.add.at(total, group, np.moveaxis(counts, -1, 0))
    return np.moveaxis(total, 0, -1)
