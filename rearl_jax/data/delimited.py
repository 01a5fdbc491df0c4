"""CSV files in, Arrow tables out; a broken line is an error with its number, or is skipped and counted."""

from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from rearl_jax.config.data import OnBad
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, require_columns


def read_header(path: Path) -> list[str]:
    """Column names of a CSV file, as written.

    Raises:
        FileNotFoundError: There is no such file.
        BadRecordingError: The file is empty or not text.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: complete the recording or correct data.root")
    try:
        with path.open(encoding="utf-8-sig") as file:
            line = file.readline().strip()
    except UnicodeDecodeError as error:
        raise BadRecordingError(str(path), f"not a text file ({error.reason})", "give a CSV file") from None
    if not line:
        raise BadRecordingError(str(path), "the file is empty", "remove the file or complete it")
    return [name.strip().strip('"') for name in line.split(",")]


def read_csv(path: Path, columns: dict[str, pa.DataType], on_bad: OnBad) -> tuple[pa.Table, int]:
    """The named columns of a CSV file, and the number of broken lines that were skipped.

    A line is broken if its number of fields is not that of the header, as in a file that was cut off.

    Args:
        path: The file, its first line names the columns.
        columns: Name, as in the file, and type of every column to read.
        on_bad: stop makes a broken line an error.

    Raises:
        BadRecordingError: A column is missing, a value does not have the type of its column, or a line is
            broken and on_bad is stop.
    """
    present = read_header(path)
    require_columns(present, tuple(columns), str(path))
    broken: list[csv.InvalidRow] = []
    try:
        table = _parse(path, columns, broken, use_threads=True)
        if broken and on_bad is OnBad.stop:
            # Row numbers are known only to the sequential parser; it runs again, for the message.
            broken.clear()
            _parse(path, columns, broken, use_threads=False)
            raise _broken_line(path, broken[0], len(broken))
    except pa.ArrowInvalid:
        try:
            _parse(path, columns, [], use_threads=False)
        except pa.ArrowInvalid as error:
            raise _bad_value(path, present, str(error)) from None
        raise
    return table, len(broken)


def _parse(path: Path, columns: dict[str, pa.DataType], broken: list[csv.InvalidRow], *, use_threads: bool) -> pa.Table:
    def skip(row: csv.InvalidRow) -> str:
        broken.append(row)
        return "skip"

    return csv.read_csv(
        path,
        read_options=csv.ReadOptions(use_threads=use_threads),
        parse_options=csv.ParseOptions(invalid_row_handler=skip),
        convert_options=csv.ConvertOptions(
            include_columns=list(columns), column_types=columns, strings_can_be_null=True
        ),
    )


def _broken_line(path: Path, row: csv.InvalidRow, n_rows: int) -> BadRecordingError:
    # Arrow counts lines from 1 and the header is the first.
    text = f"the line has {row.actual_columns} fields instead of {row.expected_columns}"
    if n_rows > 1:
        text += f" (and {n_rows - 1} more lines)"
    remedy = f"the file is cut off or damaged: copy it again{DROP_HINT}"
    return BadRecordingError(str(path), text, remedy, row=row.number - 1)


def _bad_value(path: Path, present: list[str], message: str) -> BadRecordingError:
    """The error for a message such as `In CSV column #2: Row #5: CSV conversion error to double: ...`."""
    column, row = None, None
    for part in message.split(": "):
        if part.startswith("In CSV column #"):
            number = int(part.removeprefix("In CSV column #"))
            column = present[number] if number < len(present) else None
        elif part.startswith("Row #"):
            row = int(part.removeprefix("Row #")) - 1
    return BadRecordingError(str(path), message.splitlines()[0], "write a number there", column, row)
