"""Table 1 as one long table, as flat figures, and as tables of the document."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import StudyTable1Task
from rearl_jax.document.document import Section
from rearl_jax.document.table import spoken
from rearl_jax.evaluation.estimates import LESS_BASE
from rearl_jax.evaluation.scores import TITLES
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.metrics import METRICS
from rearl_jax.study.document import beside_paper, less_base_table, long_table
from rearl_jax.study.published import TABLE1
from rearl_jax.study.row_results import Evaluated, Results
from rearl_jax.study.traffic.tables import sections_on_traffic, split_rows

TITLES_OF_METRICS = {
    "h": HEADINGS["h"],
    "h_legacy": "H legacy",
    **{name: title for name, title in HEADINGS.items() if name != "h"},
}
"""Metrics of the table, and their headings."""

LESS_BASE_HEADINGS = {name: title for name, title in TITLES_OF_METRICS.items() if name not in ("h_legacy", "realism")}
"""Metrics of the table of differences, and their headings; H legacy differs as H does."""

PAPER_COLUMNS = {"h_legacy": "h_legacy", "mape_a": "mape", "thw": "thw", "lcr": "lcr"}
"""Column of the paper's Table 1 by metric of ours."""

EXTRA_FIGURES = ("trigger_rate", "main_reference_share", "ratio_aggressive", "ratio_defensive", "ratio_truck")
"""Figures of the closed loop and of CRITICAL without an interval."""


def paper_figure(row: str | None, metric: str) -> float | None:
    """Value of a metric in a row of the paper's Table 1; None without a row or a value."""
    return None if row is None or metric not in PAPER_COLUMNS else getattr(TABLE1[row], PAPER_COLUMNS[metric])


def sections(config: StudyTable1Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    """Sections: our figures and the paper's, differences from base, and all metrics."""
    intervals = f"{100 * config.eval.confidence:g} % intervals"
    table, on_traffic = split_rows(table)
    ours = beside_paper(
        f"Table 1, ours and the paper's; {summary['n_scenes']} held-out scenes, {intervals}", table, TITLES_OF_METRICS
    )
    title = f"Difference from base, from the same initial states, paired over scenes; {intervals}"
    counts = {"n_scenes": "scenes", "n_rollouts": "rollouts"}
    less_base = less_base_table(title, table, LESS_BASE_HEADINGS, counts=counts)
    names = dict.fromkeys(table["metric"])
    titles = {
        name: f"{METRICS[name].title} [{METRICS[name].unit}]" if name in METRICS else spoken(name) for name in names
    }
    return (
        Section("Ours and the paper's", tables=(ours, less_base)),
        *sections_on_traffic(on_traffic, intervals),
        Section("All metrics", tables=(beside_paper("Every metric", table, titles),), is_folded=True),
    )


def verdict(table: pd.DataFrame) -> str:
    """Sentence on the number of rows that are closer to the recorded traffic than base."""
    of_h = table[(table["metric"] == "h") & table["less_base_low"].notna()]
    if of_h.empty:
        return "No row has an interval of its difference to base."
    low, high = np.array(of_h[["less_base_low", "less_base_high"]], np.float64).T
    closer, farther = int((high < 0).sum()), int((low > 0).sum())
    return (
        f"By the Hellinger distance of speeds, {closer} of {len(of_h)} rows are closer to the recorded traffic than "
        f"base, {farther} are farther and {len(of_h) - closer - farther} cannot be distinguished from it."
    )


def long_rows(results: Results) -> pd.DataFrame:
    """One line per row of the table and metric: `row`, `title`, `metric`, `unit`, `ours`, `low`, `high`, `sd`,
    `less_base` with its ends, `paper`, `paper_row`, `n_scenes`, `n_rollouts`.

    Rows of the paper without a corresponding row of ours are added under the name `paper_NAME`.
    """
    records: list[dict[str, Any]] = []
    for item in results.rows:
        records += _records(item, item.method, item.row.name, item.row.title, item.row.paper)
        records += [
            {"row": item.row.name, "title": item.row.title, "metric": name, "unit": "-", "ours": item.figures[name]}
            for name in EXTRA_FIGURES
            if item.figures.get(name) is not None
        ]
    for name, title in TITLES.items():
        records += _records(results.reference, name, name, title, None)
    shown_rows = {item.row.paper for item in results.rows}
    records += [
        {"row": f"paper_{name}", "title": row.title, "metric": metric, "unit": METRICS[metric].unit, "paper_row": name}
        | {"paper": paper_figure(name, metric)}
        for name, row in TABLE1.items()
        if name not in shown_rows
        for metric in PAPER_COLUMNS
    ]
    return long_table(records)


def _records(item: Evaluated, method: str, row: str, title: str, paper: str | None) -> list[dict[str, Any]]:
    records = []
    for metric in METRICS:
        estimate = item.estimates.get((method, metric))
        if estimate is None:
            continue
        published = paper_figure(paper, metric)
        records.append(
            {
                "row": row,
                "title": title,
                "metric": metric,
                "unit": METRICS[metric].unit,
                "ours": estimate.value,
                **{name: getattr(estimate, name) for name in ("low", "high", "sd", *LESS_BASE)},
                "paper": published,
                "paper_row": None if published is None else paper,
                "n_scenes": estimate.n_scenes,
                "n_rollouts": item.rollouts[method],
            }
        )
    return records


def summary_of(config: StudyTable1Task, results: Results, findings: list[str]) -> dict:
    """Flat figures: `n_rows`, `n_scenes`, `mape`, `findings`, and for every row `ROW_METRIC` with `_low`, `_high`,
    `_less_base`, `_less_base_low`, `_less_base_high` and `_paper`; None if there is no figure.
    """
    summary: dict[str, Any] = {
        "n_rows": len(results.rows),
        "n_scenes": results.n_scenes,
        "mape": config.mape.definition.name,
        "findings": " ".join(findings),
    }
    lines = [(item.row.name, item, item.method, item.row.paper) for item in results.rows]
    lines += [(name, results.reference, name, None) for name in TITLES]
    for row, item, method, paper in lines:
        for metric in TITLES_OF_METRICS:
            estimate, key = item.estimates.get((method, metric)), f"{row}_{metric}"
            summary[key] = None if estimate is None else estimate.value
            for part in ("low", "high", *LESS_BASE):
                summary[f"{key}_{part}"] = None if estimate is None else getattr(estimate, part)
            summary[f"{key}_paper"] = paper_figure(paper, metric)
    return summary
