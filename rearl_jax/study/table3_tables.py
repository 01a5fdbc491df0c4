"""The threshold pairs as one long table, as flat figures, and as people read them."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import StudyTable3Task
from rearl_jax.document.document import Section
from rearl_jax.metrics import METRICS
from rearl_jax.results import PROVENANCE
from rearl_jax.study.document import beside_paper, long_table
from rearl_jax.study.pair_results import PairResults, PairRow
from rearl_jax.study.published import BEST_PAIR, PARETO_PAIRS, THRESHOLDS_H, THRESHOLDS_MAPE

_DIGITS = {"threshold_h": 4, "threshold_m": 4, "mape": METRICS["mape_a"].digits, "score": 3}


def sections(config: StudyTable3Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    """Every pair beside the paper's thresholds and marks."""
    mape = f"MAPE {config.mape.definition.name}"
    headings = {
        "threshold_h": "H >",
        "threshold_m": f"{mape} >",
        "h": "H",
        "mape": mape,
        "score": "sum",
        "win_share": "best in",
        "is_pareto": "Pareto",
        "is_best": "best",
        "thw": "THW, s",
        "lcr": "LCR",
        "collisions": "crashed",
    }
    title = "Table 3, ours beside what is known of the paper's; pairs are percentiles of H / MAPE"
    every = headings | {f"mape_{name}": f"MAPE {name.upper()}" for name in "abc"}
    return (
        Section("Pairs of thresholds", tables=(beside_paper(title, table, headings, _DIGITS),)),
        Section("All errors", tables=(beside_paper("Every figure", table, every, _DIGITS),), is_folded=True),
    )


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
