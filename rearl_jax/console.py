"""Tables on standard output: a common style, and a default width for files and pipes."""

import os
from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.console import Console as AnyConsole
from rich.markup import escape
from rich.table import Table


def silence_standard_output() -> None:
    """Discards further output after the reader of standard output has closed it."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


class Console(AnyConsole):
    """Standard output of work that continues after its reader has closed it, as behind `| head`."""

    def on_broken_pipe(self) -> None:
        silence_standard_output()


def standard_output(width: int) -> Console:
    """Standard output; a file or a pipe has no width of its own and gets `width` [columns]."""
    console = Console()
    return console if console.is_terminal else Console(width=width)


def generated_mark(generated: bool) -> str:
    """Suffix of a title if the data are generated, else empty."""
    return " (GENERATED recordings)" if generated else ""


def titled_table(title: str, *, generated: bool = False) -> Table:
    """A table without columns yet; its title is plain text and marks generated data."""
    style = {"title_justify": "left", "title_style": "bold", "box": SIMPLE_HEAD, "padding": (0, 1, 0, 0)}
    return Table(title=escape(title + generated_mark(generated)), **style)


def print_notes(console: Console, notes: Iterable[str]) -> None:
    """Prints plain lines: numbers keep the colour of the text, brackets are no markup."""
    for note in notes:
        console.print(note, highlight=False, markup=False)
