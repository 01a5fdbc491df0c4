"""Tables of the benchmarks' results in the terminal."""

from collections.abc import Iterable, Mapping, Sequence

from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.timing.measurement import Spread

_WIDTH = 118
"""Columns a table may need; a file or a pipe gets them."""


def print_table(title: str, rows: Sequence[Mapping[str, object]], notes: Iterable[str] = ()) -> None:
    """Prints rows under their keys, and plain lines below."""
    console = standard_output(_WIDTH)
    table = titled_table(title)
    for name, value in (rows[0] if rows else {}).items():
        table.add_column(name, justify="left" if isinstance(value, str) else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(_cell, row.values()))
    if rows:
        console.print(table)
    print_notes(console, notes)


def _cell(value: object) -> str:
    """Text of a value: three digits of a number, all of a count, median and range of a spread; a dash for None."""
    if isinstance(value, Spread):
        return f"{_cell(value.median)} ({_cell(value.least)} to {_cell(value.greatest)})"
    if isinstance(value, float):
        return f"{value:#.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    return "-" if value is None else f"{value:,}" if isinstance(value, int) else str(value)
