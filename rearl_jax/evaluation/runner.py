"""All rows of the table: simulated traffic scored chunk by chunk, and the reference rows."""

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import jax
import numpy as np
from jaxtyping import Float, Int

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.config.metrics import HistConfig, MetricsConfig
from rearl_jax.core.batch import join_scenarios, width_per_device
from rearl_jax.core.rollout import Frames
from rearl_jax.data.scenes.boundary import SceneBoundary
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.detection.references import References
from rearl_jax.evaluation.extras import Extra, Figures
from rearl_jax.evaluation.host_policy import MakePolicy
from rearl_jax.evaluation.interventions import DecisionLog, intervention_extra, intervention_rates, variants_extra
from rearl_jax.evaluation.paths import recorded_paths, simulated_paths, with_paths
from rearl_jax.evaluation.policy_actions import count_actions, driving_extra
from rearl_jax.evaluation.positions import Positions, join_positions, position_extra, position_figures, positions_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import rows_of
from rearl_jax.evaluation.scores import (
    REAL,
    REAL_VS_REAL,
    Scores,
    noise_floor_scores,
    of_recordings,
    partners,
    row_named,
    scores_of,
    with_realism,
)
from rearl_jax.evaluation.scoring import Scorer
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED, Simulated
from rearl_jax.metrics.scene import SceneMetrics
from rearl_jax.problems import InvalidInputError, Problem

DRAWN_BINS_PER_BIN = 4
"""Bins of the drawn speed histogram per bin of the Hellinger distance."""


@dataclass(frozen=True)
class Sample:
    """Data of the figures on simulated traffic, in addition to its metrics.

    Attributes:
        example: Index of the scene in the space-time diagram.
        frames: First rollout of that scene, `[seconds, vehicles]`.
        lengths: Lengths of the vehicles in this rollout [m].
        around: Recorded traffic around that scene; None for a free road.
        speed_counts: Simulated speeds of all rollouts per bin of `speed_histogram_edges`.
        action_counts: Actions of all rollouts per bin of the speed before them; None if no policy drives all vehicles.
    """

    example: int
    frames: Frames
    lengths: Float[np.ndarray, " vehicles"]
    around: SceneBoundary | None
    speed_counts: Int[np.ndarray, " bins"]
    action_counts: Int[np.ndarray, "actions bins"] | None = None


@dataclass(frozen=True)
class Evaluation:
    """Result of an evaluation.

    Attributes:
        config: The task.
        scenes: All scenes.
        held_out: Indices of the evaluation scenes, in ascending order.
        rows: The simulated rows first, then the reference rows.
        sample: Data of the figures on the main row.
        main: Name of the row that figures and differences refer to.
        logs: Detections and decisions by row; empty if nothing is detected.
        extras: Additional results of methods.
        figures: Further keys of summary.json by row, in addition to estimates and extras.
    """

    config: EvaluateTask
    scenes: SceneSet
    held_out: SceneIndices
    rows: list[Scores]
    sample: Sample
    main: str
    logs: Mapping[str, DecisionLog] = field(default_factory=dict)
    extras: tuple[Extra, ...] = ()
    figures: Mapping[str, Figures] = field(default_factory=dict)

    @property
    def method(self) -> Scores:
        """The row that figures and differences refer to."""
        return self.row(self.main)

    @property
    def log(self) -> DecisionLog | None:
        """Detections and decisions of the main row; None if nothing is detected."""
        return self.logs.get(self.main)

    def row(self, name: str) -> Scores:
        """The row with a name."""
        return row_named(self.rows, name)


def evaluate(
    config: EvaluateTask,
    scenes: SceneSet,
    held_out: SceneIndices,
    progress: Callable[[int, int], None] = lambda done, total: None,
    references: References | None = None,
    thresholds: tuple[float, float] = NEVER_EXCEEDED,
    host_policy: MakePolicy | None = None,
    mixture: Mixture | None = None,
) -> Evaluation:
    """Simulated rows and reference rows, scored on the held-out scenes.

    Args:
        config: The task; `rows.rows_of` lists its rows.
        scenes: All scenes; those not held out serve only as partners in real against real.
        held_out: Indices of the scenes to evaluate on, in ascending order.
        progress: Called with the number of rollouts done and their total, row by row.
        references: Representative scenes, for methods that intervene.
        thresholds: Thresholds of the Hellinger distance and of the spacing error, for methods that intervene.
        host_policy: Makes the policies that decide outside the compiled program, where one does.
        mixture: Shares of the driver classes, for method=critical; None for `critical.ratios`.
    """
    simulated = rows_of(config, thresholds, mixture)
    scorer = make_scorer(config, scenes, config.eval.n_runs * len(held_out))
    example = example_scene(scenes, held_out, config.eval.example)
    rows, logs, extras, positions, main_sample = [], {}, [], {}, None
    # The reference rows are scored while the simulation compiles, which takes longest in a short job.
    with ThreadPoolExecutor(1) as pool:
        reference = pool.submit(reference_rows, config, scenes, held_out, scorer)
        for row in simulated.rows:
            rollouts = Rollouts([row], scenes, held_out, references, host_policy)
            scores, sample, log, row_positions = simulated_row(
                row.name, rollouts, scorer, scenes, held_out, example, progress
            )
            rows.append(scores)
            if row_positions is not None:
                positions[row.name] = row_positions
            if log is not None:
                logs[row.name] = log
            if row.name == simulated.main:
                main_sample = sample
                if rollouts.policy is not None and sample.action_counts is not None:
                    edges, method = speed_histogram_edges(config.hist), config.method.name
                    counts = sample.action_counts
                    extras.append(driving_extra(rollouts.policy, counts, edges, method, generated=scenes.generated))
        rows += reference.result()
    assert main_sample is not None
    rows = with_realism(rows, row_named(rows, REAL), config.realism)
    window, n_vehicles = config.hist.window, config.core.n_vehicles
    figures = {}
    if simulated.has_variants:
        figures = {name: intervention_rates(log, n_vehicles) for name, log in logs.items()}
        extras.append(variants_extra(scenes, logs, window, n_vehicles))
    elif logs:
        extras.insert(0, intervention_extra(scenes, logs[simulated.main], window))
    if positions:
        extras.append(position_extra(scenes.scene_id, positions))
        figures = {name: {**figures.get(name, {}), **position_figures(of_row)} for name, of_row in positions.items()}
    return Evaluation(config, scenes, held_out, rows, main_sample, simulated.main, logs, tuple(extras), figures)


def simulated_row(
    name: str,
    rollouts: Rollouts,
    scorer: Scorer,
    scenes: SceneSet,
    held_out: SceneIndices,
    example: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Scores, Sample, DecisionLog | None, Positions | None]:
    """Scores of a row on the held-out scenes, data of its figures, its decisions, and positions of its vehicles.

    `example` is the index of the scene whose first rollout the space-time diagram shows.
    """
    begin = time.perf_counter()
    edges = speed_histogram_edges(rollouts.config.hist)
    speed_counts = np.zeros(len(edges) - 1, np.int64)
    chunks, decisions, action_counts, example_rollout, positions, done = [], [], [], None, [], 0
    paths, columns = [], []
    for simulated, chunk in scored_chunks(rollouts, scorer, held_out, progress):
        frames = simulated.frames
        chunks.append(chunk)
        n = frames.x.shape[-1]
        part = rollouts[done : done + n]
        positions.append(positions_of(simulated, part, scenes))
        paths.append(simulated_paths(simulated, part, scenes))
        columns.append(done + chunk.rollout)
        done += n
        decisions.append(simulated.decisions)
        if simulated.actions is not None:
            action_counts.append(count_actions(np.asarray(simulated.actions), np.asarray(frames.speed), edges))
        speed_counts += np.histogram(np.clip(frames.speed, edges[0], edges[-1]), edges)[0]
        if example_rollout is None and example in chunk.scene:
            column = chunk.rollout[np.flatnonzero(chunk.scene == example)[0]]
            example_rollout = jax.tree.map(
                lambda leaf, column=column: np.array(leaf[..., column]), (frames, simulated.length)
            )
    scores, observed = _joined(name, chunks, len(rollouts)), recorded_paths(scenes, held_out, rollouts.config)
    scores = with_paths(scores, join_scenarios(paths), np.concatenate(columns), observed, held_out)
    scores = replace(scores, seconds=time.perf_counter() - begin)
    assert example_rollout is not None  # the example is one of the held-out scenes
    log = None if decisions[0] is None else DecisionLog(rollouts.scene, rollouts.run, join_scenarios(decisions))
    counts = np.sum(action_counts, axis=0) if action_counts else None
    frames, lengths = example_rollout
    compared = [part for part in positions if part is not None]
    around = rollouts.boundary
    if around is not None:
        around = around.select(np.flatnonzero(held_out == example))
    sample = Sample(example, frames, lengths, around, speed_counts, counts)
    return scores, sample, log, join_positions(compared) if compared else None


def scored_rollouts(
    rollouts: Rollouts,
    scenes: SceneSet,
    held_out: SceneIndices,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Scores:
    """Scores of the rollouts of one row or of several, in their order, against the held-out scenes."""
    begin = time.perf_counter()
    eval = rollouts.config.eval
    n_pairs = eval.n_runs * len(held_out) if eval.seed_scope is SeedScope.run else len(rollouts)
    scorer = make_scorer(rollouts.config, scenes, n_pairs)
    chunks = [chunk for _, chunk in scored_chunks(rollouts, scorer, held_out, progress)]
    scores = _joined(rollouts.config.method.name, chunks, len(rollouts))
    return replace(scores, seconds=time.perf_counter() - begin)


def make_scorer(config: EvaluateTask, scenes: SceneSet, n_pairs: int) -> Scorer:
    """Scorer of the configured metrics for a number of pairs of a rollout and a scene."""
    per_device = width_per_device(n_pairs, config.core.chunk)
    metrics = MetricsConfig(config.hist, config.thw, config.safety, config.realism, config.spacing)
    return Scorer(scenes, metrics, per_device=per_device, dtype=np.dtype(config.core.dtype.name))


@dataclass(frozen=True)
class ScoredChunk:
    """Pairs of a rollout and a scene, and their metrics.

    Attributes:
        rollout: Column of each pair's rollout in the chunk.
        scene: Index of each pair's scene.
        run: Run of each pair.
        metrics: Metrics of the pairs.
    """

    rollout: Int[np.ndarray, " pairs"]
    scene: Int[np.ndarray, " pairs"]
    run: Int[np.ndarray, " pairs"]
    metrics: SceneMetrics


def scored_chunks(
    rollouts: Rollouts, scorer: Scorer, held_out: SceneIndices, progress: Callable[[int, int], None]
) -> Iterator[tuple[Simulated, ScoredChunk]]:
    """Rollouts chunk by chunk, each scored against its scene.

    Under eval.seed_scope=run every rollout is scored against all scenes: the runs of one row at a time, so that memory
    does not grow with the number of rows.
    """
    eval, done = rollouts.config.eval, 0
    is_shared = eval.seed_scope is SeedScope.run
    for simulated in rollouts.chunks():
        n = simulated.frames.x.shape[-1]
        for start in range(0, n, eval.n_runs if is_shared else n):
            columns = slice(start, min(start + eval.n_runs, n) if is_shared else n)
            selected = jax.tree.map(lambda leaf, columns=columns: leaf[..., columns], simulated)
            part = rollouts[done : done + columns.stop - start]
            scene, column = part.scene, np.arange(len(part))
            if is_shared:
                column, scene = np.repeat(column, len(held_out)), np.tile(held_out, len(part))
            track = None if part.boundary is None else part.boundary.track_id[part.column]
            metrics = scorer.simulated(selected, column, scene, track)
            yield selected, ScoredChunk(column, scene, part.run[column], metrics)
            done += len(part)
            progress(done, len(rollouts))


def _joined(name: str, chunks: list[ScoredChunk], n_rollouts: int) -> Scores:
    scene, run = (np.concatenate([getattr(chunk, index) for chunk in chunks]) for index in ("scene", "run"))
    metrics = join_scenarios([chunk.metrics for chunk in chunks])
    return scores_of(name, scene, run, metrics, n_rollouts=n_rollouts)


def reference_rows(config: EvaluateTask, scenes: SceneSet, held_out: SceneIndices, scorer: Scorer) -> list[Scores]:
    """The rows real against real, noise floor and real (the held-out scenes themselves)."""
    begin = time.perf_counter()
    partner, scene, run = partners(scenes, held_out, config.eval)
    both = scorer.recorded(np.concatenate([held_out, partner]), np.concatenate([held_out, scene]))
    scored = time.perf_counter()
    held_out_metrics, partner_metrics = (
        jax.tree.map(lambda leaf, pairs=pairs: leaf[..., pairs], both)
        for pairs in (slice(None, len(held_out)), slice(len(held_out), None))
    )
    run_0 = np.zeros(len(held_out), np.int64)
    real = scores_of(REAL, held_out, run_0, held_out_metrics, partner=held_out, seconds=scored - begin)
    others = scores_of(REAL_VS_REAL, scene, run, partner_metrics, partner=partner, seconds=scored - begin)
    chosen, column = np.unique(partner, return_inverse=True)
    paths, observed = (recorded_paths(scenes, index, config) for index in (chosen, held_out))
    others = with_paths(others, paths, column, observed, held_out)
    floor = noise_floor_scores(scenes, held_out, config.hist, config.eval)
    return [of_recordings(others, scenes), floor, of_recordings(real, scenes)]


def speed_histogram_edges(hist: HistConfig) -> Float[np.ndarray, " edges"]:
    """Edges of the drawn speed histogram [m/s]; they include the edges of the Hellinger distance's bins."""
    return np.linspace(hist.low, hist.high, DRAWN_BINS_PER_BIN * hist.n_bins + 1)


def example_scene(scenes: SceneSet, held_out: SceneIndices, scene_id: int | None) -> int:
    """Index of the scene in the space-time diagram: the requested one, or the held-out one of median mean speed.

    The choice depends on the recordings alone, so that no simulation is chosen because it looks good.

    Raises:
        ValueError: The requested scene is not held out.
    """
    if scene_id is None:
        speed = scenes.speed[held_out].mean(axis=(1, 2))
        return int(held_out[np.argsort(speed, kind="stable")[(len(held_out) - 1) // 2]])
    return int(named_scenes(scenes, held_out, [scene_id], "eval.example")[0])


def named_scenes(
    scenes: SceneSet, held_out: SceneIndices, scene_ids: Collection[int], key: str
) -> Int[np.ndarray, " named"]:
    """Indices of the scenes with these numbers, in ascending order; `key` is the configuration key that names them.

    Raises:
        ValueError: One of them is not held out.
    """
    ids = scenes.scene_id[held_out]
    missing = sorted(set(scene_ids) - set(ids.tolist()))
    if missing:
        known = ", ".join(map(str, ids[:20])) + (", ..." if len(ids) > 20 else "")
        message = f"must be held-out scenes: {known}"
        raise InvalidInputError(Problem("scene-not-held-out", message, key=key, value=missing[0]))
    return held_out[np.isin(ids, list(scene_ids))]
