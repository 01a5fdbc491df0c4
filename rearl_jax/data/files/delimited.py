"""Reads text tables into Arrow tables; a broken line is an error with its number, or is skipped and counted."""

import codecs
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import csv

from rearl_jax.config.data import BadRows
from rearl_jax.data.files.content import OPENERS, compression_of, in_utf8, wide_encoding_of
from rearl_jax.data.files.fields import BLANKS, UNKNOWN, fields_of
from rearl_jax.data.files.text_layout import SAMPLE_LINES, decimal_point_of, layout_of, readable, text_of
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, bad_recording, require_columns

_MAX_INTEGER = 2.0**63  # beyond it a number is no 64-bit integer
_BLOCK_BYTES = 2**20  # bytes
_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,' \u00a0\u2009\u202f]\d{3})+([.,]\d*)?")
_UTF8 = ("utf-8", "utf-8-sig")


def text_endings(ending: str) -> tuple[str, ...]:
    """Endings of text tables and of compressed ones, such as .csv, .csv.gz and .csv.zip."""
    return (ending, *(f"{ending}{packed}" for packed in (*OPENERS, ".zip")))


def stem_of(path: Path) -> str:
    """Name of a table without its ending, and without that of a compressed file."""
    return Path(path.stem).stem if path.suffix.lower() in (*OPENERS, ".zip") else path.stem


def read_header(path: Path) -> list[str]:
    """Column names of a CSV file, without blanks around them.

    Raises:
        FileNotFoundError: There is no such file.
        BadRecordingError: The file is empty, not text, or begins with numbers.
    """
    layout = layout_of(path)
    names = fields_of(layout.header, layout.delimiter)
    if len(names) > 1 and all(re.fullmatch(r"[+-]?\d+([.,]\d+)?", name) for name in names):
        text = f"the first line holds numbers, not names of columns: {', '.join(names[:5])}"
        raise bad_recording("header-missing", text, "write a first line with the names of the columns", path)
    return names


def read_csv(
    path: Path, columns: dict[str, pa.DataType], on_bad: BadRows, *, quoted: bool = True
) -> tuple[pa.Table, int]:
    """The named columns of a CSV file, and the number of broken lines that were skipped.

    Fields may be separated by commas, semicolons, tabs or vertical bars, and numbers may have a decimal comma. A line
    is broken if its number of fields differs from that of the header, as in a file that was cut off.

    Args:
        path: The file, its first line names the columns.
        columns: Name, as in the file, and type of every column to read.
        on_bad: stop makes a broken line an error.
        quoted: Whether quotes enclose fields.

    Raises:
        BadRecordingError: A column is missing or occurs twice, a value does not have the type of its column, the file
            is not text, or a line is broken and on_bad is stop.
    """
    present = read_header(path)
    require_columns(present, columns, path)
    _require_once(present, columns, path)
    lines = _lines_of(path, present)
    return (lines if quoted else replace(lines, quote=None)).table(columns, on_bad)


def _require_once(names: Sequence[str], columns: dict[str, pa.DataType], path: Path) -> None:
    """Raise BadRecordingError if a wanted column occurs twice."""
    twice = [name for name, n in Counter(names).items() if n > 1 and name in columns]
    if twice:
        raise bad_recording("column-twice", "the column occurs twice", "remove one of them", path, column=twice[0])


def read_below(
    path: Path, header: Sequence[str], n_above: int, columns: dict[str, pa.DataType], delimiter: str, on_bad: BadRows
) -> tuple[pa.Table, int]:
    """The named columns and the number of skipped lines, for a file with lines above its table and without quotes.

    Numbers may have a decimal comma.

    Args:
        path: The file.
        header: Names of its columns; those of empty fields at the ends of all lines may be missing.
        n_above: Lines above the first row, the header among them.
        columns: Name and type of every column to read.
        delimiter: Separator of fields.
        on_bad: stop makes a broken line an error.
    """
    with readable(path), in_utf8(path) as file:
        sample = list(islice(file, n_above, n_above + SAMPLE_LINES))
        is_copied = compression_of(path) or wide_encoding_of(path)
        content = b"".join([*sample, file.read()]) if is_copied else None
    decoded = (line.decode(errors="replace").rstrip("\r\n") for line in sample)
    lines = [line for line in decoded if line]
    if not lines:
        raise bad_recording("no-rows", "the table has no rows", "remove the file or complete it", path)
    first = lines[0].split(delimiter)
    _require_once(header, columns, path)
    names = list(header)
    while len(names) > len(first) and not names[-1]:
        names.pop()
    if len(first) > len(names) and not "".join(first[len(names) :]).strip():
        names += [""] * (len(first) - len(names))
    skipped, mark = n_above if content is None else 0, decimal_point_of(lines, delimiter)
    return _Lines(path, names, content, delimiter, mark, skipped, quote=None).table(columns, on_bad)


def first_rows(path: Path, number: int) -> tuple[pd.DataFrame, int]:
    """The first rows of a CSV file as texts, numbers with a decimal point, and how many lines among them are broken.

    Raises:
        BadRecordingError: The file is empty, damaged or not text.
    """
    names = read_header(path)
    layout = layout_of(path)
    with readable(path), text_of(path) as file:
        lines = list(islice(file, layout.header_lines, layout.header_lines + number))
    rows = [fields_of(line, layout.delimiter) for line in lines if line.strip()]
    whole = [row for row in rows if len(row) == len(names)]
    table = pd.DataFrame(whole, columns=[str(place) for place in range(len(names))], dtype=object)
    if layout.decimal_point == ",":
        table = table.replace(r"^([+-]?\d*),(\d+([eE][+-]?\d+)?)$", r"\1.\2", regex=True)
    return table.set_axis(names, axis=1), len(rows) - len(whole)


def _lines_of(path: Path, names: list[str]) -> "_Lines":
    """The lines of a file below its header; in memory if Arrow cannot read the file itself."""
    layout = layout_of(path)
    of_file = layout.delimiter, layout.decimal_point, layout.header_lines, layout.quote
    if not layout.compression and layout.encoding in _UTF8 and layout.delimiter != BLANKS:
        return _Lines(path, names, None, *of_file)
    with readable(path), text_of(path) as file:
        if layout.delimiter != BLANKS:
            return _Lines(path, names, file.read().encode(), *of_file)
        content = "\n".join("\t".join(line.split()) for line in islice(file, layout.header_lines, None)).encode()
    return _Lines(path, names, content, "\t", layout.decimal_point)


def read_blank_separated(
    path: Path, names: Sequence[str], columns: dict[str, pa.DataType], on_bad: BadRows
) -> tuple[pa.Table, int]:
    """As `read_csv` for a file without header and with blanks between fields; `names` are those of all its columns."""
    with readable(path), text_of(path) as file:
        content = "\n".join(",".join(line.split()) for line in file).encode()
    return _Lines(path, list(names), content).table(columns, on_bad)


@dataclass(frozen=True)
class _Lines:
    """Lines of a text table.

    Attributes:
        path: The file.
        names: Names of all its columns.
        content: The lines in UTF-8; None if they are those of the file itself.
        delimiter: Separator of fields.
        decimal_point: Mark before the fraction of a number.
        header_lines: Lines before the first row.
        quote: Mark that encloses fields; None if none does.
    """

    path: Path
    names: list[str]
    content: bytes | None = None
    delimiter: str = ","
    decimal_point: str = "."
    header_lines: int = 0
    quote: str | None = '"'

    def table(self, columns: dict[str, pa.DataType], on_bad: BadRows) -> tuple[pa.Table, int]:
        """The columns, and the number of lines skipped."""
        try:
            return self._parsed(columns, None), 0
        except pa.ArrowInvalid:
            pass
        broken: list[csv.InvalidRow] = []
        # Whole numbers may be written as 12.0, as pandas does if a column has missing values.
        lenient = {name: pa.float64() if pa.types.is_integer(kind) else kind for name, kind in columns.items()}
        try:
            table = self._as_text()._parsed(lenient, broken)
        except pa.ArrowInvalid as error:
            if "Could not skip" in str(error):  # no line below the header, which has no end of line
                raise bad_recording("no-rows", "the table has no rows", "complete the file", self.path) from None
            raise self._bad_value(str(error)) from None
        if broken and on_bad is BadRows.stop:
            raise self._broken_line(broken[0], len(broken))
        return self._whole(table, columns), len(broken)

    def _as_text(self) -> "_Lines":
        """The same lines, copied to memory as UTF-8 if necessary, because Arrow reports broken lines only in UTF-8."""
        with self.path.open("rb") if self.content is None else io.BytesIO(self.content) as file:
            decoder = codecs.getincrementaldecoder("utf-8")()
            try:
                while block := file.read(_BLOCK_BYTES):
                    decoder.decode(block)
                decoder.decode(b"", final=True)
            except UnicodeDecodeError:
                file.seek(0)
                return replace(self, content=file.read().decode(errors="replace").encode())
        return self

    def _whole(self, table: pa.Table, columns: dict[str, pa.DataType]) -> pa.Table:
        """The table with whole numbers in the columns that must hold them."""
        for place, name in enumerate(table.column_names):
            values = table[name]
            if columns[name] == values.type:
                continue
            numbers = values.to_numpy()
            whole = (np.abs(numbers) < _MAX_INTEGER) & (numbers == np.rint(numbers))
            unfit = values.is_valid().to_numpy() & ~whole
            if unfit.any():
                row = int(np.argmax(unfit))
                text = f"{numbers[row]:g} is not a whole number"
                remedy = "write a whole number there"
                raise bad_recording("value-unreadable", text, remedy, self.path, column=name, row=row + 1)
            table = table.set_column(place, name, values.cast(columns[name]))
        return table

    def _parsed(self, columns: dict[str, pa.DataType], broken: list[csv.InvalidRow] | None) -> pa.Table:
        """The columns; broken lines are appended to the list, and are errors without a list."""

        def skip(row: csv.InvalidRow) -> str:
            assert broken is not None
            broken.append(row)
            return "skip"

        # Opened here, because Arrow would decompress a plain file whose name ends like that of a compressed one.
        with self.path.open("rb") if self.content is None else io.BytesIO(self.content) as file:
            return csv.read_csv(
                file,
                # Row numbers are known only to the sequential parser.
                read_options=csv.ReadOptions(
                    use_threads=broken is None, column_names=self.names, skip_rows=self.header_lines
                ),
                parse_options=csv.ParseOptions(
                    delimiter=self.delimiter,
                    quote_char=self.quote or False,
                    invalid_row_handler=None if broken is None else skip,
                ),
                convert_options=csv.ConvertOptions(
                    include_columns=list(columns),
                    column_types=columns,
                    null_values=UNKNOWN,
                    strings_can_be_null=True,
                    decimal_point=self.decimal_point,
                ),
            )

    def _broken_line(self, row: csv.InvalidRow, n_rows: int) -> BadRecordingError:
        """The error for a line with a wrong number of fields, the first of `n_rows` such lines."""
        text = f"the line has {row.actual_columns} fields instead of {row.expected_columns}"
        if n_rows > 1:
            text += f" (and {n_rows - 1} more lines)"
        remedy = f"the file is cut off or damaged: copy it again{DROP_HINT}"
        # Arrow counts lines from 1, the header among them.
        return bad_recording("line-broken", text, remedy, self.path, row=row.number - self.header_lines)

    def _bad_value(self, message: str) -> BadRecordingError:
        """The error for a message such as `In CSV column #2: Row #5: CSV conversion error to double: ...`."""
        column, row = None, None
        for part in message.split(": "):
            if part.startswith("In CSV column #"):
                number = int(part.removeprefix("In CSV column #"))
                column = self.names[number] if number < len(self.names) else None
            elif part.startswith("Row #"):
                row = int(part.removeprefix("Row #")) - self.header_lines
        remedy = "the file is damaged: copy it again" if column is None else "write a number there, or leave it empty"
        found = re.search(r"invalid value '(.*)'", message, re.DOTALL)
        text = message.splitlines()[0] if found is None else f"{found[1][:80]!r} is not a number"
        if found is not None and found[1].strip('" ') == column:
            remedy = "the line repeats the names of the columns: remove it"
        elif found is not None and _THOUSANDS.fullmatch(found[1]):
            remedy = "write numbers without marks between thousands"
        return bad_recording("value-unreadable", text, remedy, self.path, column=column, row=row)
