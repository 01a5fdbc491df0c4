"""Columns of Parquet files as data frames; every fault of a file becomes an error that names the file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from rearl_jax.data.files.fields import UNKNOWN
from rearl_jax.data.problems import bad_recording, file_missing, require_columns


def column_names(path: Path) -> list[str]:
    """Names of the columns.

    Raises:
        BadRecordingError: The file is not Parquet.
    """
    with readable_parquet(path):
        return list(pq.read_schema(path).names)


def is_parquet(path: Path) -> bool:
    """True if a file is Parquet, by its ending or its first bytes."""
    if path.suffix.lower() == ".parquet" or not path.is_file():
        return path.suffix.lower() == ".parquet"
    with path.open("rb") as file:
        return file.read(4) == b"PAR1"


def is_text(path: Path, column: str) -> bool:
    """True if a column holds texts.

    Raises:
        BadRecordingError: The file is not Parquet.
    """
    with readable_parquet(path):
        return is_string(value_type(pq.read_schema(path).field(column).type))


def value_type(kind: pa.DataType) -> pa.DataType:
    """The type of the values of a column; of a dictionary, that of its entries."""
    return kind.value_type if pa.types.is_dictionary(kind) else kind


def is_string(kind: pa.DataType) -> bool:
    """True for texts."""
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def stored_text(path: Path, key: str) -> str | None:
    """A text of the schema's metadata; None if there is none.

    Raises:
        BadRecordingError: The file is not Parquet.
    """
    with readable_parquet(path):
        stored = (pq.read_schema(path).metadata or {}).get(key.encode())
        return None if stored is None else stored.decode()


def read_columns(
    path: Path,
    numbers: Sequence[str],
    texts: Sequence[str] = (),
    *,
    either: Sequence[str] = (),
    only: tuple[str, str | int] | None = None,
) -> pd.DataFrame:
    """The named columns.

    Args:
        path: The file.
        numbers: Columns of numbers, which may be written as text; marks of unknown values are those of text tables.
        texts: Columns of text, in which a missing value is None.
        either: Columns of any type; values that are not numbers become text.
        only: Column, and the value it has in the wanted rows.

    Raises:
        BadRecordingError: The file is damaged, or a column is missing, occurs twice, or has another type.
    """
    names = (*numbers, *texts, *either)
    found = column_names(path)
    require_columns(found, names, path)
    for name in names:
        if found.count(name) > 1:
            raise bad_recording("column-twice", "the column occurs twice", "remove one of them", path, column=name)
    with readable_parquet(path):
        table = _table(path, names, only)
        columns = {name: _cast(table[name], name, path, is_text=name in texts) for name in (*numbers, *texts)}
        columns |= {name: _as_it_is(table[name], name, path) for name in either}
        return pa.table(columns).to_pandas()


def _table(path: Path, names: Sequence[str], only: tuple[str, str | int] | None) -> pa.Table:
    """The named columns, unchanged.

    The rows are selected here, batch by batch, because pyarrow's own filters read the statistics of the columns and
    never return if these are damaged.
    """
    columns = list(dict.fromkeys([*names, *([] if only is None else only[:1])]))
    kept, n_read = [], 0
    with pq.ParquetFile(path) as file:
        schema = pa.schema([file.schema_arrow.field(name) for name in columns])
        for batch in file.iter_batches(columns=columns):
            batch.validate(full=True)  # finds damaged text here, which pandas would find only where it is used
            n_read += batch.num_rows
            kept.append(batch if only is None else batch.filter(_has(batch, *only)))
        if n_read != file.metadata.num_rows:
            raise pa.ArrowInvalid(f"{n_read} of its {file.metadata.num_rows} rows")
    return pa.Table.from_batches(kept, schema)


def _has(batch: pa.RecordBatch, name: str, value: str | int) -> pa.Array:
    """Mask of the rows with a value in a column; a text also matches with blanks around it, or as a number."""
    values = batch.column(name)
    kind = value_type(values.type)
    if isinstance(value, str) and _is_scalar(kind):
        values = _as_text(pa.chunked_array([values.cast(kind)])).combine_chunks()
    elif isinstance(value, str):
        values = pc.call_function("utf8_trim_whitespace", [values.cast(kind)])
    return pc.call_function("equal", [values, pa.scalar(value)])


def _cast(column: pa.ChunkedArray, name: str, path: Path, *, is_text: bool) -> pa.ChunkedArray:
    """The column as text, whole numbers or float64."""
    kind = value_type(column.type)
    if pa.types.is_null(kind) or (is_string(kind) and is_text):
        return column.cast(pa.string() if is_text else pa.float64())
    if is_text and _is_scalar(kind):
        return _as_text(column.cast(kind))
    if not is_text and (pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind)):
        return _seconds(column.cast(kind))
    if not is_text and pa.types.is_integer(kind):
        return column.cast(kind)
    if not is_text and (is_string(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        column = column.cast(kind)
        if is_string(kind):
            unknown = pc.call_function("is_in", [column], pc.SetLookupOptions(pa.array(UNKNOWN, kind)))
            column = pc.call_function("if_else", [unknown, pa.scalar(None, kind), column])
        try:
            return column.cast(pa.float64())
        except pa.ArrowInvalid as error:
            text = str(error).partition("\n")[0]
            raise bad_recording("wrong-type", text, "write numbers there", path, column=name) from None
    wanted = "text" if is_text else "numbers"
    raise bad_recording("wrong-type", f"the column holds {kind}", f"write {wanted} there", path, column=name)


def _is_scalar(kind: pa.DataType) -> bool:
    """True if values of the type are written as one word: numbers, dates and truth values."""
    return pa.types.is_primitive(kind) or pa.types.is_decimal(kind)


def _as_text(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """The column as text, whole numbers without a fraction, as a text table has them."""
    if pa.types.is_floating(column.type):
        try:
            column = column.cast(pa.int64())
        except pa.ArrowInvalid:
            pass
    return column.cast(pa.string())


def _seconds(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Times and durations in seconds; times count from 1970."""
    per_second = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[column.type.unit]
    whole = pa.int32() if column.type.bit_width == 32 else pa.int64()
    count = column.cast(whole).cast(pa.float64(), safe=False)
    return pc.call_function("divide", [count, pa.scalar(per_second)])


def _as_it_is(column: pa.ChunkedArray, name: str, path: Path) -> pa.ChunkedArray:
    """The column as numbers if float64 (needed for gaps) represents them exactly, else as text."""
    kind = value_type(column.type)
    if pa.types.is_nested(kind):
        text = f"the column holds {kind}"
        raise bad_recording("wrong-type", text, "write numbers or text there", path, column=name)
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
    if pa.types.is_integer(kind) and column.null_count:
        is_number = column.cast(kind).cast(pa.float64(), safe=False).cast(kind, safe=False).equals(column.cast(kind))
    return column.cast(kind) if is_number else column.cast(kind).cast(pa.string())


@contextmanager
def readable_parquet(path: Path) -> Iterator[None]:
    """Turns errors of a missing or damaged file into MissingInputError or BadRecordingError."""
    try:
        yield
    except FileNotFoundError:
        raise file_missing(path) from None
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        message = str(error).partition("\n")[0]
        text = f"not a readable Parquet file ({message})"
        is_other = "magic bytes" in message
        remedy = "copy or write it again" + (", or give it the ending of what it is, such as .csv" if is_other else "")
        raise bad_recording("not-parquet", text, remedy, path) from None
