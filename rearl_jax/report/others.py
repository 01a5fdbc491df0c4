"""The reports on `rearl sweep thresholds` and `study ...`: tables and what follows from them."""

import re
from collections.abc import Iterable
from importlib import import_module
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.evaluation.tables import written
from rearl_jax.metrics import METRICS
from rearl_jax.report.content import Content, Section, interval, number, shown_frame, spoken
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.results import PROVENANCE
from rearl_jax.study.report import NONE, Cell, Line, Shown

_SWEEP_CAPTIONS = {
    "base_values": "Values of the method base on the threshold scenes, whose percentiles become thresholds.",
    "pairs": "Errors of every pair of thresholds on the tuning scenes; smaller is closer.",
}

_SWEEP_HEADINGS = ("H", "MAPE", "THW [s]", "LCR [1/s]", "crashed")


def sweep_content(study: FinishedStudy) -> Content:
    """What the report on a sweep of thresholds says: the best pair, and whether the scenes can tell it from the next.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    (summary,) = study.rows
    needed = ("best_h_pct", "best_m_pct", "best_score", "base_score", "best_win_share", "lead", "is_distinguishable")
    study.needs(summary, needed, "summary.json")
    table = study.table("table3")
    study.needs(table, ("h_pct", "m_pct", "score"), "table3.parquet")
    named = table.assign(pair=[f"{h:g} % / {m:g} %" for h, m in zip(table["h_pct"], table["m_pct"], strict=True)])
    metrics = ("h", "mape", "thw", "lcr", "collisions")
    columns = ("pair", "threshold_h", "threshold_m", "score", "win_share", *metrics)
    names = ("pair", "threshold of H", "threshold of MAPE", "score", "best in resamples", *_SWEEP_HEADINGS)
    told = "can" if summary["is_distinguishable"] else "cannot"
    lead = f"{number(summary['lead'])} ({interval(summary['lead_low'], summary['lead_high'])})"
    result = (
        f"Of {summary['n_pairs']} pairs of thresholds the percentiles {summary['best_h_pct']:g} % and "
        f"{summary['best_m_pct']:g} % leave the least error, {number(summary['best_score'])} beside "
        f"{number(summary['base_score'])} without interventions; the scenes {told} tell it from the next, its lead is "
        f"{lead}."
    )
    return Content(
        title="Thresholds of the detection",
        result=result,
        sections=(
            Section(
                "Pairs of thresholds",
                ("Percentiles of Hellinger distance / spacing error; score: sum of both errors, smaller is closer.",),
                (shown_frame("Every pair on the tuning scenes", named.sort_values("score"), columns, names),),
            ),
        ),
        data=f"{summary['n_rollouts']:,} rollouts; {study.config.seeds}.",
        words="sweep thresholds",
        captions=_SWEEP_CAPTIONS,
    )


def paper_content(study: FinishedStudy) -> Content:
    """What the report on a study beside the paper says: its table, ours above the paper's.

    Raises:
        FileNotFoundError, ValueError: The table is missing, or of an older version.
    """
    (summary,) = study.rows
    name = study.task.words.rpartition(" ")[2]
    table = study.table(name)
    findings = tuple(re.split(r"(?<=\.) (?=[A-Z0-9])", str(summary.get("findings") or "")))
    if {"row", "metric", "ours"} <= set(table):
        shown = _beside_paper(table)
    else:
        shown = (shown_frame("All figures", table, [one for one in table if not one.endswith(("_low", "_high"))]),)
    module = import_module(study.task.run.partition(":")[0])
    return Content(
        title=_first_up(study.task.summary),
        result=_closer(table) or f"{_first_up(study.task.summary)}.",
        sections=(
            Section("Ours beside the paper's", tables=shown, items=tuple(filter(None, findings))),
            Section("Other figures", is_folded=True, tables=(_flat(summary, table["row"] if "row" in table else ()),)),
        ),
        data="",
        words=study.task.words,
        captions=module.CAPTIONS,
    )


def _first_up(text: str) -> str:
    return text[:1].upper() + text[1:]


def _closer(table: pd.DataFrame) -> str:
    """How many rows are closer to the recorded traffic than base; empty where that was not asked."""
    if not {"metric", "less_base_low", "less_base_high"} <= set(table):
        return ""
    of_h = table[(table["metric"] == "h") & table["less_base_low"].notna()]
    if of_h.empty:
        return ""
    low, high = np.array(of_h[["less_base_low", "less_base_high"]], np.float64).T
    closer, farther = int((high < 0).sum()), int((low > 0).sum())
    left = len(of_h) - closer - farther
    return (
        f"By the Hellinger distance of speeds, {closer} of {len(of_h)} rows are closer to the recorded traffic than "
        f"base, {farther} are farther and {left} cannot be told apart from it."
    )


def _beside_paper(table: pd.DataFrame) -> tuple[Shown, ...]:
    """One line per row, one column per metric; the paper's figures on a line of their own."""
    keys = [name for name in ("row", "batch") if name in table]
    metrics = list(dict.fromkeys(table["metric"]))
    lines = []
    for _, part in table.groupby(keys, sort=False):
        found = {row["metric"]: row for row in part.astype(object).to_dict("records")}
        first = next(iter(found.values()))
        title = str(first.get("title", first["row"])) + (f", {first['batch']} at a time" if "batch" in keys else "")
        lines.append(Line(title, tuple(_ours(found.get(metric), metric) for metric in metrics)))
        paper = tuple(Cell(_figure(found.get(metric, {}).get("paper"), metric)) for metric in metrics)
        if any(cell.figure != NONE for cell in paper):
            lines.append(Line(f"paper: {title}", paper, is_paper=True))
    return (Shown("Every row, the paper's below ours", tuple(map(_heading, metrics)), tuple(lines)),)


def _heading(metric: str) -> str:
    known = METRICS.get(metric)
    return spoken(metric) if known is None else f"{known.title} [{known.unit}]"


def _ours(row: dict[str, Any] | None, metric: str) -> Cell:
    if row is None:
        return Cell(NONE)
    ours, low, high = (_figure(row.get(name), metric) for name in ("ours", "low", "high"))
    return Cell(ours, "" if NONE in (low, high) else f"{low} to {high}")


def _figure(value: Any, metric: str) -> str:
    """A figure with the digits that the metric deserves, where it is one of ours."""
    if metric not in METRICS or value is None or pd.isna(value):
        return number(value)
    return written(float(value), metric)


_SHORT = 100
"""Characters of a text that is a figure, not a paragraph."""


def _flat(summary: Any, rows: Iterable[str]) -> Shown:
    """Figures of summary.json that belong to no row of the table, without the provenance."""
    plain = {key: value for key, value in summary.items() if not isinstance(value, (list, dict))}
    left_out = ("_low", "_high", "_paper", "_sd")
    lines = [
        Line(spoken(key), (Cell(number(value), interval(plain.get(f"{key}_low"), plain.get(f"{key}_high"))),))
        for key, value in plain.items()
        if key not in PROVENANCE
        and not key.endswith(left_out)
        and not key.startswith(tuple(f"{row}_" for row in rows))
        and value is not None
        and len(str(value)) <= _SHORT
    ]
    return Shown("Figures of summary.json", ("value",), tuple(lines))
