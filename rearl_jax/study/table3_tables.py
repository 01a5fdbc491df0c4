"""The threshold pairs as people read them, as one long table, and as flat figures."""

import math
from typing import Any

import pandas as pd

from rearl_jax.config import StudyTable3Task
from rearl_jax.evaluation.terminal import short
from rearl_jax.results import PROVENANCE
from rearl_jax.study.pair_results import PairResults, PairRow
from rearl_jax.study.published import BEST_PAIR, PARETO_PAIRS, THRESHOLDS_H, THRESHOLDS_MAPE
from rearl_jax.study.report import NONE, Cell, Line, Shown, long_table

_ERRORS = {"h": "h", "mape": "mape_a"}
"""Errors that decide, each with the metric whose digits it has; they are the same for all definitions of the spacing
error.
"""

_TRAFFIC = ("thw", "lcr", "collisions")


def shown_pairs(config: StudyTable3Task, results: PairResults) -> Shown:
    """Every pair beside the paper's thresholds and marks."""
    mape = f"MAPE {config.mape.definition.name}"
    headings = ("H >", "paper", f"{mape} >", "paper", "H", mape, "sum", "best in", "Pareto", "paper's")
    title = (
        f"Table 3, ours beside what is known of the paper's; pairs are percentiles of H / MAPE, {results.n_scenes} "
        "tuning scenes"
    )
    front = {row.pair for row in results.front}
    lines = [_line(row, row.pair in front, row is results.best) for row in results.pairs]
    blank = (Cell(NONE),) * 4
    errors = tuple(_error_cell(results.base, name) for name in _ERRORS)
    end = (Cell(f"{results.base.score:.3f}"), Cell(NONE), Cell(NONE), Cell(NONE))
    base = Line("base", (*blank, *errors, *end, *_traffic(results.base)))
    return Shown(title, (*headings, "THW, s", "LCR", "crashed"), (*lines, base))


def _line(row: PairRow, is_front: bool, is_best: bool) -> Line:
    assert row.thresholds is not None
    assert row.h_pct is not None
    assert row.m_pct is not None
    assert row.win_share is not None
    thresholds = (
        Cell(f"{row.thresholds[0]:.4f}"),
        Cell(_published(THRESHOLDS_H.get(row.h_pct))),
        Cell(f"{row.thresholds[1]:.4f}"),
        Cell(_published(THRESHOLDS_MAPE.get(row.m_pct))),
    )
    errors = tuple(_error_cell(row, name) for name in _ERRORS)
    marks = ("best" if is_best else "yes" if is_front else "", _paper_mark(row))
    return Line(
        row.name,
        (
            *thresholds,
            *errors,
            Cell(f"{row.score:.3f}"),
            Cell(f"{100 * row.win_share:.0f} %"),
            *map(Cell, marks),
            *_traffic(row),
        ),
    )


def _published(value: float | None) -> str:
    return NONE if value is None else f"{value:.4f}"


def _paper_mark(row: PairRow) -> str:
    return "best" if row.pair == BEST_PAIR else "yes" if row.pair in PARETO_PAIRS else ""


def _error_cell(row: PairRow, name: str) -> Cell:
    low, high = row.ends[name]
    metric = _ERRORS[name]
    ends = "" if low is None or high is None else f"{short(low, metric)}–{short(high, metric)}"
    return Cell(short(row.means[name], metric), ends)


def _traffic(row: PairRow) -> tuple[Cell, ...]:
    values = {name: row.means[name] for name in _TRAFFIC}
    return tuple(Cell(NONE if math.isnan(value) else short(value, name)) for name, value in values.items())


def conclusions(results: PairResults) -> list[str]:
    """What the pairs say, computed from them."""
    summary, best = results.summary, results.best
    can = "can" if summary["is_distinguishable"] else "cannot"
    said = [
        f"Best pair: ours {best.name}, the paper's {BEST_PAIR[0]:g} % / {BEST_PAIR[1]:g} %.",
        f"These {results.n_scenes} scenes {can} tell ours from the next best: it leads by {summary['lead']:.4f} "
        f"({summary['lead_low']:.4f} to {summary['lead_high']:.4f}).",
    ]
    published = next((row for row in results.pairs if row.pair == BEST_PAIR), None)
    if published is not None and published is not best:
        place = 1 + sum(row.score < published.score for row in results.pairs)
        assert published.win_share is not None
        said.append(
            f"The paper's pair is number {place} of {len(results.pairs)} here and best in "
            f"{100 * published.win_share:.0f} % of the resamples."
        )
    ours, theirs = {row.pair for row in results.front}, set(PARETO_PAIRS)
    front = ", ".join(row.name for row in results.front)
    said.append(
        f"Pairs that no other beats in both errors: {front}; {len(ours & theirs)} of the paper's {len(theirs)} are "
        "among them."
    )
    if results.base.score <= best.score:
        said.append("No pair is closer to the recorded scenes than base.")
    return said


def long_pairs(results: PairResults) -> pd.DataFrame:
    """`row`, `h_pct`, `m_pct`, `metric`, `ours`, `low`, `high`, `paper`; one row per pair (or base) and figure.

    Metrics: the thresholds, the errors, `score`, `win_share`, `is_pareto` and `is_best` (1 or 0), traffic figures.
    """
    front = {row.pair for row in results.front}
    records: list[dict[str, Any]] = []
    for row in [*results.pairs, results.base]:
        keys = {"row": row.name, "h_pct": row.h_pct, "m_pct": row.m_pct}
        for name, value in row.means.items():
            low, high = row.ends[name]
            records.append(keys | {"metric": name, "ours": value, "low": low, "high": high, "paper": None})
        records.append(keys | {"metric": "score", "ours": row.score, "paper": None})
        if row.pair is None or row.thresholds is None:
            continue
        others: list[tuple[str, Any, Any]] = [
            ("threshold_h", row.thresholds[0], THRESHOLDS_H.get(row.pair[0])),
            ("threshold_m", row.thresholds[1], THRESHOLDS_MAPE.get(row.pair[1])),
            ("win_share", row.win_share, None),
            ("is_pareto", row.pair in front, _known(row) and row.pair in PARETO_PAIRS),
            ("is_best", row is results.best, _known(row) and row.pair == BEST_PAIR),
        ]
        records += [keys | {"metric": name, "ours": ours, "paper": paper} for name, ours, paper in others]
    table = long_table(records)
    return table.astype({"h_pct": "Float64", "m_pct": "Float64"})


def _known(row: PairRow) -> bool | None:
    """True where the paper has the pair, None where it says nothing about it."""
    return True if row.h_pct in THRESHOLDS_H and row.m_pct in THRESHOLDS_MAPE else None


def summary_of(config: StudyTable3Task, results: PairResults) -> dict:
    """Flat figures: those of the sweep, `mape`, `pareto` (pairs as text), for each percentile `threshold_h_pP` and
    `threshold_m_pP` with `_paper`; `best_h_pct_paper`, `best_m_pct_paper`, `n_pareto_shared`.
    """
    own = {name: value for name, value in results.summary.items() if name not in PROVENANCE}
    summary: dict[str, Any] = own | {
        "mape": config.mape.definition.name,
        "pareto": ", ".join(row.name for row in results.front),
        "n_pareto_shared": len({row.pair for row in results.front} & set(PARETO_PAIRS)),
        "best_h_pct_paper": BEST_PAIR[0],
        "best_m_pct_paper": BEST_PAIR[1],
    }
    for row in results.pairs:
        assert row.pair is not None
        assert row.thresholds is not None
        for name, percentile, threshold, published in (
            ("threshold_h", row.pair[0], row.thresholds[0], THRESHOLDS_H),
            ("threshold_m", row.pair[1], row.thresholds[1], THRESHOLDS_MAPE),
        ):
            summary[f"{name}_p{percentile:g}"] = threshold
            summary[f"{name}_p{percentile:g}_paper"] = published.get(percentile)
    return summary
