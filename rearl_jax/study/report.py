"""What every study ends with: tables, what follows, what differs from the paper, page, Parquet, summary."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape

from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.results import Study

NONE = "-"
"""Where there is no figure."""

_WIDTH = 146
"""Columns a table with intervals needs."""

_FIGURES = ("ours", "low", "high", "sd", "less_base", "less_base_low", "less_base_high", "paper")


@dataclass(frozen=True)
class Cell:
    """A figure as text, and its interval below it."""

    figure: str
    interval: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a table: ours, or the paper's, which is told apart."""

    title: str
    cells: tuple[Cell, ...]
    is_paper: bool = False


@dataclass(frozen=True)
class Shown:
    """A table people read."""

    title: str
    headings: tuple[str, ...]
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Report:
    """All a study says.

    Attributes:
        title: Above the page.
        tables: Ours beside the paper's.
        findings: What follows from the figures, sentence by sentence.
        differences: What differs between the two besides the method.
        data: `summary` and `sources` of the page.
        generated: Whether the recordings are no measurements.
        data_id: Identity of the scenes; None without data.
        captions: What is below each figure, by name.
    """

    title: str
    tables: tuple[Shown, ...]
    findings: tuple[str, ...]
    differences: tuple[str, ...]
    data: Mapping[str, Any]
    generated: bool
    data_id: str | None = None
    captions: Mapping[str, str] = field(default_factory=dict)


def long_table(records: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """One row per row of the study and metric: `row`, `metric`, `ours`, `low`, `high`, `paper`, and what else is known.

    Missing values are null, never NaN.
    """
    frame = pd.DataFrame(list(records))
    for name in _FIGURES:
        if name in frame:
            frame[name] = pd.array([None if pd.isna(value) else float(value) for value in frame[name]], "Float64")
    for name in frame.columns:
        if name.startswith("n_"):
            frame[name] = pd.array([None if pd.isna(value) else int(value) for value in frame[name]], "Int64")
    return frame


def finish(
    study: Study,
    words: str,
    config: Any,
    report: Report,
    table: pd.DataFrame,
    summary: Mapping[str, Any],
    draw: Callable[[], Mapping[str, bytes]],
    **metadata: str,
) -> None:
    """Prints the report and writes `NAME.parquet`, the figures, `page.html` and, last of all, `summary.json`.

    Args:
        study: The folder.
        words: The task, as in `study table1`.
        config: Its record.
        report: What is said.
        table: The long table; the file is called after the task.
        summary: Flat figures.
        draw: Makes the figures, PNG by name; called after the tables are printed.
        **metadata: What the table says besides its provenance.
    """
    study.write_table(words.rpartition(" ")[2], table, **metadata)
    print_report(report)

    # Only now, so that nobody waits for matplotlib and jinja2 to see the table.
    from rearl_jax.evaluation.layout import render_page

    figures = draw()
    for name, png in figures.items():
        study.write_bytes(f"{name}.png", png)
    page = render_page(
        "page.html.j2",
        package="rearl_jax.study",
        words=words,
        config=config,
        figures=figures,
        captions=report.captions,
        data_id=report.data_id,
        title=report.title,
        generated=report.generated,
        tables=report.tables,
        findings=report.findings,
        differences=report.differences,
        data=report.data,
    )
    study.write_text("page.html", page)
    study.write_summary(summary)


def print_report(report: Report) -> None:
    """Prints tables, findings and differences; in a narrow terminal without intervals."""
    console = standard_output(_WIDTH)
    has_room = console.width >= _WIDTH
    for shown in report.tables:
        _print_table(console, shown, has_room=has_room, generated=report.generated)
    if report.generated:
        print_notes(console, ["GENERATED recordings, no measurements: nothing here is about real traffic"])
    print_notes(console, report.findings)
    print_notes(console, ["", "What differs from the paper, so that only signs and orders can be compared:"])
    print_notes(console, [f"- {difference}" for difference in report.differences])
    if not has_room:
        print_notes(console, [f"intervals: page.html, or a terminal of {_WIDTH} columns"])


def _print_table(console: Console, shown: Shown, *, has_room: bool, generated: bool) -> None:
    table = titled_table(shown.title, generated=generated)
    table.add_column("")
    for heading in shown.headings:
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for line in shown.lines:
        cells = (_text(cell, has_room) for cell in line.cells)
        table.add_row(escape(line.title), *cells, style="dim italic" if line.is_paper else None)
    console.print(table)


def _text(cell: Cell, has_room: bool) -> str:
    figure = escape(cell.figure)
    return f"{figure}\n[dim]{escape(cell.interval)}[/dim]" if has_room and cell.interval else figure
