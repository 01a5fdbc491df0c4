"""Evaluated rows of Table 1: estimates with intervals, and paired differences."""

import logging
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import StudyTable1Task
from rearl_jax.config.evaluation import EvaluationConfig, Method
from rearl_jax.evaluation import task
from rearl_jax.evaluation.estimates import Estimate, grouped_mean, means_with_intervals
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.results import read_summary
from rearl_jax.study.findings import Difference, RowDifferences
from rearl_jax.study.parts import carry_out
from rearl_jax.study.rows import CONTROL, Role, Row, chosen_rows, row_record

log = logging.getLogger(__name__)

_ESTIMATE = tuple(item.name for item in fields(Estimate))


@dataclass(frozen=True)
class Evaluated:
    """One row with the results of `rearl evaluate`.

    Attributes:
        row: The row.
        folder: Folder of its results.
        estimates: Estimates by row of the evaluation's table and metric.
        rollouts: Rollouts by row of the evaluation's table.
        figures: Content of its summary.json.
    """

    row: Row
    folder: Path
    estimates: dict[tuple[str, str], Estimate]
    rollouts: dict[str, int]
    figures: dict

    @property
    def method(self) -> str:
        """Name of the method's row in the evaluation's table."""
        return self.figures["method"]

    def estimate(self, metric: str) -> Estimate | None:
        """Estimate of the method; None if there is no figure."""
        return self.estimates.get((self.method, metric))

    def scene_means(self, metric: str) -> dict[int, float]:
        """Mean over the rollouts of every scene with a figure, by scene_id."""
        runs = pd.read_parquet(self.folder / "runs.parquet", columns=["method", "scene_id", metric])
        runs = runs.loc[runs["method"].to_numpy(str) == self.method]
        scene, values = runs["scene_id"].to_numpy(int), runs[metric].to_numpy(np.float64, na_value=np.nan)
        subset, group = np.unique(scene, return_inverse=True)
        means = grouped_mean(values, group, len(subset))
        return {int(name): float(mean) for name, mean in zip(subset, means, strict=True) if np.isfinite(mean)}


@dataclass(frozen=True)
class Results:
    """All rows, in the order of the table."""

    rows: list[Evaluated]

    @property
    def n_scenes(self) -> int:
        """Held-out scenes."""
        return self.rows[0].figures["n_scenes"]

    @property
    def has_references(self) -> bool:
        """True if any row compares the traffic with representative scenes."""
        return any(Method[item.method].needs_references for item in self.rows)

    @property
    def reference(self) -> Evaluated:
        """The row whose reference rows are shown; they are equal for all rows with the same number of runs."""
        return next((row for row in self.rows if not row.row.asks_model), self.rows[0])

    def differences(self, config: StudyTable1Task) -> dict[str, list[RowDifferences]]:
        """Differences of the two main errors of the study, by the title of the error."""
        return {
            HEADINGS[metric]: [self._differences_of(row, metric, config.eval) for row in self.rows]
            for metric in ("h", config.mape.column)
        }

    def _differences_of(self, row: Evaluated, metric: str, eval: EvaluationConfig) -> RowDifferences:
        estimate = row.estimate(metric)
        if estimate is None:
            return RowDifferences(row.row.title)
        less_base = less_real = None
        if estimate.less_base is not None:
            less_base = Difference(estimate.less_base, estimate.less_base_low, estimate.less_base_high)
        if estimate.difference is not None:
            less_real = Difference(estimate.difference, estimate.difference_low, estimate.difference_high)
        controls = {}
        if row.row.role is Role.matcher:
            for other in self.rows:
                if other.row.role is Role.control:
                    controls[other.row.title.removeprefix(CONTROL)] = paired_difference(row, other, metric, eval)
        known = {title: difference for title, difference in controls.items() if difference is not None}
        return RowDifferences(row.row.title, less_base, less_real, known)


def paired_difference(row: Evaluated, other: Evaluated, metric: str, eval: EvaluationConfig) -> Difference | None:
    """Difference of a metric between two rows with the same initial states; None if no scene has both."""
    means, other_means = row.scene_means(metric), other.scene_means(metric)
    difference = np.array([means[scene] - other_means[scene] for scene in means if scene in other_means])
    return Difference(*means_with_intervals([difference], eval)[0]) if len(difference) else None


def evaluate_rows(config: StudyTable1Task) -> Results:
    """The rows, each evaluated in its own folder unless it is finished there.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.evaluation.task.run`; or a chosen row does not exist.
    """
    rows = chosen_rows(config.table1, config.model)
    # All records first, so that an invalid one stops before hours of work.
    records = [row_record(row, config) for row in rows]
    evaluated = []
    for number, (row, record) in enumerate(zip(rows, records, strict=True), 1):
        log.info("row %d of %d: %s", number, len(rows), row.title)
        evaluated.append(_read(row, carry_out(task.run, record)))
    return Results(evaluated)


def _read(row: Row, folder: Path) -> Evaluated:
    table = pd.read_parquet(folder / "summary.parquet")
    estimates = {}
    rollouts = {}
    for record in table.to_dict("records"):
        known: dict[str, Any] = {name: None if pd.isna(record[name]) else record[name] for name in _ESTIMATE}
        estimates[record["method"], record["metric"]] = Estimate(**known)
        rollouts[record["method"]] = int(record["n_rollouts"])
    return Evaluated(row, folder, estimates, rollouts, read_summary(folder)[0])
