"""Table 1 as people read it, as one long table, and as flat figures."""

from collections.abc import Iterator
from typing import Any

import pandas as pd

from rearl_jax.config import StudyTable1Task
from rearl_jax.evaluation.estimates import Estimate
from rearl_jax.evaluation.scores import TITLES
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.evaluation.terminal import short
from rearl_jax.metrics import METRICS
from rearl_jax.study.published import TABLE1, PublishedRow
from rearl_jax.study.report import NONE, Cell, Line, Shown, long_table
from rearl_jax.study.row_results import REFERENCES, Evaluated, Results

TITLES_OF_METRICS = {
    "h": HEADINGS["h"],
    "h_legacy": "H legacy",
    **{name: title for name, title in HEADINGS.items() if name != "h"},
}
"""Metrics of the table, and their headings."""

LESS_BASE = tuple(name for name in TITLES_OF_METRICS if name not in ("h_legacy", "realism"))
"""Metrics of the table of differences; H legacy differs as H does."""

PUBLISHED = {"h_legacy": "h_legacy", "mape_a": "mape", "thw": "thw", "lcr": "lcr"}
"""The paper's column that stands under a metric of ours."""

EXTRAS = ("trigger_rate", "main_reference_share", "ratio_aggressive", "ratio_defensive", "ratio_truck")
"""Figures of the closed loop and of CRITICAL that have no interval."""


def paper_figure(row: PublishedRow | None, metric: str) -> float | None:
    """What the paper has under a metric; None where it has none."""
    return None if row is None or metric not in PUBLISHED else getattr(row, PUBLISHED[metric])


def shown_tables(config: StudyTable1Task, results: Results) -> tuple[Shown, Shown]:
    """The figures with their intervals beside the paper's, and what every row changes against base."""
    percent = f"{100 * config.eval.confidence:g} % intervals"
    figures = Shown(
        f"Table 1, ours beside the paper's; {results.n_scenes} held-out scenes, {percent}",
        tuple(TITLES_OF_METRICS.values()),
        tuple(_lines(results)),
    )
    headings = (*(TITLES_OF_METRICS[metric] for metric in LESS_BASE), "scenes", "rollouts")
    lines = tuple(_less_base_line(item) for item in results.rows)
    return figures, Shown(f"Less base, from the same initial states, paired over scenes; {percent}", headings, lines)


def _lines(results: Results) -> Iterator[Line]:
    """Our rows, each group followed by the paper's rows it stands beside; then the reference rows."""
    rows = results.rows
    for item, following in zip(rows, [*rows[1:], None], strict=True):
        yield _line(item, item.method, item.row.title)
        if item.row.paper is not None and (following is None or following.row.paper != item.row.paper):
            for name in _group(item.row.paper):
                cells = (_paper_cell(TABLE1[name], metric) for metric in TITLES_OF_METRICS)
                yield Line(f"paper: {TABLE1[name].title}", tuple(cells), is_paper=True)
    for name in REFERENCES:
        yield _line(results.reference, name, TITLES[name])


def _group(paper: str) -> list[str]:
    """The paper's rows of the same method: all language models of REARL together."""
    return [name for name in TABLE1 if name.partition("_")[0] == paper.partition("_")[0]]


def _paper_cell(row: PublishedRow, metric: str) -> Cell:
    value = paper_figure(row, metric)
    return Cell(NONE if value is None else short(value, metric))


def _line(item: Evaluated, method: str, title: str) -> Line:
    return Line(title, tuple(_cell(item.estimates.get((method, metric)), metric) for metric in TITLES_OF_METRICS))


def _cell(estimate: Estimate | None, metric: str) -> Cell:
    if estimate is None:
        return Cell(NONE)
    return Cell(short(estimate.value, metric), _ends(estimate.low, estimate.high, metric))


def _ends(low: float | None, high: float | None, metric: str) -> str:
    return "" if low is None or high is None else f"{short(low, metric)}–{short(high, metric)}"


def _less_base_line(item: Evaluated) -> Line:
    cells = [_less_base_cell(item.estimate(metric), metric) for metric in LESS_BASE]
    counts = (Cell(str(item.figures["n_scenes"])), Cell(str(item.figures["n_rollouts"])))
    return Line(item.row.title, (*cells, *counts))


def _less_base_cell(estimate: Estimate | None, metric: str) -> Cell:
    if estimate is None or estimate.less_base is None:
        return Cell(NONE)
    low, high = estimate.less_base_low, estimate.less_base_high
    sign = "+" if estimate.less_base > 0 else ""
    ends = "" if low is None or high is None else f"{short(low, metric)} {short(high, metric)}"
    return Cell(sign + short(estimate.less_base, metric), ends)


def long_rows(results: Results) -> pd.DataFrame:
    """`row`, `title`, `metric`, `unit`, `ours`, `low`, `high`, `sd`, `less_base` with its ends, `paper`, `paper_row`,
    `n_scenes`, `n_rollouts`; one row per row of the table and metric.

    The paper's rows that stand beside none of ours have rows of their own, called `paper_NAME`.
    """
    records: list[dict[str, Any]] = []
    for item in results.rows:
        records += _records(item, item.method, item.row.name, item.row.title, item.row.paper)
        records += [
            {"row": item.row.name, "title": item.row.title, "metric": name, "unit": "-", "ours": item.figures[name]}
            for name in EXTRAS
            if item.figures.get(name) is not None
        ]
    for name in REFERENCES:
        records += _records(results.reference, name, name, TITLES[name], None)
    beside = {item.row.paper for item in results.rows}
    records += [
        {"row": f"paper_{name}", "title": row.title, "metric": metric, "unit": METRICS[metric].unit, "paper_row": name}
        | {"paper": paper_figure(row, metric)}
        for name, row in TABLE1.items()
        if name not in beside
        for metric in PUBLISHED
    ]
    return long_table(records)


def _records(item: Evaluated, method: str, row: str, title: str, paper: str | None) -> list[dict[str, Any]]:
    found = []
    for metric in METRICS:
        estimate = item.estimates.get((method, metric))
        if estimate is None:
            continue
        published = paper_figure(None if paper is None else TABLE1[paper], metric)
        found.append(
            {
                "row": row,
                "title": title,
                "metric": metric,
                "unit": METRICS[metric].unit,
                "ours": estimate.value,
                **{name: getattr(estimate, name) for name in ("low", "high", "sd")},
                **{name: getattr(estimate, name) for name in ("less_base", "less_base_low", "less_base_high")},
                "paper": published,
                "paper_row": None if published is None else paper,
                "n_scenes": estimate.n_scenes,
                "n_rollouts": item.rollouts[method],
            }
        )
    return found


def summary_of(config: StudyTable1Task, results: Results, findings: list[str]) -> dict:
    """Flat figures: `n_rows`, `n_scenes`, `mape`, `findings`, and for every row `ROW_METRIC` with `_low`, `_high`,
    `_less_base`, `_less_base_low`, `_less_base_high` and `_paper`; None where there is no figure.
    """
    summary: dict[str, Any] = {
        "n_rows": len(results.rows),
        "n_scenes": results.n_scenes,
        "mape": config.mape.definition.name,
        "findings": " ".join(findings),
    }
    lines = [(item.row.name, item, item.method, item.row.paper) for item in results.rows]
    lines += [(name, results.reference, name, None) for name in REFERENCES]
    for row, item, method, paper in lines:
        for metric in TITLES_OF_METRICS:
            estimate, key = item.estimates.get((method, metric)), f"{row}_{metric}"
            summary[key] = None if estimate is None else estimate.value
            for part in ("low", "high", "less_base", "less_base_low", "less_base_high"):
                summary[f"{key}_{part}"] = None if estimate is None else getattr(estimate, part)
            summary[f"{key}_paper"] = paper_figure(None if paper is None else TABLE1[paper], metric)
    return summary
