"""Recordings in a table in memory, converted and checked in the same way as those in files."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial

import numpy as np
import pandas as pd
from pandas.util import hash_pandas_object

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.checks.labels import with_labels
from rearl_jax.data.checks.stray_rows import require_own_rows, without_blanks
from rearl_jax.data.problems import recording_unnamed
from rearl_jax.data.reader import Entry
from rearl_jax.data.records import Recording
from rearl_jax.data.schema import COLUMNS, validate
from rearl_jax.data.tables.completion import completed
from rearl_jax.data.tables.row_info import info_of_rows, with_lanes_left
from rearl_jax.data.tables.spelling import on_unread, require_needed_columns, spelling_of

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
    rows = _Rows(data)
    for name in rows.recordings():
        yield Entry(name, partial(rows.read, name), partial(rows.read, name))


class _Rows:
    """The rows of a table in memory, read as those of `canonical.TableFile` are."""

    def __init__(self, data: TableInMemory) -> None:
        self._data = data
        self._spelling = spelling_of(data, [str(name) for name in data.table.columns], NAME)
        self._has_own_rows = False  # once it is known that no recording holds rows of another one

    def recordings(self) -> list[str]:
        """Ids of the recordings in the table."""
        column = self._spelling.columns.get("recording")
        if column is None:
            return [NAME]
        unnamed = pd.isna(self._names)
        if unnamed.any():
            raise recording_unnamed(NAME, column, int(np.argmax(unnamed)) + 1)
        return sorted(set(self._names.tolist()))

    def read(self, name: str, labels: Sequence[str] = ()) -> Recording:
        """One recording with columns of the table as labels, checked as those in files are."""
        data, spelling = self._data, self._spelling
        rows = spelling.renamed(data.table.reset_index(drop=True).rename(columns=str))
        if "recording" in rows:
            rows = rows.assign(recording=self._names)
            if not self._has_own_rows:
                require_own_rows(rows, NAME, spelling.columns["recording"])
                self._has_own_rows = True
            rows = rows.iloc[np.flatnonzero(self._names == name)].drop(columns="recording")
        canonical = [column.name for column in COLUMNS]
        further = [str(column) for column in rows.columns if column not in canonical]
        rows, notes, added = completed(rows, spelling, data, NAME)
        rows, info = info_of_rows(name, rows, NAME, "a table in memory", is_in_seconds=spelling.has_clock)
        unread = on_unread(spelling, data, [name for name in further if name not in labels])
        info = replace(info, notes=(*info.notes, *notes, *unread), columns=spelling.foreign)
        info = with_labels(info, (*labels, *added), [*further, *added])
        return with_lanes_left(Recording(info, *validate(rows, info, data)))

    @cached_property
    def _names(self) -> np.ndarray:
        """Name of the recording of each row, spelt as from a file; None where a row has none."""
        column = pd.Series(self._data.table.rename(columns=str)[self._spelling.columns["recording"]])
        codes, values = pd.factorize(column)
        words = pd.Series([_word(value) for value in values], dtype=object)
        return np.array([*without_blanks(words), None], object)[codes]  # code -1, for no name, is the last


def _word(value: object) -> str:
    """A name as text; a whole number has no fraction, although a column with gaps holds it as one."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)
