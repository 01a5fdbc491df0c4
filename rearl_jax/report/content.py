"""What a report says, whatever the study: sentences, tables, captions; and tables of any Parquet file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

NONE = "-"
"""Where there is no figure."""

MOST_LINES = 60
"""Lines of a table; the file beside the page has all."""

_DIGITS = 3
"""Significant digits of a figure nobody has chosen digits for."""


@dataclass(frozen=True)
class Cell:
    """A figure as text, and its interval below it."""

    figure: str
    interval: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a table."""

    title: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Shown:
    """A table people read."""

    title: str
    headings: tuple[str, ...]
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        title: Its heading.
        paragraphs: Sentences before the tables.
        tables: Tables.
        items: Bullet points after them.
        is_folded: Whether it is shown on demand only.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Shown, ...] = ()
    items: tuple[str, ...] = ()
    is_folded: bool = False


@dataclass(frozen=True)
class Content:
    """All a report says besides figures, replay and provenance.

    Attributes:
        title: Above the page.
        result: The result in one sentence.
        sections: Parts of the page.
        data: What the recordings are.
        notes: What must be known about them.
        captions: What is below each figure, by name.
        words: The task as the command that repeats it says it.
    """

    title: str
    result: str
    sections: tuple[Section, ...]
    data: str
    words: str
    notes: tuple[str, ...] = ()
    captions: Mapping[str, str] = field(default_factory=dict)


def sentence(text: str) -> str:
    """Text with a capital at its beginning and a full stop at its end."""
    return text[:1].upper() + text[1:].rstrip(".") + "."


def number(value: Any, sign: str = "") -> str:
    """A figure as text, `-` where there is none.

    Args:
        value: Number, text, truth value, or what stands for none of them.
        sign: `+` for changes.
    """
    if value is None or value is pd.NA or (isinstance(value, float) and pd.isna(value)):
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        small = f"{value:{sign}#.{_DIGITS}g}".rstrip(".")
        is_small = value and round(abs(value)) < 10**_DIGITS
        return small if is_small else f"{value:{sign},.0f}"
    return f"{value:{sign},}" if isinstance(value, int) else str(value)


def interval(low: Any, high: Any, sign: str = "") -> str:
    """Both ends as text, empty where there is none."""
    ends = (number(low, sign), number(high, sign))
    return "" if NONE in ends else f"{ends[0]} to {ends[1]}"


def spoken(name: str) -> str:
    """The name of a column or key as people read it."""
    return name.replace("_", " ")


def shown_frame(title: str, frame: pd.DataFrame, columns: Sequence[str], names: Sequence[str] = ()) -> Shown:
    """A table of a frame: the first column names the lines, `x_low` and `x_high` become the interval of `x`.

    Args:
        title: Above the table.
        frame: The frame.
        columns: Columns that are shown; those that the frame does not have are left out.
        names: What people read for each of them, by default the name of the column.
    """
    known = dict(zip(columns, names or map(spoken, columns), strict=True))
    first, *others = (name for name in columns if name in frame)
    rows = frame.head(MOST_LINES).astype(object).to_dict("records")
    lines = tuple(Line(number(row[first]), tuple(_cell(row, name) for name in others)) for row in rows)
    left = len(frame) - len(lines)
    title += f" (the first {MOST_LINES} of {len(frame)} lines)" if left else ""
    return Shown(title, tuple(known[name] for name in others), lines)


def _cell(row: Mapping[Any, Any], name: str) -> Cell:
    return Cell(number(row[name]), interval(row.get(f"{name}_low"), row.get(f"{name}_high")))
