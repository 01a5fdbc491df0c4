"""Document of an evaluation: methods in one table, then all metrics, interventions and definitions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import (
    NONE,
    Cell,
    Emphasis,
    Row,
    Table,
    cell_with_interval,
    decimals,
    number,
    percent,
    sentence,
)
from rearl_jax.evaluation.estimates import bootstrap_over
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.evaluation.scores import NOISE_FLOOR, REAL_VS_REAL, TITLES, WITH_EFFECT, title_of
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.metrics import METRICS

CAPTIONS = {
    "speed_histogram": "Speeds of all held-out scenes, as they are compared, and of all rollouts.",
    "errors_over_time": (
        "Hellinger distance of the window that ends at each second, relative error of the mean spacing, and "
        "the mean spacing itself. Lines are means, bands hold the middle 80 % of scenes and runs."
    ),
    "space_time": (
        "Left: the vehicles picked in the snapshots of one scene, inside the observed stretch of road. "
        "Right: the simulated vehicles, followed to the end; the vertical scales differ. The scene is the "
        "held-out one of median mean speed unless eval.example names another."
    ),
    "actions_by_speed": (
        "Actions of the policy that drives all vehicles. Above: how often each speed was driven; below: the share of "
        "each action among those taken at that speed. Crashed vehicles take no action."
    ),
    "critical": (
        "How the shares of the driver classes were found before the evaluation, on other scenes and other initial "
        "states: every mixture that was simulated, and the errors of its traffic on the threshold scenes."
    ),
}
"""Text below each figure."""

SUMMARY_COLUMNS = (
    *("method", "metric", "value", "sd", "low", "high", "difference", "difference_low", "difference_high"),
    *("less_base", "less_base_low", "less_base_high", "confidence", "n_scenes", "n_rollouts"),
)
"""Columns of `summary.parquet` that the document needs."""

DECISION_COLUMNS = ("triggered", "asked", *ACTION_NAMES, "inadmissible", "invalid")
"""Columns of `decisions.parquet` that the document needs."""

_BETTER = {"lower": "lower", "higher": "higher", "none": "neither; compare with `real`"}

_READING = (
    "H Hellinger distance of speeds; MAPE relative error of the mean spacing, definitions A, B, C; smaller is closer, "
    "but no method can be expected below real against real",
    "THW time headway, LCR lane changes per vehicle and second: they describe traffic, so more is not better; "
    "compare with the row real",
)

Figures: TypeAlias = Mapping[tuple[str, str], Mapping[str, Any]]
"""Rows of `summary.parquet` by method and metric."""


def document_of(
    config: EvaluateTask,
    summary: pd.DataFrame,
    remarks: Remarks,
    *,
    decisions: pd.DataFrame | None = None,
    generated: bool,
) -> Document:
    """The document of an evaluation: summary.parquet, remarks, and decisions.parquet (None without interventions)."""
    rows = list(dict.fromkeys(summary["method"]))
    figures = {(row["method"], row["metric"]): row for row in summary.astype(object).to_dict("records")}
    main = main_row(rows)
    traffic = ", ".join(dict.fromkeys(source.name for source in remarks.sources)) or "recorded traffic"
    counts = next(row for (method, _), row in figures.items() if method == main)
    methods = Table(
        f"{title_of(main)} on {traffic}",
        tuple(HEADINGS.values()),
        tuple(
            Row(
                title_of(row),
                tuple(_estimate(figures.get((row, name)), name) for name in HEADINGS),
                _emphasis(row, main),
            )
            for row in rows
        ),
    )
    return Document(
        title=f"{title_of(main)} against {traffic}",
        verdict=_verdict(figures, main),
        sections=(
            Section("Methods", tables=(methods,), notes=_notes(config, figures, rows, counts, remarks)),
            Section("All metrics", tables=(_all_metrics(figures, rows, main),), is_folded=True),
            *([] if decisions is None else [_interventions(decisions, main)]),
            Section("Definitions", tables=(_metrics(),), notes=remarks.definitions, is_folded=True),
        ),
        command=f"evaluate method={config.method.name}",
        generated=generated,
        data=f"{counts['n_scenes']} held-out scenes, {counts['n_rollouts']} rollouts of {title_of(main)}; "
        f"{config.seeds}. {remarks.data}".rstrip(),
        sources=remarks.sources,
        captions=CAPTIONS,
    )


def main_row(rows: Iterable[str]) -> str:
    """The row that the document is about: with variants of a model the last method, else the first."""
    methods = [row for row in rows if row not in TITLES]
    return methods[-1] if any(row.endswith(WITH_EFFECT) for row in methods) else methods[0]


def _emphasis(row: str, main: str) -> Emphasis:
    if row in TITLES:
        return Emphasis.subdued
    return Emphasis.strong if row == main else Emphasis.plain


def _verdict(figures: Figures, main: str) -> str:
    """Sentence on the Hellinger distance of the method, its difference from base, and the reference rows."""
    if (main, "h") not in figures:
        return f"There is no Hellinger distance of {title_of(main)}."
    method, others, chance = (_cell(figures.get((row, "h")), "h") for row in (main, REAL_VS_REAL, NOISE_FLOOR))
    change = _cell(figures[main, "h"], "h", "less_base")
    return (
        f"The speeds of {title_of(main)} are a Hellinger distance of {method.inline} from the recorded ones"
        + ("" if change.value == NONE else f", a change of {change.inline} to base")
        + ("" if others.value == NONE else f"; recorded scenes are {others.value} from each other")
        + ("." if chance.value == NONE else f"; chance alone gives {chance.value}.")
    )


def _notes(
    config: EvaluateTask, figures: Figures, rows: Iterable[str], counts: Mapping[str, Any], remarks: Remarks
) -> tuple[str, ...]:
    n_runs = config.eval.n_runs
    spread = (
        f"± standard deviation over {n_runs} runs"
        if n_runs > 1
        else "one run, so no spread over runs and no energy score"
    )
    changes = {
        row: ", ".join(
            f"{HEADINGS[name]} {_cell(figures.get((row, name)), name, 'less_base').inline}"
            for name in ("h", config.mape.column)
        )
        for row in _compared_with_base(figures, rows)
    }
    return (
        f"means over scenes of means over runs; {spread}; intervals: "
        f"{bootstrap_over(int(counts['n_scenes']), 'held-out scenes', float(counts['confidence']))}",
        *(f"{title_of(row)} less base, from the same initial states: {change}" for row, change in changes.items()),
        *remarks.notes,
        *_READING,
    )


def _compared_with_base(figures: Figures, rows: Iterable[str]) -> list[str]:
    """Rows that are compared with base."""
    compared = {row for (row, _), estimate in figures.items() if not pd.isna(estimate["less_base"])}
    return [row for row in rows if row in compared]


def _all_metrics(figures: Figures, rows: Sequence[str], main: str) -> Table:
    """All metrics of all rows, their differences from base, and the difference of the main row from its reference."""
    compared = _compared_with_base(figures, rows)
    lines = []
    for name, metric in METRICS.items():
        cells = [_estimate(figures.get((row, name)), name) for row in rows]
        cells += [_cell(figures.get((row, name)), name, "less_base") for row in compared]
        cells.append(_cell(figures.get((main, name)), name, "difference"))
        lines.append(Row(f"{metric.title} [{metric.unit}]", tuple(cells)))
    changes = (f"{title_of(row)} less base" for row in compared)
    headings = (*map(title_of, rows), *changes, f"{title_of(main)} less reference")
    return Table("Metrics by method", headings, tuple(lines))


def _estimate(row: Mapping[str, Any] | None, name: str) -> Cell:
    """A figure with its spread over runs."""
    cell = _cell(row, name)
    if row is None or pd.isna(row["sd"]):
        return cell
    return replace(cell, value=f"{cell.value} ± {decimals(row['sd'], METRICS[name].digits)}")


def _cell(row: Mapping[str, Any] | None, name: str, column: str = "value") -> Cell:
    """A column of a row of the summary with its interval, with a sign if it is a difference."""
    if row is None or pd.isna(row[column]):
        return Cell(NONE)
    prefix, sign = ("", "") if column == "value" else (f"{column}_", "+")
    figures = (row[column], row[f"{prefix}low"], row[f"{prefix}high"])
    return cell_with_interval(*(decimals(figure, METRICS[name].digits, sign) for figure in figures))


def _interventions(decisions: pd.DataFrame, main: str) -> Section:
    """Section on detections and decisions."""
    rows = decisions["method"] if "method" in decisions else [main] * len(decisions)
    lines = []
    for row, part in decisions.groupby(rows, sort=False, observed=True):
        totals = {name: int(part[name].to_numpy(np.int64).sum()) for name in DECISION_COLUMNS}
        triggered, asked = totals.pop("triggered"), totals.pop("asked")
        cells = [Cell(percent(triggered / len(part))), Cell(number(asked))]
        cells += [Cell(number(n), f"{100 * n / asked:.0f} %" if asked else "") for n in totals.values()]
        lines.append(Row(title_of(str(row)), tuple(cells)))
    headings = ("triggered seconds", "decisions", *ACTION_NAMES, "not admissible", "invalid")
    explained = (
        "Share of the seconds of all rollouts in which the detection triggered; vehicles that were asked in them; the "
        "actions they followed, and how many answers could not be followed."
    )
    return Section(
        "Interventions", (explained,), (Table("Decisions of the policy", headings, tuple(lines)),), is_folded=True
    )


def _metrics() -> Table:
    """Table of all metrics with direction, definition and source."""
    rows = (
        Row(
            metric.title,
            tuple(map(Cell, (name, _BETTER[metric.direction.name], sentence(metric.definition), metric.source))),
        )
        for name, metric in METRICS.items()
    )
    return Table("Metrics", ("name in the files", "better", "definition", "source"), tuple(rows))
