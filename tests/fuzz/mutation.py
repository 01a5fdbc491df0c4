"""Ways in which files of recordings go wrong, drawn by chance: cells, columns, rows, bytes, text, units."""

import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from tests.fuzz.formats import Format
from tests.fuzz.traffic import Column, Source

FACTORS = (3.28084, 3.6, 25.0)
"""Feet in a metre, km/h in m/s, frames in a second."""

UNKNOWN = ("nan", "NaN", "-nan", "", "inf", "-inf", "NA", "null", "None", "#N/A")
"""Entries that writers put in place of an unknown number."""

ODD = (
    *UNKNOWN,
    *"0 -0.0 -1 1e308 -1e308 1e-320 9223372036854775807 9223372036854775808 -9223372036854775809 1e19".split(),
    *"2147483648 0x1F 1_000 1,5 1;2 1.2.3 --1 +5 true car Truck =1+1 <b> 2024-01-01 12:30".split(),
    *(" 7 ", "\t8", "\u0663", "\u00b5", "\x00", '"', '"a', "a\nb", "x" * 300, "9" * 400),
)
"""Cells nobody expects."""

_JSON = (None, True, -1, 0, 1.5, 1e308, 10**30, float("nan"), "", "x", "\x00", [], {}, [[]], {"1": {}}, "10.0", "3")


def spoiled(sound: Source, rng: Random, n_changes: int) -> dict[str, bytes]:
    """Files of a recording after some changes of any kind but units."""
    source = sound.copy()
    for _ in range(n_changes):
        rng.choice(_TABLE_CHANGES)(source, rng)
    files = source.files()
    if rng.random() < 0.35:
        name = rng.choice(sorted(files))
        files[name] = other_bytes(files[name], rng, rng.randint(1, 4))
    if rng.random() < 0.02:
        del files[rng.choice(sorted(files))]
    return files


def in_other_units(sound: Source, kind: Sequence[str], factor: float, rng: Random) -> dict[str, bytes]:
    """Files of a recording whose columns of one kind are in another unit, its rows perhaps in another order."""
    source = sound.copy()
    for columns in source.tables.values():
        for name in set(kind) & columns.keys():
            columns[name] = _scaled(columns[name], factor)
    if rng.random() < 0.5:
        # Whole tracks change places: what a reader may rely on is the order within a track.
        for name, columns in source.tables.items():
            if rng.random() < 0.3 and not name.endswith("Meta.csv"):
                columns |= {key: _taken(column, _by_vehicle(columns, rng)) for key, column in columns.items()}
    return source.files()


def without_a_value(sound: Source, kind: Sequence[str], rng: Random) -> dict[str, bytes]:
    """Files of a recording in which a number is missing or infinite, in one row or in many."""
    source = sound.copy()
    tables = [columns for columns in source.tables.values() if set(kind) & columns.keys()]
    columns = rng.choice(tables)
    name = rng.choice(sorted(set(kind) & columns.keys()))
    for _ in range(rng.choice((1, 1, 1, 5, 40))):
        columns[name] = _with_cell(columns[name], rng.randrange(len(columns[name])), rng.choice(UNKNOWN[:6]))
    return source.files()


def _by_vehicle(columns: dict[str, Column], rng: Random) -> list[int]:
    n_rows = min(map(len, columns.values()))
    n_tracks = rng.randint(2, 8)
    parts = [list(range(n_rows))[at * n_rows // n_tracks : (at + 1) * n_rows // n_tracks] for at in range(n_tracks)]
    return [row for part in parts for row in part]


def _taken(column: Column, rows: Sequence[int]) -> Column:
    return [column[row] for row in rows] if isinstance(column, list) else column.take(pa.array(rows, pa.int64()))


def _scaled(column: Column, factor: float) -> Column:
    if isinstance(column, pa.Array):
        return pc.multiply(column.cast(pa.float64()), factor)
    return [";".join(_times(part, factor) for part in cell.split(";")) for cell in column]


def _times(cell: str, factor: float) -> str:
    return repr(float(cell) * factor) if cell else ""


def _with_cell(column: Column, row: int, cell: str) -> Column:
    if isinstance(column, list):
        return [*column[:row], cell, *column[row + 1 :]]
    values = column.to_pylist()
    if not pa.types.is_floating(column.type) and not pa.types.is_integer(column.type):
        values = [None if value is None else str(value) for value in values]
        values[row] = cell.replace("\x00", "\ufffd")
        return pa.array(values, pa.string())
    try:
        values[row] = None if cell in ("", "NA", "null", "None", "#N/A") else float(cell)
    except ValueError:
        values = [None if value is None else str(value) for value in values]
        values[row] = cell.replace("\x00", "\ufffd")
    if any(isinstance(value, str) for value in values):
        return pa.array(values, pa.string())
    return pa.array([None if value is None else float(value) for value in values], pa.float64())


def _table(source: Source, rng: Random) -> dict[str, Column]:
    return source.tables[rng.choice(sorted(source.tables))]


def _any_column(source: Source, rng: Random) -> tuple[dict[str, Column], str]:
    columns = _table(source, rng)
    return columns, rng.choice(sorted(columns)) if columns else ""


def _cell(source: Source, rng: Random) -> None:
    columns, name = _any_column(source, rng)
    if name and len(columns[name]):
        columns[name] = _with_cell(columns[name], rng.randrange(len(columns[name])), rng.choice(ODD))


def _whole_column(source: Source, rng: Random) -> None:
    columns, name = _any_column(source, rng)
    if name:
        cell = rng.choice(ODD)
        column = columns[name]
        if len(column):
            columns[name] = _taken(_with_cell(column[:1], 0, cell), [0] * len(column))


def _noise(source: Source, rng: Random) -> None:
    columns, name = _any_column(source, rng)
    factor = rng.choice((-1.0, 0.0, 0.1, 2.0, 1e6, 1e-6, *FACTORS))
    try:
        columns[name] = _scaled(columns[name], factor)
    except (ValueError, KeyError, pa.ArrowInvalid, pa.ArrowNotImplementedError):
        return  # no numbers


def _drop_column(source: Source, rng: Random) -> None:
    columns, name = _any_column(source, rng)
    columns.pop(name, None)


def _rename_column(source: Source, rng: Random) -> None:
    columns, name = _any_column(source, rng)
    if name:
        new = rng.choice((name.upper(), f" {name}", f'"{name}"', f"{name}_", "", "x", "\u00b5", f"{name},b"))
        columns[new] = columns.pop(name)


def _swap_columns(source: Source, rng: Random) -> None:
    columns = _table(source, rng)
    if len(columns) > 1:
        one, two = rng.sample(sorted(columns), 2)
        columns[one], columns[two] = columns[two], columns[one]


def _rows(source: Source, rng: Random) -> None:
    columns = _table(source, rng)
    n_rows = min(map(len, columns.values()), default=0)
    if not n_rows:
        return
    rows = list(range(n_rows))
    start, stop = sorted((rng.randrange(n_rows), rng.randrange(n_rows)))
    how = rng.randrange(6)
    if how == 0:
        del rows[start : stop + 1]
    elif how == 1:
        rows[start:start] = rows[start : stop + 1]
    elif how == 2:
        rng.shuffle(rows)
    elif how == 3:
        rows.reverse()
    elif how == 4:
        rows = rows[:start]
    else:
        rows[start], rows[stop] = rows[stop], rows[start]
    for name in columns:
        columns[name] = _taken(columns[name], rows)


def _other_type(source: Source, rng: Random) -> None:
    """A Parquet column of another type; in text, quotes."""
    columns, name = _any_column(source, rng)
    if not name:
        return
    column = columns[name]
    if isinstance(column, list):
        columns[name] = [f'"{cell}"' for cell in column]
        return
    kinds = (pa.string(), pa.float32(), pa.float16(), pa.int8(), pa.bool_(), pa.timestamp("ms"), pa.decimal128(20, 3))
    try:
        kind = rng.choice(kinds)
        columns[name] = column.cast(kind, safe=False)
        if rng.random() < 0.3:
            columns[name] = columns[name].dictionary_encode()
        if rng.random() < 0.1:
            columns[name] = pa.array([[value] for value in columns[name].to_pylist()])
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, pa.ArrowTypeError):
        return


def _described(source: Source, rng: Random) -> None:
    """Statements on the recording: any JSON in any place of them."""
    for texts in (source.texts, *source.metadata.values()):
        for name, text in texts.items():
            try:
                value = json.loads(text)
            except ValueError:
                continue
            texts[name] = json.dumps(other_json(value, rng))


def other_json(value: Any, rng: Random) -> Any:
    """The value with another one somewhere in it."""
    if rng.random() < 0.15:
        return rng.choice(_JSON)
    if isinstance(value, dict) and value:
        name = rng.choice(sorted(value))
        how = rng.random()
        if how < 0.15:
            return {key: part for key, part in value.items() if key != name}
        if how < 0.25:
            return value | {rng.choice(("", "x", "-1", "1e3", "99999999999")): value[name]}
        return value | {name: other_json(value[name], rng)}
    if isinstance(value, list) and value:
        at = rng.randrange(len(value))
        return [*value[:at], other_json(value[at], rng), *value[at + 1 :]]
    return rng.choice(_JSON)


_TABLE_CHANGES: tuple[Callable[[Source, Random], None], ...] = (
    *(_cell,) * 5,
    *(_rows,) * 3,
    _whole_column,
    _noise,
    _drop_column,
    _rename_column,
    _swap_columns,
    _other_type,
    _described,
)


def _flip(content: bytes, rng: Random) -> bytes:
    if not content:
        return content
    at = rng.randrange(len(content))
    return content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]


def _cut(content: bytes, rng: Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _excise(content: bytes, rng: Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + content[start + rng.randint(1, 50) :]


def _insert(content: bytes, rng: Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    new = rng.choice((b"\x00", b"\xff\xfe", b'"', b"\r", b"\n\n", b",,,", b"\xef\xbb\xbf", b"\x1a", b"\xc3", b"9" * 30))
    return content[:at] + new + content[at:]


def _repeat(content: bytes, rng: Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + content[start : start + 200] + content[start:]


def _garbage(content: bytes, rng: Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.randbytes(rng.randint(1, 30)) + content[at + 30 :]


def _line_ends(content: bytes, rng: Random) -> bytes:
    return content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b" \n")))


def _encoding(content: bytes, rng: Random) -> bytes:
    try:
        return content.decode().encode(rng.choice(("utf-16", "utf-8-sig", "utf-32")))
    except UnicodeDecodeError:
        return content


_BYTE_CHANGES = (_flip, _flip, _flip, _cut, _excise, _insert, _insert, _repeat, _garbage, _line_ends, _encoding)


def other_bytes(content: bytes, rng: Random, n_faults: int = 1) -> bytes:
    """The content with faults somewhere in it."""
    for _ in range(n_faults):
        content = rng.choice(_BYTE_CHANGES)(content, rng)
    return content


def unit_faults(reader: Format) -> list[tuple[str, tuple[str, ...], float]]:
    """Every kind of quantity in every wrong unit: name, columns, factor."""
    return [(kind, names, sign) for kind, names in reader.kinds.items() for f in FACTORS for sign in (f, 1.0 / f)]
