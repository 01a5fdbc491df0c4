"""A document in the terminal: its verdict, its tables, its notes; folded sections are left to the page."""

import io

import rich.table
from rich.markup import escape

from rearl_jax.console import Console, print_notes, standard_output, titled_table
from rearl_jax.document.document import Document
from rearl_jax.document.table import Alignment, Cell, Emphasis, Table

GENERATED = "GENERATED recordings, not measured: the figures say nothing about real traffic"

_MIN_WIDTH = 100
"""Least width of a file or a pipe [columns], for the sentences."""

_STYLES = {Emphasis.plain: None, Emphasis.strong: "bold", Emphasis.subdued: "dim italic"}


def print_document(document: Document) -> None:
    """Prints a document on standard output; a terminal too narrow for intervals shows spreads below the values."""
    _print(standard_output(_width(document)), document)


def text_of(document: Document) -> str:
    """Text of a document as a file or a pipe gets it, without colours."""
    console = Console(width=_width(document), file=io.StringIO())
    with console.capture() as captured:
        _print(console, document)
    return captured.get()


def _print(console: Console, document: Document) -> None:
    width = _width(document)
    has_room = console.width >= width
    print_notes(console, [document.verdict, *([GENERATED] if document.generated else ())])
    for section in document.sections:
        if section.is_folded:
            continue
        for table in section.tables:
            console.print(_rich_table(table, with_intervals=has_room, generated=document.generated))
        print_notes(console, (*section.paragraphs, *section.notes))
    if not has_room:
        print_notes(console, [f"intervals: page.html, or a terminal of {width} columns"])


def _width(document: Document) -> int:
    """Columns that the widest table needs with its intervals."""
    unlimited = Console(width=10_000, file=io.StringIO())
    tables = (table for section in document.sections if not section.is_folded for table in section.tables)
    drawn = (_rich_table(table, with_intervals=True, generated=document.generated) for table in tables)
    return max([_MIN_WIDTH, *(unlimited.measure(table).maximum for table in drawn)])


def _rich_table(table: Table, *, with_intervals: bool, generated: bool) -> rich.table.Table:
    drawn = titled_table(table.title, generated=generated)
    drawn.add_column("")
    for column, heading in enumerate(table.headings):
        justify = "right" if table.alignment(column) is Alignment.number else "left"
        drawn.add_column(escape(heading), justify=justify, no_wrap=True)
    for row in table.rows:
        texts = (_text(cell, with_intervals=with_intervals) for cell in row.cells)
        drawn.add_row(escape(row.title), *texts, style=_STYLES[row.emphasis])
    return drawn


def _text(cell: Cell, *, with_intervals: bool) -> str:
    value = escape(cell.value)
    if not with_intervals:
        return value.replace(" ± ", "\n±")
    return f"{value}\n[dim]{escape(cell.interval)}[/dim]" if cell.interval else value
