"""Results of a threshold sweep: every pair with intervals, and the Pareto-optimal pairs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config import StudyTable3Task
from rearl_jax.evaluation.estimates import BASE, grouped_mean, means_with_intervals
from rearl_jax.sweep.pairs import pair_name
from rearl_jax.sweep.parts import RUNS
from rearl_jax.sweep.task import FIGURES

METRICS = (*FIGURES, "mape")
"""Metrics of a pair; `mape` is the chosen definition of the spacing error."""

_PAIR_COLUMNS = ("h_pct", "m_pct", "threshold_h", "threshold_m", "win_share")


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the Pareto-optimal points, for which no other point is as low in both values and lower in one."""
    return [
        index
        for index, (x, y) in enumerate(points)
        if not any(a <= x and b <= y and (a < x or b < y) for a, b in points)
    ]


def read_pairs(folder: Path, config: StudyTable3Task, best: tuple[float, float]) -> pd.DataFrame:
    """One row per pair of percentiles, base last: `row`, percentiles [%], thresholds, `win_share`, the mean over scenes
    of every metric with its bootstrap interval (`_low`, `_high`), `score` (sum of both errors), `is_pareto`, `is_best`.

    Args:
        folder: Results of the sweep.
        config: Definition of the spacing error; resamples, confidence and seed of the intervals.
        best: Percentiles chosen by the sweep [%].
    """
    runs, table = pd.read_parquet(folder / RUNS), pd.read_parquet(folder / "table3.parquet")
    h_pct, m_pct = (runs[name].to_numpy(np.float64, na_value=np.nan) for name in ("h_pct", "m_pct"))
    records = []
    for pair in table.to_dict("records"):
        is_pair = (h_pct == pair["h_pct"]) & (m_pct == pair["m_pct"])
        name = pair_name(pair["h_pct"], pair["m_pct"])
        records.append({"row": name} | {key: pair[key] for key in _PAIR_COLUMNS} | _figures(runs, is_pair, config))
    records.append({"row": BASE} | _figures(runs, np.isnan(h_pct), config))
    return with_choice(pd.DataFrame(records), best)


def with_choice(pairs: pd.DataFrame, best: tuple[float, float]) -> pd.DataFrame:
    """The pairs, base last, with `score`, `is_pareto` and `is_best`; `best` are the percentiles chosen by the sweep."""
    points = list(zip(pairs["h"], pairs["mape"], strict=True))[:-1]  # without base
    return pairs.assign(
        score=pairs["h"] + pairs["mape"],
        is_pareto=pairs.index.isin(pareto(points)),
        is_best=(pairs["h_pct"] == best[0]) & (pairs["m_pct"] == best[1]),
    )


def _figures(runs: pd.DataFrame, is_row: np.ndarray, config: StudyTable3Task) -> dict[str, float | None]:
    """Mean over scenes of the mean over the masked runs, and its interval, by metric; NaN and None without a value."""
    scene = runs["scene_id"].to_numpy(int)[is_row]
    subset, group = np.unique(scene, return_inverse=True)
    columns = {name: name for name in FIGURES} | {"mape": config.mape.column}
    means = {
        name: grouped_mean(runs[column].to_numpy(np.float64, na_value=np.nan)[is_row], group, len(subset))
        for name, column in columns.items()
    }
    figures = {}
    for name, (mean, low, high) in zip(means, means_with_intervals(list(means.values()), config.eval), strict=True):
        figures |= {name: mean, f"{name}_low": low, f"{name}_high": high}
    return figures
