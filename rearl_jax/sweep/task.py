"""The task `rearl sweep thresholds`: which thresholds of the detection bring the traffic closest to the recorded one.

Writes into the study folder `base_values.parquet` (what the percentiles are taken of), `table3.parquet` (one row per
pair), `runs.parquet` (one row per pair, scene and run), `summary.json`, two PNG figures and `config.json`.
"""

import logging
from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.clustering.references import ReferenceBuilder
from rearl_jax.config import SweepThresholdsTask
from rearl_jax.config.evaluation import Method, SeedScope
from rearl_jax.data.recordings import count_recordings, data_id, is_generated, iterate_recordings
from rearl_jax.data.splits import split_scenes
from rearl_jax.evaluation.percentiles import BaseValues, base_values
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.runner import scored_rollouts
from rearl_jax.evaluation.task import read_scenes
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.sweep import terminal
from rearl_jax.sweep.pairs import Pair, choose, pair_table, scene_means, threshold_pairs

log = logging.getLogger(__name__)

FIGURES = ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions")
"""Metrics of the table beside the two that decide."""


def run(config: SweepThresholdsTask) -> dict:
    """The summary: thresholds, best pair, lead over the runner-up.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, one is bad, too few scenes can be cut from them, or two
            keys contradict each other.
    """
    if config.eval.seed_scope is not SeedScope.run_x_scene:
        raise ValueError("a sweep scores every rollout against its own scene: set eval.seed_scope=run_x_scene")
    config = replace(config, method=Method.rearl)
    generated = is_generated(config.data)
    study = Study(
        config.results.root, config.study, config, "sweep thresholds", data_id(config.data), generated=generated
    )
    study.write_config()
    with progress_bar() as bar:
        reading = bar.add_task("recordings", total=count_recordings(config.data))
        builder = ReferenceBuilder(config)
        recordings = builder.passing(iterate_recordings(config.data))
        scenes = read_scenes(config, recordings, lambda: bar.advance(reading))
        splits = split_scenes(scenes, config.split)
        references, clusters = builder.build(scenes, splits, study)
        simulating = bar.add_task("base", total=None)
        base = base_values(
            config, scenes, splits.threshold, lambda done, total: bar.update(simulating, completed=done, total=total)
        )
        pairs = threshold_pairs(config.sweep, base)
        trying = bar.add_task("threshold pairs", total=None)
        thresholds = [(pair.threshold_h, pair.threshold_m) for pair in pairs]
        rollouts = Rollouts(config, scenes, splits.tuning, references, thresholds)
        row = scored_rollouts(
            config,
            rollouts,
            scenes,
            lambda done, total: bar.update(trying, completed=done, total=total),
        )
    values = dict(row.values)
    mape = values[f"mape_{config.mape.definition.name.lower()}"]
    means = {name: scene_means(values[name], rollouts.cell, rollouts.scene, splits.tuning) for name in FIGURES} | {
        "mape": scene_means(mape, rollouts.cell, rollouts.scene, splits.tuning)
    }
    choice = choose(means["h"], means["mape"], config.eval)
    table = pair_table(pairs, means, choice)
    metadata = {
        "seeds": f"eval.seed={config.eval.seed}, split.seed={config.split.seed}",
        "scenes_id": scenes.data_id,
        "mape": config.mape.definition.name,
        "references": ", ".join(map(str, clusters.reference_scenes)),
    }
    study.write_table("base_values", _base_table(base), **metadata)
    study.write_table("runs", _run_table(pairs, rollouts, scenes.scene_id, values), **metadata)
    study.write_table("table3", table, **metadata)
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
        "best_win_share": float(choice.win_share[choice.best]),
        "lead": choice.lead,
        "lead_low": choice.lead_low,
        "lead_high": choice.lead_high,
        "is_distinguishable": choice.is_distinguishable,
    }
    study.write_summary(summary)
    note = " (GENERATED recordings)" if generated else ""
    terminal.print_pairs(config, pairs, table, choice, base, note)

    # Only now, so that nobody waits for matplotlib to see the table.
    from rearl_jax.sweep.figures import cumulative, heat_maps

    subset = f"{len(base.scene)} threshold scenes x {config.eval.n_runs} runs{note}"
    study.write_bytes("base_values.png", cumulative(base, config.sweep, f"Base on {subset}"))
    tuning = f"{len(splits.tuning)} tuning scenes x {config.eval.n_runs} runs{note}"
    study.write_bytes("pairs.png", heat_maps(table, f"Threshold pairs on {tuning}; smaller is closer"))
    return summary


def _base_table(base: BaseValues) -> pd.DataFrame:
    """One row per value: `cue` (h or mape), `value`."""
    cues = pd.Categorical.from_codes(np.repeat([0, 1], [len(base.h), len(base.mape)]), ["h", "mape"])
    return pd.DataFrame({"cue": cues, "value": np.concatenate([base.h, base.mape]).astype(np.float32)})


def _run_table(
    pairs: list[Pair], rollouts: Rollouts, scene_id: np.ndarray, values: dict[str, np.ndarray]
) -> pd.DataFrame:
    """One row per pair, scene and run: percentiles, thresholds, `scene_id`, `run`, every metric."""
    columns = {name: np.array([getattr(pair, name) for pair in pairs])[rollouts.cell] for name in vars(pairs[0])}
    columns |= {"scene_id": scene_id[rollouts.scene].astype(np.int32), "run": rollouts.run.astype(np.int32)}
    return pd.DataFrame(columns | {name: figures.astype(np.float32) for name, figures in values.items()})
