"""What a threshold sweep left behind: every pair with intervals, and which pairs no other beats in both errors."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config import StudyTable3Task
from rearl_jax.evaluation.estimates import BASE, grouped_mean, intervals
from rearl_jax.sweep.parts import RUNS
from rearl_jax.sweep.task import FIGURES


@dataclass(frozen=True)
class PairRow:
    """A pair of percentiles [%], or base.

    Attributes:
        h_pct: Of the Hellinger distance; None for base.
        m_pct: Of the spacing error; None for base.
        thresholds: Of both.
        means: Mean over scenes of every figure; `mape` is the error that decides.
        ends: Bootstrap interval of each; None where fewer than two scenes have it.
        win_share: Share of the resamples of the scenes in which the pair is best; None for base.
    """

    h_pct: float | None
    m_pct: float | None
    thresholds: tuple[float, float] | None
    means: dict[str, float]
    ends: dict[str, tuple[float | None, float | None]]
    win_share: float | None = None

    @property
    def name(self) -> str:
        """What people read."""
        return BASE if self.h_pct is None else f"{self.h_pct:g} % / {self.m_pct:g} %"

    @property
    def score(self) -> float:
        """Sum of both errors."""
        return self.means["h"] + self.means["mape"]

    @property
    def pair(self) -> tuple[float, float] | None:
        """The percentiles; None for base."""
        return None if self.h_pct is None or self.m_pct is None else (self.h_pct, self.m_pct)


@dataclass(frozen=True)
class PairResults:
    """All pairs, base, and the sweep's own summary."""

    pairs: list[PairRow]
    base: PairRow
    summary: dict
    n_scenes: int

    @property
    def best(self) -> PairRow:
        """The pair the sweep has chosen."""
        wanted = (self.summary["best_h_pct"], self.summary["best_m_pct"])
        return next(row for row in self.pairs if row.pair == wanted)

    @property
    def front(self) -> list[PairRow]:
        """The pairs that no other beats in both errors, by rising Hellinger distance."""
        chosen = pareto([(row.means["h"], row.means["mape"]) for row in self.pairs])
        return sorted((self.pairs[index] for index in chosen), key=lambda row: row.means["h"])


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other point is at least equal to in both values and below in one."""
    return [
        index
        for index, (x, y) in enumerate(points)
        if not any(a <= x and b <= y and (a < x or b < y) for a, b in points)
    ]


def read_pairs(folder: Path, config: StudyTable3Task) -> PairResults:
    """Sweep that a folder holds, with intervals by the resamples of the configuration."""
    runs, table = pd.read_parquet(folder / RUNS), pd.read_parquet(folder / "table3.parquet")
    h_pct, m_pct = (runs[name].to_numpy(np.float64, na_value=np.nan) for name in ("h_pct", "m_pct"))
    rows = []
    for record in table.to_dict("records"):
        own = (h_pct == record["h_pct"]) & (m_pct == record["m_pct"])
        thresholds = (record["threshold_h"], record["threshold_m"])
        means, ends = _figures(runs, own, config)
        rows.append(PairRow(record["h_pct"], record["m_pct"], thresholds, means, ends, record["win_share"]))
    base = PairRow(None, None, None, *_figures(runs, np.isnan(h_pct), config))
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return PairResults(rows, base, summary, len(np.unique(runs["scene_id"].to_numpy(int))))


def _figures(
    runs: pd.DataFrame, own: np.ndarray, config: StudyTable3Task
) -> tuple[dict[str, float], dict[str, tuple[float | None, float | None]]]:
    """Mean over scenes of the mean over runs, and its interval, by figure; NaN and None where there is none."""
    scene = runs["scene_id"].to_numpy(int)[own]
    subset, group = np.unique(scene, return_inverse=True)
    columns = {name: name for name in FIGURES} | {"mape": config.mape.column}
    found = {
        name: grouped_mean(runs[column].to_numpy(np.float64, na_value=np.nan)[own], group, len(subset))
        for name, column in columns.items()
    }
    ends = intervals(np.stack(list(found.values()), axis=1), config.eval)
    means = {
        name: float(np.nanmean(values)) if np.isfinite(values).any() else math.nan for name, values in found.items()
    }
    return means, dict(zip(found, ends, strict=True))
