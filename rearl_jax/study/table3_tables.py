"""The threshold pairs as one long table, as flat figures, and as tables of the document."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import StudyTable3Task
from rearl_jax.document.document import Section
from rearl_jax.evaluation.estimates import BASE
from rearl_jax.metrics import METRICS
from rearl_jax.results import without_provenance
from rearl_jax.study.document import beside_paper, long_table
from rearl_jax.study.pair_results import METRICS as PAIR_METRICS
from rearl_jax.study.published import BEST_PAIR, PARETO_PAIRS, THRESHOLDS_H, THRESHOLDS_MAPE
from rearl_jax.sweep.document import lead_interval
from rearl_jax.sweep.pairs import pair_name

_DIGITS = {"threshold_h": 4, "threshold_m": 4, "mape": METRICS["mape_a"].digits, "score": 3}


def sections(config: StudyTable3Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    """Section of every pair with the paper's thresholds and marks."""
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
        "thw": "THW [s]",
        "lcr": "LCR [1/s]",
        "collisions": "crashed",
    }
    title = "Table 3, ours and the known values of the paper; pairs are percentiles of H / MAPE"
    all_headings = headings | {f"mape_{name}": f"MAPE {name.upper()}" for name in "abc"}
    return (
        Section("Pairs of thresholds", tables=(beside_paper(title, table, headings, _DIGITS),)),
        Section("All errors", tables=(beside_paper("Every figure", table, all_headings, _DIGITS),), is_folded=True),
    )


def conclusions(pairs: pd.DataFrame, summary: Mapping[str, Any], n_scenes: int) -> list[str]:
    """Sentences about the pairs, computed from them; `summary` is that of the sweep."""
    best, base = pairs.loc[pairs["is_best"]].iloc[0], pairs.iloc[-1]
    can = "can" if summary["is_distinguishable"] else "cannot"
    sentences = [f"Best pair: ours {best['row']}, the paper's {pair_name(*BEST_PAIR)}."]
    if len(pairs) > 2:  # two pairs or more, and base
        sentences.append(
            f"These {n_scenes} scenes {can} tell ours from the next best: it leads by {summary['lead']:.4f} "
            f"({lead_interval(summary)})."
        )
    published = pairs.loc[(pairs["h_pct"] == BEST_PAIR[0]) & (pairs["m_pct"] == BEST_PAIR[1]) & ~pairs["is_best"]]
    for pair in published.to_dict("records"):
        rank = 1 + (pairs["score"][:-1] < pair["score"]).sum()
        sentences.append(
            f"The paper's pair is number {rank} of {len(pairs) - 1} here and best in {100 * pair['win_share']:.0f} % "
            "of the resamples."
        )
    shared = len(_front(pairs) & set(PARETO_PAIRS))
    front = ", ".join(pairs.loc[pairs["is_pareto"]].sort_values("h")["row"])
    sentences.append(
        f"Pairs that no other beats in both errors: {front}; {shared} of the paper's {len(PARETO_PAIRS)} are among "
        "them."
    )
    if base["score"] <= best["score"]:
        sentences.append("No pair is closer to the recorded scenes than base.")
    return sentences


def _front(pairs: pd.DataFrame) -> set[tuple[float, float]]:
    """Percentiles of the Pareto-optimal pairs."""
    front = pairs.loc[pairs["is_pareto"]]
    return set(zip(front["h_pct"], front["m_pct"], strict=True))


def long_pairs(pairs: pd.DataFrame) -> pd.DataFrame:
    """`row`, `h_pct`, `m_pct`, `metric`, `ours`, `low`, `high`, `paper`; one row per pair (or base) and figure.

    Metrics: the thresholds, the errors, `score`, `win_share`, `is_pareto` and `is_best` (1 or 0), traffic figures.
    """
    records: list[dict[str, Any]] = []
    for pair in pairs.to_dict("records"):
        keys = {name: pair[name] for name in ("row", "h_pct", "m_pct")}
        for name in PAIR_METRICS:
            ends = {"low": pair[f"{name}_low"], "high": pair[f"{name}_high"]}
            records.append(keys | {"metric": name, "ours": pair[name]} | ends | {"paper": None})
        records.append(keys | {"metric": "score", "ours": pair["score"], "paper": None})
        if pair["row"] == BASE:
            continue
        h_pct, m_pct = pair["h_pct"], pair["m_pct"]
        is_known = h_pct in THRESHOLDS_H and m_pct in THRESHOLDS_MAPE
        published = {
            "threshold_h": THRESHOLDS_H.get(h_pct),
            "threshold_m": THRESHOLDS_MAPE.get(m_pct),
            "win_share": None,
            "is_pareto": (h_pct, m_pct) in PARETO_PAIRS if is_known else None,
            "is_best": (h_pct, m_pct) == BEST_PAIR if is_known else None,
        }
        records += [keys | {"metric": name, "ours": pair[name], "paper": paper} for name, paper in published.items()]
    return long_table(records).astype({"h_pct": "Float64", "m_pct": "Float64"})


def summary_of(config: StudyTable3Task, pairs: pd.DataFrame, sweep: Mapping[str, Any]) -> dict:
    """Flat figures: those of the sweep, `mape`, `pareto` (pairs as text), for each percentile `threshold_h_pP` and
    `threshold_m_pP` with `_paper`; `best_h_pct_paper`, `best_m_pct_paper`, `n_pareto_shared`.
    """
    summary: dict[str, Any] = without_provenance(sweep) | {
        "mape": config.mape.definition.name,
        "pareto": ", ".join(pairs.loc[pairs["is_pareto"]].sort_values("h")["row"]),
        "n_pareto_shared": len(_front(pairs) & set(PARETO_PAIRS)),
        "best_h_pct_paper": BEST_PAIR[0],
        "best_m_pct_paper": BEST_PAIR[1],
    }
    for pair in pairs.iloc[:-1].to_dict("records"):
        for name, percentile, published in (("h", pair["h_pct"], THRESHOLDS_H), ("m", pair["m_pct"], THRESHOLDS_MAPE)):
            summary[f"threshold_{name}_p{percentile:g}"] = pair[f"threshold_{name}"]
            summary[f"threshold_{name}_p{percentile:g}_paper"] = published.get(percentile)
    return summary
