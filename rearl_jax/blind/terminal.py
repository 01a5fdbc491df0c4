"""The tables of a blind study on standard output."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.markup import escape

from rearl_jax.blind.judging import OUTCOMES
from rearl_jax.blind.results import BlindResults
from rearl_jax.blind.sealing import Protocol
from rearl_jax.console import Console, print_notes, standard_output, titled_table

_WIDTH = 120
"""Columns the tables need."""


def print_results(results: BlindResults, protocol: Protocol) -> None:
    """Prints rates, outcomes by set, what was said to what, and how the study was sealed."""
    console = standard_output(_WIDTH)
    table = titled_table("Blind study of discovery", generated=True)
    for heading in ("", "hits", "of", "rate", "95 % interval", "goal", ""):
        table.add_column(heading, justify="left" if heading == "" else "right")
    for score in results.scores:
        ends = f"{percent(score.low)} – {percent(score.high)}"
        figures = (str(score.n_hits), str(score.n_cases), percent(score.rate), ends, score.goal)
        table.add_row(escape(score.title), *figures, "reached" if score.is_met else "missed")
    console.print(table)
    print_sets(console, results.sets)
    table = titled_table("What was said, by what was hidden", generated=True)
    for heading in ("hidden", "said", "data sets"):
        table.add_column(heading, justify="right" if heading == "data sets" else "left")
    counts = results.confusion()
    for row in counts.to_dict("records"):
        hidden = row.pop("hidden")
        for said, n in row.items():
            if n:
                table.add_row(escape(str(hidden)), escape(str(said)), str(n), style=None if said == hidden else "dim")
    console.print(table)
    print_notes(console, notes(results, protocol))


def print_sets(console: Console, sets: Sequence[Mapping[str, Any]]) -> None:
    """Prints outcomes by set, and in how many data sets a name was said that is not there."""
    title = "Outcomes by set; not there: a name that is not there, alone or beside the right one"
    table = titled_table(title, generated=True)
    shown = [outcome for outcome in OUTCOMES if any(row[f"n_{outcome}"] for row in sets)]
    for heading in ("", "of", *shown, "not there", "95 % interval"):
        table.add_column(heading, justify="left" if heading == "" else "right")
    for row in sets:
        counts = [str(row[f"n_{outcome}"] or "") for outcome in shown]
        ends = f"{percent(row['low'])} – {percent(row['high'])}"
        table.add_row(escape(row["set"]), str(row["n"]), *counts, str(row["n_false"]), ends)
    console.print(table)


def notes(results: BlindResults, protocol: Protocol) -> list[str]:
    """What else is to be known, sentence by sentence."""
    summary = results.summary()
    said = [
        f"code {protocol.code_hash}, then master seed {protocol.master_seed} "
        f"({'drawn' if protocol.seed_drawn else 'given'}), then truth sealed as {(protocol.truth_sha256 or '')[:16]}"
    ]
    if results.n_drawn > len(results.cases):
        said.append(f"{len(results.cases)} of {results.n_drawn} data sets, the first in the study's random order")
    if summary["oracle_share"] is not None:
        said.append(
            f"squared error: {percent(summary['oracle_share'])} of the fall that the hidden effect itself brings, "
            f"{summary['n_oracles']} data sets"
        )
    n_intervals = sum(row["n_intervals"] for row in results.parameters)
    if n_intervals:
        n_covered = sum(round(row["coverage"] * row["n_intervals"]) for row in results.parameters if row["n_intervals"])
        said.append(f"intervals of parameters that hold the truth: {n_covered} of {n_intervals}")
    for row in results.calibration:
        n_true = round(row["true"] * row["n_claims"])
        stated = f"{percent(row['from'])} to {percent(row['to'])}, {percent(row['stated'])} in the mean"
        said.append(f"stated with a confidence of {stated}: {row['n_claims']} names, of which {n_true} are there")
    if summary["median_seconds"] is not None:
        said.append(f"median time of a verdict: {summary['median_seconds']:.1f} s")
    return said + results.remarks


def percent(share: float | None) -> str:
    """A share as people read it."""
    return "-" if share is None else f"{100 * share:.1f} %"
