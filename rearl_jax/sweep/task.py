"""The task `rearl sweep thresholds`: finds the detection thresholds whose traffic is closest to the recorded one.

Writes into the study folder `base_values.parquet` (errors of the method base, whose percentiles are the thresholds),
`runs/part-*.parquet` (one row per pair, scene and run), `table3.parquet` (one row per pair), two PNG figures,
`page.html`, `config.json` and, last of all, `summary.json`. An interrupted study continues.
"""

import json
from functools import partial

import numpy as np
import pandas as pd

from rearl_jax.config import SweepThresholdsTask
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.console import generated_mark
from rearl_jax.data.recordings import is_generated
from rearl_jax.document.document import data_sources
from rearl_jax.document.publishing import publish_document
from rearl_jax.evaluation.boundaries import check_boundary
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.percentiles import BaseValues
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.scores import Scores
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED
from rearl_jax.evaluation.traffic import inputs_id, require_one_variant
from rearl_jax.problems import out_of_range
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision
from rearl_jax.sweep.base_values import kept_base_values
from rearl_jax.sweep.document import document_of
from rearl_jax.sweep.pairs import Pair, base_score, choose, pair_table, scene_means, threshold_pairs
from rearl_jax.sweep.parts import RUNS, run_columns, write_runs

FIGURES = ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions")
"""Metrics of the table; the choice depends on h, and on that of the spacing errors which `mape.definition` names."""


def run(config: SweepThresholdsTask, *, show: bool = True) -> dict:
    """The summary: thresholds, best pair, lead over the runner-up.

    Args:
        config: The task.
        show: Whether the table is printed.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, too few scenes can be cut from
            them, or two keys contradict each other.
    """
    if config.eval.seed_scope is not SeedScope.run_x_scene:
        message = "must be run_x_scene: a sweep scores every rollout against its own scene"
        raise out_of_range("eval.seed_scope", message, config.eval.seed_scope.name)
    if config.method is not Method.rearl:
        raise out_of_range("method", "must be rearl, others have no thresholds", config.method.name)
    require_one_variant(config)
    check_boundary(config)
    set_precision(config.core.dtype)
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "sweep thresholds", inputs_id(config), generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=True)
        scenes, splits = inputs.scenes, inputs.splits
        assert inputs.clusters is not None  # read_inputs was called with_references
        metadata = {
            "seeds": config.seeds,
            "scenes_id": scenes.data_id,
            "mape": config.mape.definition.name,
            "references": ", ".join(map(str, inputs.clusters.reference_scenes)),
        }
        base = kept_base_values(config, study, scenes, splits.threshold, metadata, shown(bar, "base"))
        pairs = threshold_pairs(config.sweep, base)
        rows = [Row(config, pair.name, (pair.threshold_h, pair.threshold_m)) for pair in pairs]
        # Base is the row with infinite thresholds, in the same program and with bitwise equal results.
        rows.append(Row(config, Method.base.name, NEVER_EXCEEDED))
        rollouts = Rollouts(rows, scenes, splits.tuning, inputs.references)
        table_of = partial(_run_table, pairs, scenes.scene_id)
        write_runs(study, rollouts, scenes, table_of, metadata, shown(bar, "threshold pairs"))
    runs = pd.read_parquet(study.path / RUNS)
    means = {
        name: scene_means(runs[column].to_numpy(np.float64), rollouts.row, rollouts.scene, splits.tuning)
        for name, column in ({name: name for name in FIGURES} | {"mape": config.mape.column}).items()
    }
    of_pairs = {name: values[:-1] for name, values in means.items()}
    choice = choose(of_pairs["h"], of_pairs["mape"], config.eval)
    table = pair_table(pairs, of_pairs, choice)
    base_means = {name: float(np.nanmean(values[-1])) for name, values in means.items()}
    study.write_table("table3", table, **metadata, base=json.dumps(base_means))
    best = pairs[choice.best]
    summary = {
        "n_pairs": len(pairs),
        "n_rollouts": len(rollouts),
        "n_values_h": len(base.h),
        "n_values_mape": len(base.mape),
        "best_h_pct": best.h_pct,
        "best_m_pct": best.m_pct,
        "best_threshold_h": best.threshold_h,
        "best_threshold_m": best.threshold_m,
        "best_score": float(choice.score[choice.best]),
        "base_score": base_score(means["h"][-1], means["mape"][-1], choice.is_scored),
        "best_win_share": float(choice.win_share[choice.best]),
        "lead": choice.lead,
        "lead_low": choice.lead_low,
        "lead_high": choice.lead_high,
        "is_distinguishable": choice.is_distinguishable,
    }
    sources = data_sources(scenes.infos)
    document = document_of(config, table, summary, base_means, generated=generated, sources=sources)
    draw = partial(_draw, config, base, table, len(splits.tuning), generated=generated)
    publish_document(study, document, config, summary, draw, data_id=scenes.data_id, show=show)
    return summary


def _draw(
    config: SweepThresholdsTask, base: BaseValues, table: pd.DataFrame, n_tuning: int, *, generated: bool
) -> dict[str, bytes]:
    """The figures, PNG by name."""
    from rearl_jax.sweep.figures import cumulative, heat_maps

    scenes = f"{n_tuning} tuning scenes x {config.eval.n_runs} runs{generated_mark(generated)}"
    return {
        "base_values": cumulative(base, config, generated=generated),
        "pairs": heat_maps(table, f"Threshold pairs on {scenes}; smaller is closer"),
    }


def _run_table(pairs: list[Pair], scene_id: np.ndarray, rollouts: Rollouts, scores: Scores) -> pd.DataFrame:
    """One row per pair, scene and run: percentiles, thresholds, `scene_id`, `run`, every metric.

    The rows of base come last; its percentiles are missing.
    """
    base = Pair(np.nan, np.nan, *NEVER_EXCEEDED)
    columns = {name: np.array([getattr(pair, name) for pair in [*pairs, base]])[rollouts.row] for name in vars(base)}
    return pd.DataFrame(columns | run_columns(scene_id, rollouts, scores))
