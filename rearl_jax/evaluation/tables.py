"""Scores and estimates as tables: Parquet frames and the objects of summary.json.

A cell without a figure is missing (null).
"""

import json
from typing import TypeAlias

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.config import EvaluateTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.estimates import BASE, LESS_BASE, Estimate
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.scores import REAL, TITLES, Scores
from rearl_jax.metrics import METRICS

Column: TypeAlias = np.ndarray | pd.Categorical | pd.arrays.IntegerArray | pd.arrays.FloatingArray

HEADINGS = {
    "h": "H",
    "mape_a": "MAPE A",
    "mape_b": "MAPE B",
    "mape_c": "MAPE C",
    "thw": "THW [s]",
    "lcr": "LCR [1/s]",
    "collisions": "crashed",
    "realism": "realism",
}
"""Metrics of the first table and their short headings; a second table and the files contain all metrics."""


def run_table(evaluation: Evaluation) -> pd.DataFrame:
    """One row per scored pair: `method` (or reference row), `scene_id`, `recording`, `run`, `partner`, then
    every metric and, under `<metric>_n`, its number of samples.

    `partner` is the scene_id of the recorded scene in place of a simulation; missing for simulations.
    """
    return pd.concat([_run_rows(evaluation, row) for row in evaluation.rows], ignore_index=True)


def _run_rows(evaluation: Evaluation, row: Scores) -> pd.DataFrame:
    n = len(row.scene)
    partner = np.zeros(n, np.int64) if row.partner is None else evaluation.scenes.scene_id[row.partner]
    columns = _keys(evaluation, row) | {
        "partner": pd.arrays.IntegerArray(partner.astype(np.int64), np.full(n, row.partner is None)),
    }
    for name in METRICS:
        columns[name] = _masked(row.values.get(name, np.full(n, np.nan)))
        columns[f"{name}_n"] = row.counts.get(name, np.zeros(n)).astype(np.int32)
    return pd.DataFrame(columns)


def frame_table(evaluation: Evaluation, window: int) -> pd.DataFrame:
    """One row per scored pair and frame: `method`, `scene_id`, `recording`, `run`, `frame`, `h`, `mape_a`,
    `mape_b`, `mape_c`, `spacing`.

    h is that of the window that ends at the frame, so the first `window` - 1 frames have none. The
    row `real` has only the spacing.
    """
    parts = []
    for row in evaluation.rows:
        if row.series is None:
            continue
        n_frames, n_pairs = row.series.spacing.shape
        keys = _keys(evaluation, row)
        columns: dict[str, Column] = {name: values.repeat(n_frames) for name, values in keys.items()}
        columns["frame"] = np.tile(np.arange(n_frames, dtype=np.int16), n_pairs)
        for name, values in frame_series(row, window).items():
            columns[name] = _masked(values.T.reshape(-1))
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def frame_series(row: Scores, window: int) -> dict[str, Float[np.ndarray, "frames pairs"]]:
    """h, spacing errors and mean spacing of a row; NaN where there is no figure.

    Raises:
        ValueError: The row has no figures per frame.
    """
    series = row.series
    if series is None:
        raise ValueError(f"row {row.row} has no figures per frame")
    no_window = np.full((window - 1, series.h.shape[1]), np.nan, series.h.dtype)
    h = np.concatenate([no_window, np.where(series.h_valid, series.h, np.nan)])
    errors = {
        name: np.where(series.mape_valid, getattr(series, name), np.nan) for name in ("mape_a", "mape_b", "mape_c")
    }
    compared = {"h": h} | errors
    if row.row == REAL:
        compared = {name: np.full_like(values, np.nan) for name, values in compared.items()}
    return compared | {"spacing": np.asarray(series.spacing)}


def _keys(evaluation: Evaluation, row: Scores) -> dict[str, Column]:
    """Columns that identify a scored pair."""
    scenes = evaluation.scenes
    return {
        "method": pd.Categorical([row.row], [r.row for r in evaluation.rows]).repeat(len(row.scene)),
        "scene_id": scenes.scene_id[row.scene].astype(np.int32),
        "recording": pd.Categorical(scenes.recording[row.scene], np.unique(scenes.recording)),
        "run": row.run.astype(np.int32),
    }


def _masked(values: Float[np.ndarray, " rows"]) -> pd.arrays.FloatingArray:
    """float32 with missing instead of NaN."""
    missing = ~np.isfinite(values)
    return pd.arrays.FloatingArray(np.where(missing, 0, values).astype(np.float32), missing)


def summary_table(
    evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate], confidence: float
) -> pd.DataFrame:
    """One row per method (or reference row) and metric: its estimate, unit, definition, better direction."""
    rows = []
    for (method, name), estimate in estimates.items():
        metric = METRICS[name]
        row = evaluation.row(method)
        rows.append(
            {
                "method": method,
                "metric": name,
                "unit": metric.unit,
                "better": metric.direction.name,
                **vars(estimate),
                "confidence": confidence,
                "n_rollouts": row.n_rollouts,
                "definition": metric.definition,
                "source": metric.source,
            }
        )
    frame = pd.DataFrame(rows)
    ends = [f"{name}{end}" for name in ("difference", "less_base") for end in ("", "_low", "_high")]
    for name in ("value", "sd", "low", "high", *ends):
        frame[name] = frame[name].astype("Float64")
    return frame


def summary_rows(
    evaluation: Evaluation, estimates: dict[tuple[str, str], Estimate]
) -> list[dict[str, str | int | float | None]]:
    """The objects of summary.json, one per row of the table, the method first.

    Keys: method, every metric by its name with `_sd` (over runs), `_low` and `_high` (bootstrap interval over
    scenes), n_scenes, n_rollouts, seconds; for a method other than base also `_less_base`, `_less_base_low`,
    `_less_base_high`; and the keys that the method adds, null in the other rows. Null if there is no figure.
    """
    methods = [row.row for row in evaluation.rows if row.row not in TITLES]
    compared = LESS_BASE if BASE in methods and len(methods) > 1 else ()
    added_by_method = {name: value for extra in evaluation.extras for name, value in extra.summary.items()}
    absent = {name: None for figures in evaluation.figures.values() for name in figures}
    objects = []
    for row in evaluation.rows:
        figures: dict[str, str | int | float | None] = {"method": row.row}
        for name in METRICS:
            estimate = estimates.get((row.row, name))
            figures[name] = None if estimate is None else estimate.value
            for part in ("sd", "low", "high", *compared):
                figures[f"{name}_{part}"] = None if estimate is None else getattr(estimate, part)
        figures["n_scenes"] = len(np.unique(row.scene))
        figures["n_rollouts"] = row.n_rollouts
        figures["seconds"] = round(row.seconds, 3)
        figures |= added_by_method if row.row == evaluation.main else dict.fromkeys(added_by_method)
        figures |= absent | dict(evaluation.figures.get(row.row, {}))
        objects.append(figures)
    return objects


def metadata(config: EvaluateTask, evaluation: Evaluation) -> dict[str, str]:
    """Metadata of every table besides its provenance."""
    return {
        "seeds": config.seeds,
        "scenes_id": evaluation.scenes.data_id,
        "speed_min": str(evaluation.scenes.speed_min),
        "speed_max": str(evaluation.scenes.speed_max),
        "mape_definition": config.mape.definition.name,
        "definitions": json.dumps({name: metric.definition for name, metric in METRICS.items()}),
    }


def source_names(scenes: SceneSet) -> str:
    """Data sets of the scenes."""
    return ", ".join(dict.fromkeys(info.source for info in scenes.infos))
