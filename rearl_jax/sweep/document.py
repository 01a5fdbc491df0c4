"""What a sweep of thresholds says: every pair beside base, and whether the scenes can tell the best from the next."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import SweepThresholdsTask
from rearl_jax.document.document import DataSource, Document, Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, Table, percent

SUMMARY_KEYS = (
    *("n_pairs", "n_rollouts", "best_h_pct", "best_m_pct", "best_score", "base_score", "best_win_share"),
    *("lead", "lead_low", "lead_high", "is_distinguishable"),
)
"""Keys of summary.json that the document needs."""

_CAPTIONS = {
    "base_values": "Values of the method base on the threshold scenes, whose percentiles become thresholds.",
    "pairs": "Errors of every pair of thresholds on the tuning scenes; smaller is closer.",
}

_DIGITS = {"threshold_h": 4, "threshold_m": 4, "h": 4, "mape": 4, "score": 4, "thw": 2, "lcr": 4, "collisions": 3}


def document_of(
    config: SweepThresholdsTask,
    pairs: pd.DataFrame,
    summary: Mapping[str, Any],
    base: Mapping[str, float],
    *,
    generated: bool,
    sources: tuple[DataSource, ...] = (),
) -> Document:
    """The document of a sweep of thresholds.

    Args:
        config: The task.
        pairs: The table `table3.parquet`.
        summary: The figures of `summary.json`.
        base: Means of base by metric; empty where they are not known.
        generated: Whether any of the recordings were generated.
        sources: Data sets with their licences.
    """
    mape = f"MAPE {config.mape.definition.name}"
    headings = ("H >", f"{mape} >", "H", mape, "sum", "THW, s", "LCR", "crashed", "best in")
    ordered = pairs.sort_values("score", kind="stable").to_dict("records")
    rows = [
        _row(_name(pair), pair, Emphasis.plain if number else Emphasis.strong) for number, pair in enumerate(ordered)
    ]
    rows.append(_row("base", {**base, "score": summary["base_score"]}, Emphasis.subdued))
    best, runner_up = (_name(pair) for pair in (ordered[0], ordered[min(1, len(ordered) - 1)]))
    told = "can" if summary["is_distinguishable"] else "cannot"
    closer = summary["best_score"] < summary["base_score"]
    notes = (
        "H > and MAPE >: thresholds, percentiles of Hellinger distance / spacing error of base; sum: sum of both "
        "errors, smaller is closer",
        "best in: share of the resamples of the scenes in which the pair has the least sum",
        f"lead of {best} over {runner_up}: {summary['lead']:.4f}, {100 * config.eval.confidence:g} % bootstrap "
        f"interval over scenes {summary['lead_low']:.4f} to {summary['lead_high']:.4f}",
        *(() if closer else ("no pair is closer to the recorded scenes than base",)),
    )
    return Document(
        title="Thresholds of the detection",
        verdict=f"Of {summary['n_pairs']} pairs of thresholds the percentiles {best} leave the least error, "
        f"{summary['best_score']:.3f} beside {summary['base_score']:.3f} without interventions; the scenes {told} tell "
        "it from the next.",
        sections=(
            Section(
                "Pairs", tables=(Table("Threshold pairs on the tuning scenes", headings, tuple(rows)),), notes=notes
            ),
        ),
        command="sweep thresholds",
        generated=generated,
        data=f"{summary['n_rollouts']:,} rollouts; {config.seeds}.",
        sources=sources,
        captions=_CAPTIONS,
    )


def _name(pair: Mapping[Any, Any]) -> str:
    return f"{pair['h_pct']:g} % / {pair['m_pct']:g} %"


def _row(title: str, figures: Mapping[Any, Any], emphasis: Emphasis) -> Row:
    cells = [Cell(f"{figures[name]:.{digits}f}" if name in figures else NONE) for name, digits in _DIGITS.items()]
    return Row(title, (*cells, Cell(percent(figures.get("win_share")))), emphasis)
