"""Reads text tables into Arrow tables; a broken line is an error with its number, or is skipped and counted."""

import csv as header_csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from rearl_jax.config.data import OnBad
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, bad_recording, file_missing, require_columns


def read_header(path: Path) -> list[str]:
    """Column names of a CSV file, without blanks around them.

    Raises:
        FileNotFoundError: There is no such file.
        BadRecordingError: The file is empty or not text.
    """
    if not path.is_file():
        raise file_missing(path)
    try:
        with path.open(encoding="utf-8-sig") as file:
            line = file.readline().strip()
        names = next(header_csv.reader([line], skipinitialspace=True), [])
    except (UnicodeDecodeError, header_csv.Error) as error:
        raise bad_recording("not-text", f"not a text file ({error})", "give a CSV file in UTF-8", path) from None
    if not line:
        raise bad_recording("file-empty", "the file is empty", "remove the file or complete it", path)
    return [name.strip() for name in names]


def read_csv(path: Path, columns: dict[str, pa.DataType], on_bad: OnBad) -> tuple[pa.Table, int]:
    """The named columns of a CSV file, and the number of broken lines that were skipped.

    A line is broken if its number of fields is not that of the header, as in a file that was cut off.

    Args:
        path: The file, its first line names the columns.
        columns: Name, as in the file, and type of every column to read.
        on_bad: stop makes a broken line an error.

    Raises:
        BadRecordingError: A column is missing or there twice, a value does not have the type of its column, the file
            is not text, or a line is broken and on_bad is stop.
    """
    present = read_header(path)
    require_columns(present, tuple(columns), str(path))
    twice = [name for name, n in Counter(present).items() if n > 1 and name in columns]
    if twice:
        raise bad_recording("column-twice", "the column occurs twice", "remove one of them", path, column=twice[0])
    return _Lines(path, present).table(columns, on_bad)


def read_blank_separated(
    path: Path, names: Sequence[str], columns: dict[str, pa.DataType], on_bad: OnBad
) -> tuple[pa.Table, int]:
    """The same of a file without a header whose fields are separated by any number of blanks.

    Args:
        path: The file.
        names: Names of all its columns.
        columns: Name and type of every column to read.
        on_bad: stop makes a broken line an error.
    """
    with path.open("rb") as file:
        content = b"\n".join(b",".join(line.split()) for line in file)
    return _Lines(path, list(names), content).table(columns, on_bad)


@dataclass(frozen=True)
class _Lines:
    """Lines of a text table.

    Attributes:
        path: The file.
        names: Names of all its columns.
        content: Comma-separated lines without a header; None if the file itself holds such lines below its header.
    """

    path: Path
    names: list[str]
    content: bytes | None = None

    def table(self, columns: dict[str, pa.DataType], on_bad: OnBad) -> tuple[pa.Table, int]:
        """The columns, and the number of lines skipped."""
        try:
            return self._parsed(columns, None), 0
        except pa.ArrowInvalid:
            # Looked at before broken lines are asked for: Arrow can hand them over only as text.
            self._require_text()
        broken: list[csv.InvalidRow] = []
        try:
            table = self._parsed(columns, broken)
        except pa.ArrowInvalid as error:
            raise self._bad_value(str(error)) from None
        if broken and on_bad is OnBad.stop:
            raise self._broken_line(broken[0], len(broken))
        return table, len(broken)

    def _parsed(self, columns: dict[str, pa.DataType], broken: list[csv.InvalidRow] | None) -> pa.Table:
        """The columns; broken lines are appended to the list, and are errors without a list."""

        def skip(row: csv.InvalidRow) -> str:
            assert broken is not None
            broken.append(row)
            return "skip"

        return csv.read_csv(
            self.path if self.content is None else io.BytesIO(self.content),
            # Row numbers are known only to the sequential parser.
            read_options=csv.ReadOptions(
                use_threads=broken is None, column_names=self.names, skip_rows=self._header_lines
            ),
            parse_options=csv.ParseOptions(invalid_row_handler=None if broken is None else skip),
            convert_options=csv.ConvertOptions(
                include_columns=list(columns), column_types=columns, strings_can_be_null=True
            ),
        )

    @property
    def _header_lines(self) -> int:
        return 1 if self.content is None else 0

    def _require_text(self) -> None:
        with self.path.open("rb") as file:
            for number, line in enumerate(file, 1):
                try:
                    line.decode()
                except UnicodeDecodeError as error:
                    text = f"the line is not UTF-8 text ({error.reason})"
                    raise bad_recording(
                        "not-text", text, "the file is damaged: copy it again", self.path, line=number
                    ) from None

    def _broken_line(self, row: csv.InvalidRow, n_rows: int) -> BadRecordingError:
        text = f"the line has {row.actual_columns} fields instead of {row.expected_columns}"
        if n_rows > 1:
            text += f" (and {n_rows - 1} more lines)"
        remedy = f"the file is cut off or damaged: copy it again{DROP_HINT}"
        # Arrow counts lines from 1, the header among them.
        return bad_recording("line-broken", text, remedy, self.path, row=row.number - self._header_lines)

    def _bad_value(self, message: str) -> BadRecordingError:
        """The error for a message such as `In CSV column #2: Row #5: CSV conversion error to double: ...`."""
        column, row = None, None
        for part in message.split(": "):
            if part.startswith("In CSV column #"):
                number = int(part.removeprefix("In CSV column #"))
                column = self.names[number] if number < len(self.names) else None
            elif part.startswith("Row #"):
                row = int(part.removeprefix("Row #")) - self._header_lines
        remedy = "the file is damaged: copy it again" if column is None else "write a number there"
        return bad_recording("value-unreadable", message.splitlines()[0], remedy, self.path, column=column, row=row)
