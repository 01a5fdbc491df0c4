"""Names, units and classes of a foreign table, from `data.columns`, `data.units` and `data.classes`."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.problems import BadRecordingError
from rearl_jax.data.schema import COLUMNS
from rearl_jax.data.tables.usual_names import rank_of
from rearl_jax.data.units import UNITS, factor_of
from rearl_jax.data.vehicle_classes import CLASSES, NO_CLASS, class_of, code_of
from rearl_jax.problems import InvalidInputError, Problem

ENDS = {"front": -0.5, "rear": 0.5}
"""Columns with the position of a vehicle's front or rear, and the distance from there to the centre, in lengths."""
KINDS = (
    {column.name: column.unit for column in COLUMNS if column.unit in UNITS}
    | {"frame": "1/s"}
    | dict.fromkeys(ENDS, "m")
)
"""SI unit of the columns that may be in another unit; for frames, the unit of their rate."""
_LANES = re.compile(r"(-?)\s*from\s+(\d{1,3})")
OPTIONAL = ("lane", "lateral", "leader_id", "acceleration", "length", "width", "vehicle_class", "direction")
"""Columns that a table may lack without an error."""
_NAMES = tuple(column.name for column in COLUMNS)


@dataclass(frozen=True)
class Spelling:
    """Spelling of the canonical columns in a table.

    Attributes:
        columns: Name in the table of every canonical column that it holds, by canonical name.
        factors: Factor to SI of the columns whose unit is stated, by canonical name.
        leftmost: Number of the leftmost lane, if stated; the sign in `factors` gives the direction of counting.
        classes: Class of vehicles by its code or word in the table, where stated.
    """

    columns: Mapping[str, str]
    factors: Mapping[str, float]
    leftmost: int | None = None
    classes: Mapping[str, str] = field(default_factory=dict)

    @property
    def has_clock(self) -> bool:
        """True if the unit of the times is stated, or the rate of the frames."""
        return bool({"time", "frame"} & set(self.factors))

    @property
    def foreign(self) -> dict[str, str]:
        """The columns that have another name in the table."""
        return {name: source for name, source in self.columns.items() if source != name}

    def renamed(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Rows under canonical names and with stated classes, from rows under the names of the table. A column that has
        a canonical name but another meaning is left out.
        """
        taken = set(self.columns.values())
        others = [name for name in rows.columns if name in _NAMES and name not in taken]
        rows = rows.drop(columns=others).rename(columns={source: name for name, source in self.columns.items()})
        if self.classes and "vehicle_class" in rows:
            words = pd.Series(rows["vehicle_class"]).astype(object)
            known = {word: self.classes.get(code_of(word), word) for word in words.dropna().unique()}
            stated = words.map(known).where(words.notna(), self.classes.get(NO_CLASS))
            rows = rows.assign(vehicle_class=stated)
        return rows


def spelling_of(data: DataConfig, present: Sequence[str], file: str) -> Spelling:
    """Spelling of a table with these columns by `data.columns`, `data.units` and `data.classes`.

    A column that no key names has its canonical name.

    Raises:
        InvalidInputError: A key names no canonical column, two name the same column, or a unit or class is unknown.
        BadRecordingError: A key names a column that is not there.
    """
    _require_canonical(data.columns, "data.columns", (*_NAMES, *ENDS))
    _require_canonical(data.units, "data.units", (*KINDS, "lane"))
    given = {name: None if source is None else str(source).strip() for name, source in data.columns.items()}
    by_source: dict[str, str] = {}
    for name, source in given.items():
        if source is None:
            continue
        if source not in present:
            close = difflib.get_close_matches(source, present, 3, 0.3) or list(present[:8])
            message = f"names no column of the table; nearest: {', '.join(close)}"
            problem = Problem("column-missing", message, key=f"data.columns.{name}", column=source, file=file)
            raise BadRecordingError(problem)
        if source in by_source:
            message = f"names the column that data.columns.{by_source[source]} names: each can be one thing only"
            raise InvalidInputError(Problem("column-shared", message, key=f"data.columns.{name}", value=source))
        by_source[source] = name
    canonical = {name: name for name in _NAMES if name in present and name not in given and name not in by_source}
    columns = {name: source for name in (*_NAMES, *ENDS) if (source := (given | canonical).get(name)) is not None}
    positions = [name for name in ("position", *ENDS) if name in columns]
    if len(positions) > 1:
        message = f"names a position in addition to data.columns.{positions[0]}, of which one is enough"
        remedy = f"leave one out: 'data.columns={{{positions[0]}: null}}'"
        raise InvalidInputError(Problem("column-shared", message, remedy, key=f"data.columns.{positions[1]}"))
    factors, leftmost = {}, None
    for name, unit in data.units.items():
        lanes = _LANES.fullmatch(str(unit).strip()) if name == "lane" else None
        if lanes is not None:
            factor, leftmost = -1.0 if lanes[1] else 1.0, int(lanes[2])
        else:
            factor = None if name == "lane" else factor_of(str(unit), KINDS[name])
        if factor is None:
            known = ", ".join(UNITS[KINDS[name]]) if name in KINDS else ""
            message = f"must be one of {known}, with a number before it for a multiple"
            if name == "lane":
                message = "must say the number of the leftmost lane: from 1, or -from 4 if numbers fall to the right"
            raise InvalidInputError(Problem("unit-unknown", message, key=f"data.units.{name}", value=unit))
        if name not in columns:
            message = f"is the unit of a column that is not there: name it with data.columns.{name}"
            raise InvalidInputError(Problem("column-missing", message, key=f"data.units.{name}", file=file))
        factors[name] = factor
    if data.classes and "vehicle_class" not in columns:
        message = "are the classes of a column that is not there: name it with data.columns.vehicle_class"
        raise InvalidInputError(Problem("column-missing", message, key="data.classes", file=file))
    return Spelling(columns, factors, leftmost, _classes(data.classes))


def _classes(given: Mapping[Any, object]) -> dict[str, str]:
    """Classes by their code in a table, as `data.classes` states them."""
    classes = {code_of(code): str(class_of(str(word).strip())) for code, word in given.items()}
    for code, word in classes.items():
        if word not in CLASSES:
            message = f"must be one of {', '.join(CLASSES)}"
            raise InvalidInputError(Problem("class-unknown", message, key=f"data.classes.{code}", value=word))
    return classes


def on_unread(spelling: Spelling, data: DataConfig, others: Sequence[str]) -> tuple[str, ...]:
    """Note on the other columns, which are not read, that have a usual name of a column that is missing.

    A column that `data.columns` names, also as null, is not missing.
    """
    missing = [name for name in OPTIONAL if name not in spelling.columns and name not in data.columns]
    found = {name: next((other for other in others if rank_of(other, name) is not None), None) for name in missing}
    pairs = ", ".join(f"{name}: {other}" for name, other in found.items() if other is not None)
    return (f"columns that are not read, but may be meant: data.columns={{{pairs}}}",) if pairs else ()


def require_needed_columns(present: Sequence[str], file: str) -> None:
    """Raise BadRecordingError if the vehicle, its position or its speed is missing.

    Other columns may be missing, or follow from these and the times or frames.
    """
    for name in ("track_id", *(() if set(ENDS) & set(present) else ("position",)), "speed"):
        if name not in present:
            message = "the column is missing"
            remedy = (
                f"add it, or name what it is called: 'data.columns={{{name}: NAME}}'; found: {', '.join(present)}; "
                "`rearl prepare FILE` lists what the columns may be"
            )
            raise BadRecordingError(Problem("column-missing", message, remedy, column=name, file=file))


def _require_canonical(given: Mapping[str, object], key: str, known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            close = ", ".join(difflib.get_close_matches(str(name), known, 3, 0.3) or known)
            message = f"is none of the canonical columns that it may name; nearest: {close}"
            raise InvalidInputError(Problem("column-unknown", message, key=f"{key}.{name}"))
