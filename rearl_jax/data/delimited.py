"""Reads text tables into Arrow tables; a broken line is an error with its number, or is skipped and counted."""

import bz2
import csv as header_csv
import gzip
import io
import lzma
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from rearl_jax.config.data import OnBad
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, bad_recording, file_missing, require_columns

_OPENERS = {".gz": gzip.GzipFile, ".bz2": bz2.BZ2File, ".xz": lzma.LZMAFile}
_DELIMITERS = (",", ";", "\t", "|")
_LOOKED_AT = 20  # lines that tell the decimal point
_LARGEST_WHOLE = 2.0**63  # beyond it a number is no 64-bit integer
DAMAGED = (EOFError, OSError, lzma.LZMAError, zipfile.BadZipFile, zlib.error)
"""What reading a damaged file raises."""


def text_endings(ending: str) -> tuple[str, ...]:
    """The ending of a text table and of compressed ones, such as .csv, .csv.gz and .csv.zip."""
    return (ending, *(f"{ending}{packed}" for packed in (*_OPENERS, ".zip")))


def stem_of(path: Path) -> str:
    """Name of a table without its ending, and without that of a compressed file."""
    return Path(path.stem).stem if path.suffix.lower() in (*_OPENERS, ".zip") else path.stem


def opened(path: Path) -> io.BufferedIOBase:
    """The content of a text table, uncompressed.

    Raises:
        BadRecordingError: A .zip holds not one file.
    """
    suffix = path.suffix.lower()
    if suffix == ".zip":
        archive = zipfile.ZipFile(path)
        names = [name for name in archive.namelist() if not name.endswith("/") and not name.startswith("__MACOSX")]
        if len(names) != 1:
            text = f"the archive holds {len(names)} files, not one table"
            raise bad_recording("not-a-table", text, "unpack it, and name the folder", path)
        return io.BytesIO(archive.read(names[0]))
    return _OPENERS[suffix](path, "rb") if suffix in _OPENERS else path.open("rb")


def first_lines(path: Path, number: int) -> list[str]:
    """The first lines that are not empty, without what is not text."""
    try:
        with opened(path) as file:
            lines = (line.decode(errors="replace").strip() for line in file)
            return list(islice((line for line in lines if line), number))
    except DAMAGED as error:
        raise damaged(path, error) from None


def damaged(path: Path, error: Exception) -> BadRecordingError:
    """The error for a file that cannot be read or unpacked."""
    text = f"the file cannot be read ({str(error) or type(error).__name__})"
    return bad_recording("not-text", text, "the file is damaged: copy it again", path)


def _delimiter(header: str) -> str:
    """What separates the names of the columns; a comma if there is but one."""
    return max(_DELIMITERS, key=header.count)


def _decimal_point(lines: Sequence[str], delimiter: str) -> str:
    """A comma if numbers of the lines have one and none has a point, else a point."""
    if delimiter == ",":
        return "."
    fields = [field.strip(' "') for line in lines for field in line.split(delimiter)]
    marks = {found[1] for field in fields if (found := re.fullmatch(r"[+-]?\d+([.,])\d+", field))}
    return "," if marks == {","} else "."


def read_header(path: Path) -> list[str]:
    """Column names of a CSV file, without blanks around them.

    Raises:
        FileNotFoundError: There is no such file.
        BadRecordingError: The file is empty or not text.
    """
    if not path.is_file():
        raise file_missing(path)
    try:
        with opened(path) as file:
            line = file.readline().decode("utf-8-sig").strip()
        names = next(header_csv.reader([line], delimiter=_delimiter(line), skipinitialspace=True), [])
    except (UnicodeDecodeError, header_csv.Error) as error:
        raise bad_recording("not-text", f"not a text file ({error})", "give a CSV file in UTF-8", path) from None
    except DAMAGED as error:
        raise damaged(path, error) from None
    if not line:
        raise bad_recording("file-empty", "the file is empty", "remove the file or complete it", path)
    return [name.strip() for name in names]


def read_csv(
    path: Path, columns: dict[str, pa.DataType], on_bad: OnBad, *, quoted: bool = True
) -> tuple[pa.Table, int]:
    """The named columns of a CSV file, and the number of broken lines that were skipped.

    Fields may be separated by commas, semicolons, tabs or bars, and numbers may have a decimal comma. A line is broken
    if its number of fields is not that of the header, as in a file that was cut off.

    Args:
        path: The file, its first line names the columns.
        columns: Name, as in the file, and type of every column to read.
        on_bad: stop makes a broken line an error.
        quoted: Whether fields may stand in quotes; if so, a stray one takes all lines up to the next with it.

    Raises:
        BadRecordingError: A column is missing or there twice, a value does not have the type of its column, the file
            is not text, or a line is broken and on_bad is stop.
    """
    present = read_header(path)
    require_columns(present, tuple(columns), str(path))
    _require_once(present, columns, path)
    header, *lines = first_lines(path, 1 + _LOOKED_AT)
    delimiter = _delimiter(header)
    point = _decimal_point(lines, delimiter)
    return _Lines(path, present, 1, None, delimiter, point, quoted).table(columns, on_bad)


def _require_once(names: Sequence[str], columns: dict[str, pa.DataType], path: Path) -> None:
    twice = [name for name, n in Counter(names).items() if n > 1 and name in columns]
    if twice:
        raise bad_recording("column-twice", "the column occurs twice", "remove one of them", path, column=twice[0])


def read_below(
    path: Path, header: Sequence[str], n_above: int, columns: dict[str, pa.DataType], delimiter: str, on_bad: OnBad
) -> tuple[pa.Table, int]:
    """The same of a file with other lines above its table, whose fields do not stand in quotes.

    Args:
        path: The file.
        header: Names of its columns; those of empty fields at the ends of all lines may be missing.
        n_above: Lines above the first row, the header among them.
        columns: Name and type of every column to read.
        delimiter: What separates fields.
        on_bad: stop makes a broken line an error.
    """
    try:
        with opened(path) as file:
            line = next(islice(file, n_above, None), b"").decode(errors="replace").rstrip("\r\n")
    except DAMAGED as error:
        raise damaged(path, error) from None
    if not line:
        raise bad_recording("no-rows", "the table has no rows", "remove the file or complete it", path)
    first = line.split(delimiter)
    _require_once(header, columns, path)
    names = list(header)
    while len(names) > len(first) and not names[-1]:
        names.pop()
    if len(first) > len(names) and not "".join(first[len(names) :]).strip():
        names += [""] * (len(first) - len(names))
    return _Lines(path, names, n_above, None, delimiter, quoted=False).table(columns, on_bad)


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
    try:
        with opened(path) as file:
            content = b"\n".join(b",".join(line.split()) for line in file)
    except DAMAGED as error:
        raise damaged(path, error) from None
    return _Lines(path, list(names), 0, content).table(columns, on_bad)


@dataclass(frozen=True)
class _Lines:
    """Lines of a text table.

    Attributes:
        path: The file.
        names: Names of all its columns.
        n_above: Lines above the first row, the header among them.
        content: Comma-separated lines without a header; None if the file itself holds the lines below its header.
        delimiter: What separates fields.
        decimal_point: Mark before the fraction of a number.
        quoted: Whether fields may stand in quotes.
    """

    path: Path
    names: list[str]
    n_above: int
    content: bytes | None = None
    delimiter: str = ","
    decimal_point: str = "."
    quoted: bool = True

    def table(self, columns: dict[str, pa.DataType], on_bad: OnBad) -> tuple[pa.Table, int]:
        """The columns, and the number of lines skipped."""
        try:
            return self._parsed(columns, None), 0
        except pa.ArrowInvalid:
            # Looked at before broken lines are asked for: Arrow can hand them over only as text.
            self._require_text()
        broken: list[csv.InvalidRow] = []
        # Whole numbers may be written as 12.0, as pandas does where a column holds gaps.
        lenient = {name: pa.float64() if pa.types.is_integer(kind) else kind for name, kind in columns.items()}
        try:
            table = self._parsed(lenient, broken)
        except pa.ArrowInvalid as error:
            raise self._bad_value(str(error)) from None
        if broken and on_bad is OnBad.stop:
            raise self._broken_line(broken[0], len(broken))
        return self._whole(table, columns), len(broken)

    def _whole(self, table: pa.Table, columns: dict[str, pa.DataType]) -> pa.Table:
        """The table with whole numbers in the columns that must hold them."""
        for place, name in enumerate(table.column_names):
            values = table[name]
            if columns[name] == values.type:
                continue
            numbers = values.to_numpy()
            whole = (np.abs(numbers) < _LARGEST_WHOLE) & (numbers == np.rint(numbers))
            unfit = values.is_valid().to_numpy() & ~whole
            if unfit.any():
                row = int(np.argmax(unfit))
                text = f"{numbers[row]:g} is not a whole number"
                raise bad_recording(
                    "value-unreadable", text, "write a whole number there", self.path, column=name, row=row + 1
                )
            table = table.set_column(place, name, values.cast(columns[name]))
        return table

    def _parsed(self, columns: dict[str, pa.DataType], broken: list[csv.InvalidRow] | None) -> pa.Table:
        """The columns; broken lines are appended to the list, and are errors without a list."""

        def skip(row: csv.InvalidRow) -> str:
            assert broken is not None
            broken.append(row)
            return "skip"

        return csv.read_csv(
            self.path if self._bytes is None else io.BytesIO(self._bytes),
            # Row numbers are known only to the sequential parser.
            read_options=csv.ReadOptions(use_threads=broken is None, column_names=self.names, skip_rows=self.n_above),
            parse_options=csv.ParseOptions(
                delimiter=self.delimiter,
                quote_char='"' if self.quoted else False,
                invalid_row_handler=None if broken is None else skip,
            ),
            convert_options=csv.ConvertOptions(
                include_columns=list(columns),
                column_types=columns,
                strings_can_be_null=True,
                decimal_point=self.decimal_point,
            ),
        )

    @cached_property
    def _bytes(self) -> bytes | None:
        """The content in memory; None if Arrow can read the file itself."""
        if self.content is not None or self.path.suffix.lower() not in (*_OPENERS, ".zip"):
            return self.content
        try:
            with opened(self.path) as file:
                return file.read()
        except DAMAGED as error:
            raise damaged(self.path, error) from None

    def _require_text(self) -> None:
        with opened(self.path) as file:
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
        # Arrow counts lines from 1, those above the first row among them.
        return bad_recording("line-broken", text, remedy, self.path, row=row.number - self.n_above)

    def _bad_value(self, message: str) -> BadRecordingError:
        """The error for a message such as `In CSV column #2: Row #5: CSV conversion error to double: ...`."""
        column, row = None, None
        for part in message.split(": "):
            if part.startswith("In CSV column #"):
                number = int(part.removeprefix("In CSV column #"))
                column = self.names[number] if number < len(self.names) else None
            elif part.startswith("Row #"):
                row = int(part.removeprefix("Row #")) - self.n_above
        remedy = "the file is damaged: copy it again" if column is None else "write a number there"
        return bad_recording("value-unreadable", message.splitlines()[0], remedy, self.path, column=column, row=row)
