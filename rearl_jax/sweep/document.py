"""Document of a sweep of thresholds: every pair compared with base, and whether the scenes distinguish the best two."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import SweepThresholdsTask
from rearl_jax.document.document import DataSource, Document, Section
from rearl_jax.document.table import Emphasis, percent, table_of
from rearl_jax.sweep.pairs import pair_name

SUMMARY_KEYS = (
    *("n_pairs", "n_rollouts", "best_score", "base_score", "best_win_share"),
    *("lead", "lead_low", "lead_high", "is_distinguishable"),
)
"""Keys of summary.json that the document needs."""

_CAPTIONS = {
    "base_values": "Values of the method base on the threshold scenes, whose percentiles become thresholds.",
    "pairs": "Errors of every pair of thresholds on the tuning scenes; smaller is closer.",
}


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
        base: Means of base by metric; empty if they are not known.
        generated: Whether any of the recordings were generated.
        sources: Data sets with their licences.
    """
    mape = f"MAPE {config.mape.definition.name}"
    columns = {"pair": "pair", "threshold_h": "H >", "threshold_m": f"{mape} >", "h": "H", "mape": mape, "score": "sum"}
    columns |= {"thw": "THW [s]", "lcr": "LCR [1/s]", "collisions": "crashed", "win_share": "best in"}
    pairs = pairs.sort_values("score", kind="stable")
    names = list(map(pair_name, pairs["h_pct"], pairs["m_pct"]))
    shown = pairs.assign(pair=names, win_share=[percent(share) for share in pairs["win_share"]])
    base_row = pd.DataFrame([{**base, "pair": "base", "score": summary["base_score"]}])
    table = table_of(
        "Threshold pairs on the tuning scenes",
        pd.concat([shown, base_row]),
        columns,
        {names[0]: Emphasis.strong, "base": Emphasis.subdued},
    )
    can = "can" if summary["is_distinguishable"] else "cannot"
    is_compared = len(names) > 1
    is_closer = summary["best_score"] < summary["base_score"]
    notes = (
        "H > and MAPE >: thresholds, percentiles of Hellinger distance / spacing error of base; sum: sum of both "
        "errors, smaller is closer",
        "best in: share of the resamples of the scenes in which the pair has the least sum",
        *((f"lead of {names[0]} over {names[1]}: {_lead(summary, config.eval.confidence)}",) if is_compared else ()),
        *(() if is_closer else ("no pair is closer to the recorded scenes than base",)),
    )
    return Document(
        title="Thresholds of the detection",
        verdict=f"Of {summary['n_pairs']} pairs of thresholds the percentiles {names[0]} leave the least error, "
        f"{summary['best_score']:.3f} compared with {summary['base_score']:.3f} without interventions"
        + (f"; the scenes {can} distinguish it from the next." if is_compared else "."),
        sections=(Section("Pairs", tables=(table,), notes=notes),),
        command="sweep thresholds",
        generated=generated,
        data=f"{summary['n_rollouts']:,} rollouts; {config.seeds}.",
        sources=sources,
        captions=_CAPTIONS,
    )


def _lead(summary: Mapping[str, Any], confidence: float) -> str:
    """Lead of the best pair over the next [-], with its interval."""
    kind = "" if summary["lead_low"] is None else f"{100 * confidence:g} % bootstrap interval over scenes "
    return f"{summary['lead']:.4f}, {kind}{lead_interval(summary)}"


def lead_interval(summary: Mapping[str, Any]) -> str:
    """Interval of the lead [-] as text."""
    low, high = summary["lead_low"], summary["lead_high"]
    return "no interval from one scene" if low is None else f"{low:.4f} to {high:.4f}"
