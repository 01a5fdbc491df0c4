"""Names of columns in published tables, whose spelling differs from copy to copy, and the units that they state."""

import re
from collections.abc import Collection, Sequence
from pathlib import Path

from rearl_jax.data.problems import bad_recording
from rearl_jax.data.units import UNITS, unit_named

_WITH_UNIT = re.compile(r"(.*?\w)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")


def split_unit(name: str) -> tuple[str, str]:
    """A name without what it has in brackets at its end, and this: `Speed1 (km/h)` is Speed1 in km/h."""
    found = _WITH_UNIT.fullmatch(name)
    return (found[1], found[2]) if found else (name, "")


def plain(name: str) -> str:
    """A column or place name without case, punctuation and unit in brackets."""
    return "".join(c for c in split_unit(name)[0].lower() if c.isalnum())


def by_plain_name(names: Sequence[str], wanted: Collection[str], file: Path) -> dict[str, str]:
    """Names of columns in a file by their plain names; BadRecordingError if two are spellings of one that is wanted."""
    found: dict[str, str] = {}
    for name in names:
        other = found.setdefault(plain(name), name)
        if other is not name and plain(name) in wanted:
            text, remedy = f"the column {other} is another spelling of it", "remove one of them"
            raise bad_recording("column-twice", text, remedy, file, column=name)
    return found


def unit_stated(column: str, kind: str, file: Path) -> str | None:
    """Unit that the name of a column states in brackets; None if it states none.

    Raises:
        BadRecordingError: It is no unit of this kind, which is given by its SI unit, a key of UNITS.
    """
    _, stated = split_unit(column)
    unit = unit_named(stated, kind) if stated else None
    if stated and unit is None:
        text, remedy = f"the unit {stated} of the column is not known", f"give one of {', '.join(UNITS[kind])}"
        raise bad_recording("unit-unknown", text, remedy, file, column=column)
    return unit
