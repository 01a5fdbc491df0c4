"""The first rows of an unknown table, column by column."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.data.files.columnar import column_names, is_parquet, read_columns, readable_parquet, value_type
from rearl_jax.data.files.delimited import first_rows
from rearl_jax.data.files.fields import BLANKS, UNKNOWN
from rearl_jax.data.files.text_layout import layout_of
from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.tables.moments import is_moment, seconds_of

ROWS = 50_000
"""Number of rows that are read."""
_SAMPLE_VALUES = 50  # values from which it is decided whether a column of texts contains dates and times
_MIN_NUMBER_SHARE = 0.95  # share of the values that must be numbers
_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", BLANKS: "blanks"}


@dataclass(frozen=True)
class FoundColumn:
    """One column.

    Attributes:
        name: Its name in the file.
        kind: numbers, moments (dates and times of day), words or empty.
        values: Numbers, or seconds for moments; NaN where there is none.
        texts: The values as texts, None where there is none.
    """

    name: str
    kind: str
    values: np.ndarray
    texts: pd.Series

    @property
    def codes(self) -> np.ndarray:
        """A number for every different value, -1 where there is none."""
        return pd.factorize(self.texts)[0]

    @property
    def is_whole(self) -> bool:
        """True if all numbers are whole."""
        known = self.values[np.isfinite(self.values)]
        return self.kind == "numbers" and bool((known == np.rint(known)).all())


@dataclass(frozen=True)
class Sample:
    """The first rows of a table.

    Attributes:
        path: The file.
        layout: Description of its layout.
        columns: Its columns, without those whose name occurs twice.
        twice: Names that occur twice.
        n_rows: Number of rows that were read.
        n_broken: Number of lines among them whose number of fields differs from that of the header.
    """

    path: Path
    layout: str
    columns: tuple[FoundColumn, ...]
    twice: tuple[str, ...]
    n_rows: int
    n_broken: int


def sample_of(path: Path) -> Sample:
    """The first rows of a file.

    Raises:
        BadRecordingError: The file is neither text nor Parquet, or holds no rows.
    """
    if is_parquet(path):
        names, n_broken, layout = column_names(path), 0, "Parquet"
        tables = _first_of_parquet(path)
    else:
        table, n_broken = first_rows(path, ROWS)
        names, layout = [str(name) for name in table.columns], _layout_in_words(path)
        tables = [table.iloc[:, place] for place in range(len(names))]
    if not tables or not len(tables[0]):
        raise bad_recording("no-rows", "the table has no whole rows", "name a file with rows", path)
    twice = tuple(dict.fromkeys(name for name in names if names.count(name) > 1))
    columns = [_column(name, values) for name, values in zip(names, tables, strict=True) if name not in twice]
    return Sample(path, layout, tuple(columns), twice, len(tables[0]), n_broken)


def _layout_in_words(path: Path) -> str:
    """Layout of a text table in words."""
    layout = layout_of(path)
    parts = [f"text in {layout.encoding_name}{'' if layout.is_sure else ' (not certain)'}"]
    if layout.compression:
        parts.append(f"compressed ({layout.compression.lstrip('.')})")
    parts.append(f"fields separated by {_DELIMITERS.get(layout.delimiter, repr(layout.delimiter))}")
    parts.append(f"decimal {'comma' if layout.decimal_point == ',' else 'point'}")
    if layout.header_lines > 1:
        parts.append(f"rows from line {layout.header_lines + 1} on")
    return ", ".join(parts)


def _first_of_parquet(path: Path) -> list[pd.Series]:
    """The columns of the first rows."""
    read_columns(path, ())  # raises the error of a damaged file
    with readable_parquet(path), pq.ParquetFile(path) as file:
        batch = next(file.iter_batches(ROWS), None)
    return [] if batch is None else [_plain(column) for column in batch.columns]


def _plain(column: pa.Array) -> pd.Series:
    kind = value_type(column.type)
    try:
        column = column.cast(kind)
        whole = pa.types.is_integer(kind)
        return pd.Series(column.to_pylist(), dtype="Int64" if whole and kind.bit_width < 64 else None)
    except (pa.ArrowException, ValueError, OverflowError, TypeError):
        return pd.Series([None] * len(column), dtype=object)


def _column(name: str, values: pd.Series) -> FoundColumn:
    """The column, with the kind of its values."""
    known = values.notna().to_numpy()
    texts = pd.Series(np.full(len(values), None, dtype=object))
    texts[known] = pd.Series(values[known]).astype(str).str.strip().to_numpy()
    texts = pd.Series(texts.where(~texts.isin(UNKNOWN), None), dtype=object)
    n_known = int(texts.notna().sum())
    if not n_known:
        return FoundColumn(name, "empty", np.full(len(values), np.nan), texts)
    if pd.api.types.is_datetime64_any_dtype(values.dtype):
        seconds = (values.dt.tz_localize(None) - pd.Timestamp(0)) / pd.Timedelta(seconds=1)
        return FoundColumn(name, "moments", seconds.to_numpy(np.float64), texts)
    if pd.api.types.is_timedelta64_dtype(values.dtype):
        return FoundColumn(name, "moments", (values / pd.Timedelta(seconds=1)).to_numpy(np.float64), texts)
    numbers = numbers_of(texts)
    if np.isfinite(numbers).sum() >= _MIN_NUMBER_SHARE * n_known:
        return FoundColumn(name, "numbers", numbers, texts)
    if is_moment(texts.dropna().iloc[:_SAMPLE_VALUES]):
        try:
            return FoundColumn(name, "moments", seconds_of(texts, "", name)[0].to_numpy(np.float64), texts)
        except ValueError:
            pass
    return FoundColumn(name, "words", np.full(len(values), np.nan), texts)
