"""The document of a blind study: rates beside their goals, outcomes by set, what was said by what was hidden."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from rearl_jax.blind.judging import OUTCOMES
from rearl_jax.blind.questions import QUESTIONS
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Cell, Emphasis, Row, Table, number, percent, table_of

TABLES = ("scores", "sets", "confusion", "parameters", "calibration", "cases")
"""Tables of a study that its document shows."""

CAPTIONS = {
    "confusion": "Data sets by what was hidden (rows) and what was said first (columns); rows add up to one in colour. "
    "What was recognised under another of its names stands on the diagonal.",
    "strengths": "Share of data sets with one hidden effect in which it is named. Blue: all effects; grey: each.",
}

_PARAMETERS = {
    "effect": "",
    "parameter": "parameter",
    "n": "data sets",
    "truth": "mean truth",
    "bias": "bias",
    "rms_error": "rms error",
    "n_intervals": "intervals",
    "coverage": "share that holds the truth",
}
_CASES = ("variant", "set", "verdict", "named", "outcome", "confidence", "before", "after", "floor", "seconds")


def document_of(
    summary: Mapping[str, Any], tables: Mapping[str, pd.DataFrame], protocol: Mapping[str, Any]
) -> Document:
    """The document of a blind study.

    Args:
        summary: Its figures, as in summary.json.
        tables: TABLES by name, as in its Parquet files.
        protocol: How it was sealed, as in protocol.json.
    """
    folded = (
        ("Parameters that mean the same on both sides", tables["parameters"], _PARAMETERS),
        ("Data sets", tables["cases"], _CASES),
    )
    return Document(
        title="Blind study of discovery",
        verdict=f"Discovery was right about {summary['n_right']} of {summary['n_cases']} data sets whose hidden "
        "effects it was not told.",
        sections=(
            Section("Rates", tables=(_rates(tables["scores"]),), notes=tuple(_notes(summary, tables, protocol))),
            Section(
                "Outcomes by set",
                (
                    "A name that is not there is counted whatever the outcome: it may stand beside what is right. A "
                    "curve over a variable counts as a name.",
                ),
                (_outcomes(tables["sets"]),),
            ),
            Section("What was said to what", tables=(_said(tables["confusion"]),)),
            *([Section("Stated confidence", tables=(_claims(rows),))] if len(rows := tables["calibration"]) else []),
            *(
                Section(title, tables=(table_of(title, frame, columns),), is_folded=True)
                for title, frame, columns in folded
                if len(frame)
            ),
            _sealing(protocol),
        ),
        command="discover blind",
        generated=True,
        data=f"{summary['n_cases']} generated data sets, master seed {protocol['master_seed']}.",
        captions=CAPTIONS,
    )


def _rates(scores: pd.DataFrame) -> Table:
    rows = (
        Row(
            row["title"],
            (
                Cell(f"{row['n_hits']} of {row['n_cases']}"),
                _share(row, "rate"),
                Cell(row["goal"]),
                Cell("reached" if row["is_met"] else "missed"),
            ),
        )
        for row in scores.to_dict("records")
    )
    return Table("Rates with exact 95 % intervals", ("hits", "rate", "goal", ""), tuple(rows))


def _share(row: Mapping[Any, Any], name: str) -> Cell:
    return Cell(percent(row[name]), f"{percent(row['low'])} to {percent(row['high'])}")


def _outcomes(sets: pd.DataFrame) -> Table:
    """Outcomes that occur, and data sets with a name that is not there."""
    outcomes = [outcome for outcome in OUTCOMES if sets[f"n_{outcome}"].any()]
    rows = (
        Row(
            row["set"],
            (
                Cell(str(row["n"])),
                *(Cell(str(row[f"n_{outcome}"] or "")) for outcome in outcomes),
                Cell(str(row["n_false"])),
                _share(row, "rate"),
            ),
        )
        for row in sets.to_dict("records")
    )
    headings = ("data sets", *outcomes, "with a name that is not there", "share of them")
    return Table("Outcomes by set", headings, tuple(rows))


def _said(confusion: pd.DataFrame) -> Table:
    rows = (
        Row(row["hidden"], (Cell(said), Cell(str(n))), Emphasis.plain if said == row["hidden"] else Emphasis.subdued)
        for row in confusion.to_dict("records")
        for said, n in row.items()
        if said != "hidden" and n
    )
    return Table("What was said, by what was hidden", ("said", "data sets"), tuple(rows))


def _claims(calibration: pd.DataFrame) -> Table:
    rows = (
        Row(
            f"{percent(row['from'])} to {percent(row['to'])}",
            (Cell(number(row["n_claims"])), Cell(percent(row["stated"])), _share(row, "true")),
        )
        for row in calibration.to_dict("records")
    )
    title = "Names by the confidence stated with them, and how many of them are there"
    return Table(title, ("names", "mean stated", "there"), tuple(rows))


def _notes(
    summary: Mapping[str, Any], tables: Mapping[str, pd.DataFrame], protocol: Mapping[str, Any]
) -> Iterator[str]:
    parameters = tables["parameters"]
    yield (
        f"Code {protocol['code_hash']}, then master seed {protocol['master_seed']} "
        f"({_origin(protocol)}), then truth sealed as {protocol['truth_sha256'][:16]}."
    )
    if summary["n_drawn"] > summary["n_cases"]:
        yield f"{summary['n_cases']} of {summary['n_drawn']} data sets, the first in the study's random order."
    if summary["oracle_share"] is not None:
        yield (
            f"Repaired models recover {percent(summary['oracle_share'])} of the reduction of the squared error that "
            f"the hidden effect itself brings, in {summary['n_oracles']} data sets."
        )
    if len(parameters) and (n_intervals := parameters["n_intervals"].sum()):
        known = parameters.dropna(subset="coverage")
        n_covered = (known["coverage"] * known["n_intervals"]).astype(float).round().sum()
        yield f"Intervals of parameters that hold the truth: {n_covered:.0f} of {n_intervals}."
    if summary["median_seconds"] is not None:
        yield f"Median time of a verdict: {summary['median_seconds']:.1f} s."
    if unasked := [question.title for question in QUESTIONS if question.needs not in ("", *tables["cases"])]:
        yield f"Counted when the study was run, as cases.parquet has no ends of intervals: {'; '.join(unasked)}."


def _sealing(protocol: Mapping[str, Any]) -> Section:
    words = (
        f"The hash of all sources was written down first, then the master seed was {_origin(protocol)}, then what is "
        "hidden was written to one file and the hash of that file into the protocol; only then did discovery see the "
        "first data set. It was given folders whose names and contents say nothing about what is hidden. The file was "
        "opened once, after the last verdict.",
        f"Code {protocol['code_hash']}, master seed {protocol['master_seed']}, truth {protocol['truth_sha256']}.",
    )
    return Section("How it was kept blind", words, is_folded=True)


def _origin(protocol: Mapping[str, Any]) -> str:
    return "drawn" if protocol["seed_drawn"] else "given"
