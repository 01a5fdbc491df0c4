"""The page of a blind study."""

from collections.abc import Mapping
from typing import Any

from rearl_jax.blind.judging import OUTCOMES
from rearl_jax.blind.results import BlindResults
from rearl_jax.blind.scores import Score
from rearl_jax.blind.sealing import Protocol
from rearl_jax.blind.terminal import notes, percent
from rearl_jax.evaluation.layout import render_page

CAPTIONS = {
    "confusion": "Data sets by what was hidden (rows) and what was said first (columns); rows add up to one in colour. "
    "What was recognised under another of its names stands on the diagonal.",
    "strengths": "Share of data sets with one hidden effect in which it is named. Blue: all effects; grey: each.",
}


def write_page(
    config: Any,
    results: BlindResults,
    protocol: Protocol,
    figures: Mapping[str, bytes],
    made_by: Mapping[str, Any] | None = None,
) -> str:
    """HTML text.

    Args:
        config: The task's record.
        results: What is shown.
        protocol: How it was sealed.
        figures: PNG files by name.
        made_by: Provenance of a study that was run before; None for one that was run now.
    """
    return render_page(
        "page.html.j2",
        package="rearl_jax.blind",
        words="discover blind",
        config=config,
        figures=figures,
        captions=CAPTIONS,
        made_by=made_by,
        title="Blind study of discovery",
        generated=True,
        protocol=protocol,
        scores=[_score(score) for score in results.scores],
        outcomes=OUTCOMES,
        sets=[_set(row) for row in results.sets],
        notes=notes(results, protocol),
        parameters=[_parameter(row) for row in results.parameters],
        calibration=[_claims(row) for row in results.calibration],
        data={"summary": f"{len(results.cases)} generated data sets.", "sources": []},
    )


def _score(score: Score) -> dict[str, Any]:
    return {
        "title": score.title,
        "hits": score.n_hits,
        "cases": score.n_cases,
        "rate": percent(score.rate),
        "interval": f"{percent(score.low)} – {percent(score.high)}",
        "goal": score.goal,
        "reached": "reached" if score.is_met else "missed",
    }


def _set(row: Mapping[str, Any]) -> dict[str, Any]:
    counts = [row[f"n_{outcome}"] or "" for outcome in OUTCOMES]
    interval = f"{percent(row['low'])} – {percent(row['high'])}"
    return {"set": row["set"], "n": row["n"], "counts": counts, "false": row["n_false"], "interval": interval}


def _parameter(row: Mapping[str, Any]) -> dict[str, Any]:
    coverage = "-" if row["coverage"] is None else f"{percent(row['coverage'])} of {row['n_intervals']}"
    figures = {name: f"{row[name]:.3g}" for name in ("truth", "bias", "rms_error")}
    return {**row, **figures, "coverage": coverage}


def _claims(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        **row,
        "range": f"{percent(row['from'])} – {percent(row['to'])}",
        "stated": percent(row["stated"]),
        "true": percent(row["true"]),
        "interval": f"{percent(row['low'])} – {percent(row['high'])}",
    }
