"""The task `rearl study fig6`: errors of the methods second by second, in the form of the paper's Fig. 6.

The rows are those of Table 1. Writes `fig6.parquet` (one line per row, second and error), `fig6.png`, `page.html`,
`config.json` and, last of all, `summary.json`.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import StudyFig6Task
from rearl_jax.document.document import Section
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.progress import progress_bar
from rearl_jax.study.document import Form, beside_paper, long_table, publish
from rearl_jax.study.error_series import ErrorSeries, error_series
from rearl_jax.study.parts import begin
from rearl_jax.study.row_results import evaluate_rows
from rearl_jax.study.table1 import remarks_on_rows

THIRDS = ("first", "middle", "last")
"""Parts of a rollout in the table."""

_CAPTION = (
    "One line per row of Table 1. Lines are means over rollouts and scenes, bands hold the middle 80 % of them; blue: "
    "the row, grey: real against real, dashed: base. The first Hellinger distance is that of the first full window."
)

_NO_PAPER_VALUES = "Fig. 6: the values of the paper's figure are not known, so only our figures are shown"


def _sections(config: StudyFig6Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    metrics = ("h", config.mape.column)
    headings = {f"{metric}_{third}": f"{HEADINGS[metric]}, {third} third" for metric in metrics for third in THIRDS}
    title = f"Fig. 6, means over the thirds of a rollout; {summary['n_scenes']} held-out scenes"
    digits = dict.fromkeys(headings, 3)
    return (
        Section("Errors in the course of a rollout", tables=(beside_paper(title, thirds(table), headings, digits),)),
    )


FORM = Form("fig6", "Errors second by second", _sections, {"fig6": _CAPTION})


def run(config: StudyFig6Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: See `rearl_jax.study.table1.run`.
    """
    study = begin("study fig6", config, inputs_id(config))
    results = evaluate_rows(config)
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=results.has_references)
    metrics = ("h", config.mape.column)
    series = error_series(results, metrics)
    table = _long(series, metrics)
    parts = thirds(table)
    summary: dict[str, Any] = {"n_rows": len(results.rows), "n_scenes": results.n_scenes}
    for row, metric, ours in zip(parts["row"], parts["metric"], parts["ours"], strict=True):
        summary[f"{row}_{metric}"] = None if pd.isna(ours) else ours

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.fig6_figure import draw_series

        return {"fig6": draw_series(series, metrics, generated=inputs.scenes.generated)}

    publish(
        study,
        FORM,
        config,
        inputs.scenes,
        table,
        summary,
        remarks_on_rows(config, results, inputs, _findings(parts, metrics), _NO_PAPER_VALUES),
        draw,
        seeds=config.seeds,
    )
    return summary


def thirds(table: pd.DataFrame) -> pd.DataFrame:
    """Mean of every error of a long table in each third of the rollout, null if it has no second: `row`, `title`,
    `metric`, `ours`.
    """
    records = []
    for _, part in table.groupby(["row", "metric"], sort=False):
        row, title, metric = (part[name].iloc[0] for name in ("row", "title", "metric"))
        second, ours = part["second"].to_numpy(int), part["ours"].to_numpy(np.float64)
        third_index = len(THIRDS) * second // (second.max() + 1)
        for index, third in enumerate(THIRDS):
            values = ours[third_index == index]
            mean = float(values.mean()) if len(values) else None
            records.append({"row": row, "title": title, "metric": f"{metric}_{third}", "ours": mean})
    return long_table(records)


def _findings(parts: pd.DataFrame, metrics: tuple[str, str]) -> list[str]:
    """Sentences on whether the errors rise or fall in the course of a rollout."""
    sentences = []
    for metric in metrics:
        changes = {"higher": [], "lower": []}
        first_third, last_third = (parts[parts["metric"] == f"{metric}_{third}"] for third in ("first", "last"))
        for title, first_error, last_error in zip(
            first_third["title"], first_third["ours"], last_third["ours"], strict=True
        ):
            if pd.notna(first_error) and pd.notna(last_error) and first_error != last_error:
                changes["higher" if last_error > first_error else "lower"].append(
                    f"{title} ({last_error - first_error:+.3f})"
                )
        higher, lower = (", ".join(titles) or "no row" for titles in changes.values())
        sentences.append(f"{HEADINGS[metric]}, last less first third: higher in {higher}; lower in {lower}.")
    return sentences


def _long(series: list[ErrorSeries], metrics: tuple[str, str]) -> pd.DataFrame:
    """`row`, `title`, `metric`, `second`, `ours` (mean), `low`, `high` (of the band), `paper` (missing), `n_values`."""
    records: list[dict[str, Any]] = []
    for item in series:
        for metric in metrics:
            errors = item.errors[metric]
            keys = {"row": item.name, "title": item.title, "metric": metric, "paper": None}
            columns = (errors.second, errors.mean, errors.low, errors.high, errors.n_values)
            names = ("second", "ours", "low", "high", "n_values")
            rows = zip(*(column.tolist() for column in columns), strict=True)
            records += [keys | dict(zip(names, row, strict=True)) for row in rows]
    return long_table(records)
