"""Tables of a document, and numbers as text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import pandas as pd

NONE = "-"
"""Text of a missing number."""

MAX_ROWS = 60
"""Largest number of rows of a table made from a frame; the Parquet file contains all."""

_DIGITS = 3
"""Default number of significant digits."""

_MAX_LINE = 40
"""Longest text of a cell in a column without line breaks [characters]."""


class Emphasis(Enum):
    """Emphasis of a row: `strong` for a result, `subdued` for a reference."""

    plain = auto()
    strong = auto()
    subdued = auto()


class Alignment(Enum):
    """Alignment of a column: numbers to the right, words to the left, long text to the left on several lines."""

    number = auto()
    words = auto()
    text = auto()


@dataclass(frozen=True)
class Cell:
    """A value as text, and its confidence interval below it."""

    value: str
    interval: str = ""

    @property
    def inline(self) -> str:
        """The value in a sentence, with its interval in brackets."""
        return f"{self.value} ({self.interval})" if self.interval else self.value


@dataclass(frozen=True)
class Row:
    """A row of a table: its title and one cell per heading."""

    title: str
    cells: tuple[Cell, ...]
    emphasis: Emphasis = Emphasis.plain


@dataclass(frozen=True)
class Table:
    """A table of a document.

    Attributes:
        title: Title, plain text.
        headings: Headings of the columns after the titles of the rows, with units.
        rows: Rows of the table.

    Raises:
        ValueError: A row has more or fewer cells than there are headings.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[Row, ...]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.headings):
                raise ValueError(f"{self.title}: row {row.title} has {len(row.cells)} cells for {len(self.headings)}")

    def alignment(self, column: int) -> Alignment:
        """Alignment of a column, by the content of its cells."""
        values = [row.cells[column].value for row in self.rows]
        if any(len(value) > _MAX_LINE for value in values):
            return Alignment.text
        return Alignment.words if any(value[:1].isalpha() for value in values) else Alignment.number


def table_of(
    title: str,
    frame: pd.DataFrame,
    columns: Mapping[str, str] | Sequence[str],
    emphasis: Mapping[str, Emphasis] | None = None,
) -> Table:
    """Table of a frame: the first column contains the titles, `x_low` and `x_high` are the interval of `x`.

    Args:
        title: Title.
        frame: The frame.
        columns: Names of the displayed columns, or a mapping from names to headings; columns missing in the frame are
            ignored.
        emphasis: Emphasis of rows by title; the others are plain.
    """
    headings = dict(columns) if isinstance(columns, Mapping) else {name: spoken(name) for name in columns}
    first, *others = (name for name in headings if name in frame)
    records = frame.head(MAX_ROWS).astype(object).to_dict("records")
    row_titles = [number(record[first]) for record in records]
    rows = tuple(
        Row(row_title, tuple(_cell(record, name) for name in others), (emphasis or {}).get(row_title, Emphasis.plain))
        for row_title, record in zip(row_titles, records, strict=True)
    )
    if len(frame) > len(rows):
        title += f" (the first {MAX_ROWS} of {len(frame)} rows)"
    return Table(title, tuple(headings[name] for name in others), rows)


def cell_of(figure: Mapping[str, Any] | None, sign: str = "") -> Cell:
    """A figure {value, low, high} with its interval, `-` if it is missing; `sign` as in `number`."""
    if figure is None:
        return Cell(NONE)
    return Cell(number(figure["value"], sign), interval(figure["low"], figure["high"], sign))


def cell_with_interval(value: str, low: str, high: str) -> Cell:
    """A cell of texts; without an interval if a bound is missing."""
    return Cell(value, "" if NONE in (low, high) else f"{low} to {high}")


def _cell(record: Mapping[Any, Any], name: str) -> Cell:
    return Cell(number(record[name]), interval(record.get(f"{name}_low"), record.get(f"{name}_high")))


def number(value: Any, sign: str = "") -> str:
    """Text of a number, a text or a truth value, `-` if it is missing; the sign `+` is for changes."""
    if value is None or value is pd.NA or (isinstance(value, float) and pd.isna(value)):
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        is_small = value and round(abs(value)) < 10**_DIGITS
        return f"{value:{sign}#.{_DIGITS}g}".rstrip(".") if is_small else f"{value:{sign},.0f}"
    return f"{value:{sign},}" if isinstance(value, int) else str(value)


def decimals(value: Any, digits: int, sign: str = "") -> str:
    """Text of a number with a fixed number of digits after the point, `-` if it is missing; `sign` as in `number`."""
    return NONE if value is None or pd.isna(value) else f"{value:{sign}.{digits}f}"


def interval(low: Any, high: Any, sign: str = "") -> str:
    """Text of an interval, both bounds with the decimals of the larger one; empty if a bound is missing."""
    ends = (number(low, sign), number(high, sign))
    if NONE in ends:
        return ""
    if isinstance(low, float) and isinstance(high, float):
        decimals = len(number(max(abs(low), abs(high))).partition(".")[2])
        ends = tuple(f"{end:{sign}z,.{decimals}f}" for end in (low, high))
    return f"{ends[0]} to {ends[1]}"


def percent(share: float | None) -> str:
    """Text of a share [-] in percent, `-` if it is missing."""
    return NONE if share is None or pd.isna(share) else f"{100 * share:.1f} %"


def spoken(name: str) -> str:
    """Name of a column or key in words."""
    return name.replace("_", " ")


def sentence(text: str) -> str:
    """Text with a capital at its beginning and a full stop at its end."""
    return text[:1].upper() + text[1:].rstrip(".") + "."
