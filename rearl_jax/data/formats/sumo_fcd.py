"""Rows of SUMO's floating car data, from XML, CSV or Parquet, as one table in SUMO's own columns.

Source: SUMO documentation, Simulation/Output/FCDOutput and TabularOutputs.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import BadRows
from rearl_jax.data.files.columnar import column_names, is_parquet, is_text, read_columns
from rearl_jax.data.files.delimited import first_rows, read_csv, read_header, text_endings
from rearl_jax.data.files.text_layout import first_names
from rearl_jax.data.formats.sumo_xml import XML, CutOff, elements, root_of
from rearl_jax.data.problems import DROP_HINT, bad_recording, require_columns

TABLES = (".parquet", *text_endings(".csv"))
"""Endings of SUMO's tabular output."""
ROOT = "fcd-export"
"""First element of an XML file of floating car data."""
NUMBERS = ("time", "x", "y", "angle", "speed", "pos")
TEXTS = ("id", "type", "lane")
OPTIONAL = {"acceleration": pa.float64(), "posLat": pa.float64(), "leaderID": pa.string()}

_KINDS = dict.fromkeys(NUMBERS, pa.float64()) | dict.fromkeys(TEXTS, pa.string()) | OPTIONAL
_OTHERS = frozenset({"person", "container"})  # elements that are not vehicles
_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d\d):(\d\d(?:\.\d*)?)")
_BATCH_SIZE = 2**15  # elements whose attributes are held as texts


@dataclass(frozen=True)
class Layout:
    """Layout of a file of floating car data: name in the file of every column, by its name in XML, and the number of
    broken lines that were left out, 1 for an XML file that ends within an element.
    """

    names: dict[str, str]
    n_broken: int
    is_xml: bool


def read_fcd(path: Path, on_bad: BadRows) -> tuple[pd.DataFrame, Layout]:
    """The rows of vehicles of a file, and its layout.

    Columns are NUMBERS, TEXTS (as categories), and those of OPTIONAL that the file has.

    Raises:
        BadRecordingError: A column is missing, a value is not a number, or the file is damaged. A file that only ends
            too early is read up to there unless on_bad is stop.
    """
    if path.name.lower().endswith(XML) or root_of(path) is not None:
        rows, n_broken = _of_xml(path, on_bad)
        return rows, Layout({name: name for name in _KINDS}, n_broken, is_xml=True)
    names = _spelling(path)
    rows, n_broken = _of_table(path, names, on_bad)
    return rows, Layout(names, n_broken, is_xml=False)


def is_fcd(path: Path) -> bool:
    """True if the file is floating car data, by its first element or the names of its columns."""
    root = root_of(path)
    if root is not None or path.name.lower().endswith(XML):
        return root == ROOT
    return {*NUMBERS, *TEXTS} <= _plain(column_names(path) if is_parquet(path) else first_names(path)).keys()


def _spelling(path: Path) -> dict[str, str]:
    """Name in a table of every column, by its name in XML."""
    found = column_names(path) if path.suffix.lower() == ".parquet" else read_header(path)
    plain = _plain(found)
    if 2 * len({*NUMBERS, *TEXTS} & set(plain)) < len((*NUMBERS, *TEXTS)):
        text = f"the file is not floating car data: its columns are {', '.join(found[:8])}"
        raise bad_recording("not-a-table", text, "move it out of the folder", path)
    require_columns(plain, (*NUMBERS, *TEXTS), path)
    return {name: plain[name] for name in _KINDS if name in plain}


def _plain(names: Sequence[str]) -> dict[str, str]:
    """Names in a table by those in XML."""
    return {name.removeprefix("vehicle_").removeprefix("timestep_"): name for name in names}


def _of_table(path: Path, names: dict[str, str], on_bad: BadRows) -> tuple[pd.DataFrame, int]:
    """Rows of vehicles in CSV or Parquet, whose names of columns are given, and the number of broken lines."""
    n_broken = 0
    kinds = {spelt: _KINDS[name] for name, spelt in names.items()}
    if has_clock := _has_clock(path, names["time"]):
        kinds[names["time"]] = pa.string()
    if path.suffix.lower() == ".parquet":
        numbers = [name for name, kind in kinds.items() if kind == pa.float64()]
        rows = read_columns(path, numbers, [name for name in kinds if name not in numbers])
    else:
        table, n_broken = read_csv(path, kinds, on_bad, quoted=False)
        # Texts as dictionaries, which take less memory.
        columns = {name: table[name] for name in names.values()}
        encoded = {n: c.dictionary_encode() if c.type == pa.string() else c for n, c in columns.items()}
        rows = pa.table(encoded).to_pandas(split_blocks=True, self_destruct=True)
    rows = rows.rename(columns={spelt: name for name, spelt in names.items()})
    if has_clock:
        rows["time"] = _seconds_of(pd.Series(rows["time"]), names["time"], path)
    # Time steps without vehicles, and persons, leave the columns of vehicles empty.
    is_vehicle = np.logical_or.reduce([rows[name].notna().to_numpy() for name in ("id", "x", "speed", "lane")])
    rows = rows if is_vehicle.all() else rows.iloc[np.flatnonzero(is_vehicle)]
    return rows.astype(dict.fromkeys(set(rows.columns) - set(NUMBERS) - {"acceleration"}, "category")), n_broken


def _has_clock(path: Path, column: str) -> bool:
    """True if the first time of a table has colons."""
    if path.suffix.lower() == ".parquet":
        return is_text(path, column)
    first, _ = first_rows(path, 1)
    return len(first) > 0 and ":" in first[column].iloc[0]


def _seconds_of(times: pd.Series, column: str, path: Path) -> np.ndarray:
    """The times [s]; BadRecordingError for one that is neither a number nor a time of day."""
    known = {text: _in_seconds(text) for text in times.dropna().unique()}
    for text, seconds in known.items():
        if not _is_number(seconds):
            row = int(np.argmax((times == text).to_numpy())) + 1
            remedy = "write the time in s, or as 00:00:01.00"
            raise bad_recording("value-unreadable", f"{text!r} is not a time", remedy, path, column=column, row=row)
    return times.map(known).to_numpy(np.float64, na_value=np.nan)


def _in_seconds(time: str) -> str:
    """The time of a step in seconds, which `--human-readable-time` writes as 1:02:03:04.50 (days) or 02:03:04.50."""
    found = _CLOCK.fullmatch(time)
    if found is None:
        return time
    days, hours, minutes = (int(part or 0) for part in found.groups()[:3])
    return repr(86400.0 * days + 3600.0 * hours + 60.0 * minutes + float(found[4]))


def _of_xml(path: Path, on_bad: BadRows) -> tuple[pd.DataFrame, int]:
    """Rows of vehicles in XML, and 1 if the file ends within an element, else 0."""
    batches: list[pa.RecordBatch] = []
    n_broken, n_rows = 0, 0
    try:
        for chunk in _chunks(path):
            batches.append(_batch(chunk, path, n_rows))
            n_rows += len(chunk)
    except CutOff as cut:
        n_broken = 1
        if on_bad is BadRows.stop:
            text, remedy = "the file ends within an element", f"let SUMO write it to its end{DROP_HINT}"
            raise bad_recording("line-broken", text, remedy, path, line=cut.line) from None
    if not batches:
        raise bad_recording("no-rows", "no vehicle is in the file", "let SUMO write it again", path)
    table = pa.Table.from_batches(batches).unify_dictionaries()
    batches.clear()
    table = table.drop_columns([name for name in OPTIONAL if table[name].null_count == n_rows])
    return table.to_pandas(split_blocks=True, self_destruct=True), n_broken


def _chunks(path: Path) -> Iterator[list[dict[str, str]]]:
    """Attributes of vehicles, with the time of their step; those before the end of a cut-off file are included."""
    time, chunk = "", []
    root = None
    try:
        for name, attributes in elements(path):
            if root is None:
                root = name
                if name != ROOT:
                    text = f"the file is not an output of floating car data: it holds {name}"
                    raise bad_recording("not-a-table", text, "name the file of --fcd-output", path)
            elif name == "vehicle":
                attributes["time"] = time
                chunk.append(attributes)
                if len(chunk) == _BATCH_SIZE:
                    yield chunk
                    chunk = []
            elif name == "timestep":
                time = _in_seconds(attributes.get("time", ""))
            elif name not in _OTHERS:
                text = f"{name} is not an element of floating car data"
                raise bad_recording("element-unknown", text, "the file is damaged: write or copy it again", path)
    except CutOff:
        if chunk:
            yield chunk
        raise
    if chunk:
        yield chunk


def _batch(chunk: Sequence[dict[str, str]], path: Path, n_before: int) -> pa.RecordBatch:
    """The attributes as columns, texts as dictionaries."""
    columns = {}
    for name, kind in _KINDS.items():
        values = pa.array([attributes.get(name) for attributes in chunk], pa.string())
        if n_before == 0 and name not in OPTIONAL and values.null_count == len(chunk):
            if name == "lane" and "edge" in chunk[0]:
                text = "vehicles have edges and no lanes, as in a mesoscopic simulation"
                raise bad_recording("format-unsupported", text, "simulate without --mesosim", path, column=name)
            require_columns(chunk[0], (name,), path)
        columns[name] = _numbers(values, name, path, n_before) if kind == pa.float64() else values.dictionary_encode()
    return pa.RecordBatch.from_pydict(columns)


def _numbers(values: pa.Array, name: str, path: Path, n_before: int) -> pa.Array:
    """The texts of an attribute as numbers; rows are counted from `n_before`, the rows of earlier batches."""
    try:
        return values.cast(pa.float64())
    except pa.ArrowInvalid:
        row = next(row for row, value in enumerate(values.to_pylist()) if not _is_number(value))
        text = f"{values[row].as_py()!r} is not a number"
        row += n_before + 1
        raise bad_recording("value-unreadable", text, "write a number there", path, column=name, row=row) from None


def _is_number(value: str | None) -> bool:
    try:
        pa.array([value], pa.string()).cast(pa.float64())
    except pa.ArrowInvalid:
        return False
    return True
