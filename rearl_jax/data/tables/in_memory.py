"""Recordings in a table in memory, converted and checked in the same way as those in files."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial

import numpy as np
import pandas as pd
from pandas.util import hash_pandas_object

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.checks.labels import with_labels
from rearl_jax.data.problems import recording_unnamed
from rearl_jax.data.reader import Entry
from rearl_jax.data.records import Recording
from rearl_jax.data.schema import COLUMNS, validate
from rearl_jax.data.tables.completion import completed
from rearl_jax.data.tables.row_info import info_of_rows
from rearl_jax.data.tables.spelling import Spelling, require_needed_columns, spelling_of

NAME = "table"
"""Id of the recording in a table without the column `recording`; in messages also the name of the source."""


@dataclass(unsafe_hash=True)
class TableInMemory(DataConfig):
    """A data set whose rows are a table in memory instead of files.

    Attributes:
        table: The rows; the column `recording`, if present, distinguishes recordings. `root` holds their hash,
            so that two equal tables are the same data set.
    """

    table: pd.DataFrame = field(default_factory=pd.DataFrame, compare=False, repr=False)


def in_memory(table: pd.DataFrame, data: DataConfig) -> TableInMemory:
    """The data set of a table, with the treatment of bad rows, jumps and lengths that `data` states.

    Raises:
        InvalidInputError: `data.columns`, `data.units` or `data.classes` cannot be used.
        BadRecordingError: A column is missing.
    """
    spelling = spelling_of(data, [str(name) for name in table.columns], NAME)
    require_needed_columns(list(spelling.columns), NAME)
    names = ",".join(map(str, table.columns)).encode()
    hashes: pd.Series = hash_pandas_object(table, index=False)  # type: ignore[operator]
    rows = hashes.to_numpy().tobytes()
    keys = {item.name: getattr(data, item.name) for item in fields(DataConfig)}
    digest = hashlib.sha256(names + rows).hexdigest()[:12]
    return TableInMemory(**keys | {"format": DataFormat.table, "root": f"table in memory {digest}"}, table=table)


def entries(data: TableInMemory) -> Iterator[Entry]:
    """The recordings of the table, in the order of their names.

    Raises:
        BadRecordingError: A row has no recording.
    """
    column = _spelling(data).columns.get("recording")
    if column is None:
        yield Entry(NAME, partial(_read, data, NAME), partial(_read, data, NAME))
        return
    names = pd.Series(data.table.rename(columns=str)[column])
    missing = np.flatnonzero(names.isna())
    if len(missing):
        raise recording_unnamed(NAME, row=int(missing[0]) + 1)
    for name in sorted(names.astype(str).unique()):
        yield Entry(name, partial(_read, data, name), partial(_read, data, name))


def _spelling(data: TableInMemory) -> Spelling:
    return spelling_of(data, [str(name) for name in data.table.columns], NAME)


def _read(data: TableInMemory, name: str, labels: Sequence[str] = ()) -> Recording:
    """One recording with columns of the table as labels, checked as those in files are."""
    spelling = _spelling(data)
    rows = spelling.renamed(data.table.reset_index(drop=True).rename(columns=str))
    if "recording" in rows:
        of_recording = np.flatnonzero(rows["recording"].astype(str).to_numpy() == name)
        rows = rows.iloc[of_recording].drop(columns="recording")
    canonical = [column.name for column in COLUMNS]
    further = [str(column) for column in rows.columns if column not in canonical]
    done = completed(rows, spelling, data, NAME)
    rows, info = info_of_rows(name, done.rows, NAME, "a table in memory", is_in_seconds=spelling.has_clock)
    info = replace(info, notes=(*info.notes, *done.notes), columns=spelling.foreign)
    info = with_labels(info, (*labels, *done.labels), [*further, *done.labels])
    return Recording(info, *validate(rows, info, data))
