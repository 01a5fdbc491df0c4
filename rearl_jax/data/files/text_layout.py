"""Layout of a text table: compression, encoding, lines before the header, delimiter, decimal mark and quotes."""

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import BinaryIO, cast

from rearl_jax.data.files.content import (
    DAMAGED,
    MAGIC,
    SAMPLE_BYTES,
    compression_of,
    encoding_shown,
    in_utf8,
    opened,
)
from rearl_jax.data.files.fields import BLANKS, fields_of, quote_of
from rearl_jax.data.problems import bad_recording, file_missing
from rearl_jax.data.units import UNITS, unit_named

SAMPLE_LINES = 20
"""Lines from which delimiter and decimal mark are determined."""
_MARKS = (",", ";", "\t", "|")
_DELIMITERS = (*_MARKS, BLANKS)
_SINGLE_BYTE = "cp1252"
_NAMES = {
    "utf-8": "UTF-8",
    "utf-8-sig": "UTF-8",
    "utf-32": "UTF-32",
    "utf-16": "UTF-16",
    "utf-16-le": "UTF-16",
    "utf-16-be": "UTF-16",
    _SINGLE_BYTE: "Windows-1252",
}
_BLOCK_BYTES = 2**20
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")  # characters that no text has
_UNDEFINED = re.compile(rb"[\x81\x8d\x8f\x90\x9d]")  # bytes that Windows-1252 does not define
# Characters of UTF-8; a file that holds them and is not valid UTF-8 is damaged, not in Windows-1252.
_MULTIBYTE = re.compile(rb"[\xc3-\xdf][\x80-\xbf]|[\xe1-\xef][\x80-\xbf]{2}")
_NUMBER = re.compile(r"[+-]?\d*(?:([.,])\d+|\d)(?:[eE][+-]?\d+)?")
_JSON = re.compile(r'\s*(\[\s*)?(\{\s*("|$)|\[\s*$)|\s*\[\s*$')
_XML = re.compile(r"\s*<(\?xml|!--|[A-Za-z][\w-]*[\s/>])")
_AS_CSV = "write it as CSV, one row per vehicle and frame, for instance with pandas.read_json and to_csv"
_NO_TABLES = (
    (_JSON, "JSON", _AS_CSV),
    (re.compile(r"\s*<(!doctype\s+)?html\b", re.IGNORECASE), "a web page", "log in, and download the table again"),
    (_XML, "XML", "of XML files only SUMO's floating car data are read, with data=sumo; write others as CSV"),
    (re.compile("version https://git-lfs"), "a pointer of Git LFS, not the table", "fetch it with `git lfs pull`"),
)
"""First lines of files that are not tables: pattern, kind of file and remedy."""
_BRACKETED = re.compile(r"[\[(<{]\s*(.*?)\s*[\])>}]")
_NO_UNIT = frozenset({"", "-", "--", "1", "n/a", "none", "id", "text", "string"})
_PREAMBLE = re.compile(r"#.*|sep=.", re.IGNORECASE)  # a comment, or the line that tells Excel the delimiter


@dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    Attributes:
        compression: Usual ending of files with this compression, such as .gz; empty for none.
        encoding: Name of the codec.
        is_sure: Whether the file itself states its encoding.
        header_lines: Lines above the first row.
        header: Names of the columns, each with its unit in brackets if a line below the names states the units.
        delimiter: Separator of fields; BLANKS for any number of blanks.
        decimal_point: Mark before the fraction of a number.
        quote: Mark that encloses fields, where any are enclosed.
    """

    compression: str
    encoding: str
    is_sure: bool
    header_lines: int
    header: str
    delimiter: str
    decimal_point: str
    quote: str = '"'

    @property
    def encoding_name(self) -> str:
        """Common name of the encoding."""
        return _NAMES[self.encoding]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Note on the encoding if it is not UTF-8."""
        if self.encoding.startswith("utf-8"):
            return ()
        doubt = "" if self.is_sure else ", which the bytes suggest and do not prove"
        return (f"the file is {self.encoding_name}{doubt}",)


def layout_of(path: Path) -> Layout:
    """The layout of a text table.

    Raises:
        FileNotFoundError: There is no such file.
        BadRecordingError: The file is empty, damaged or not text.
    """
    if not path.is_file():
        raise file_missing(path)
    stat = path.stat()
    return _layout(path, stat.st_size, stat.st_mtime_ns)


def text_of(path: Path) -> io.TextIOWrapper:
    """The characters of a text table, uncompressed and decoded.

    Raises:
        BadRecordingError: The file is damaged or not text.
    """
    encoding, _ = _encoding(path)
    return io.TextIOWrapper(cast(BinaryIO, opened(path)), encoding=encoding, newline="")


def first_lines(path: Path, number: int) -> list[str]:
    """The first lines that are not empty; bytes that are not text are replaced, and a very long line is split."""
    with readable(path), in_utf8(path) as file:
        parts = iter(partial(file.readline, SAMPLE_BYTES), b"")
        lines = (line.decode("utf-8-sig", errors="replace").strip() for line in parts)
        return list(islice((line for line in lines if line), number))


def first_names(path: Path) -> list[str]:
    """Fields of the first line that is neither empty nor a comment, whatever separates them."""
    line = next((line for line in first_lines(path, SAMPLE_LINES) if not _PREAMBLE.fullmatch(line)), "")
    return max((fields_of(line, delimiter) for delimiter in _MARKS), key=len)


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Turns errors of decompression and decoding into BadRecordingError."""
    try:
        yield
    except (*DAMAGED, UnicodeDecodeError) as error:
        text = f"the file cannot be read ({str(error) or type(error).__name__})"
        remedy = "unpack it with its password" if "password" in str(error) else "the file is damaged: copy it again"
        raise bad_recording("not-text", text, remedy, path) from None


@lru_cache(maxsize=256)
def _layout(path: Path, size: int, changed: int) -> Layout:
    """The layout; size and time of the last change show whether the file is unchanged."""
    with readable(path):
        encoding, is_sure = _encoding(path)
        try:
            with text_of(path) as file:
                lines = [line.rstrip("\r\n") for line in islice(file, 10 * SAMPLE_LINES)]
        except UnicodeDecodeError as error:
            text = f"the file is not {_NAMES[encoding]} text ({error.reason})"
            raise bad_recording("not-text", text, "the file is damaged: copy it again", path) from None
    filled = [number for number, line in enumerate(lines) if line.strip()]
    if not filled:
        raise bad_recording("file-empty", "the file is empty", "remove the file or complete it", path)
    for pattern, what, remedy in _NO_TABLES:
        if pattern.match(lines[filled[0]]):
            raise bad_recording("not-a-table", f"the file is {what}", remedy, path)
    header, rows = _header(lines, filled)
    stated = re.fullmatch(r"sep=(.)", lines[filled[0]].strip(), re.IGNORECASE)
    name_line = lines[header].lstrip("# ") if lines[header].startswith("#") else lines[header]
    name_line = name_line.strip(" ")  # a tab may stand before the first name, which may be empty
    delimiter = stated[1] if stated else _delimiter(name_line, rows)
    n_above, names = header + 1, name_line
    if rows and (units := _units(fields_of(rows[0], delimiter))):
        n_above = lines.index(rows[0], header + 1) + 1
        quote = "" if delimiter == BLANKS else '"'
        # Columns with a name and an entry in the line of units.
        pairs = zip(fields_of(names, delimiter), units, strict=False)
        names = delimiter.join(f"{quote}{name}[{unit}]{quote}" if unit else name for name, unit in pairs)
        rows = rows[1:]
    names += delimiter * _unnamed(fields_of(names, delimiter), [fields_of(row, delimiter) for row in rows])
    try:
        quote = quote_of(name_line, rows, delimiter)
    except csv.Error:
        text = f"the line has a field of more than {csv.field_size_limit()} characters"
        line = lines.index(max(lines[header], *rows, key=len)) + 1
        raise bad_recording("line-broken", text, "the file is damaged: copy it again", path, line=line) from None
    mark = decimal_point_of(rows, delimiter)
    return Layout(compression_of(path), encoding, is_sure, n_above, names, delimiter, mark, quote)


def _unnamed(names: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Number of empty fields at the ends of all rows for which the header has no names."""
    further = {len(row) - len(names) for row in rows if not any(row[len(names) :])}
    whole = len(further) == 1 and all(not any(row[len(names) :]) for row in rows)
    return max(further.pop(), 0) if whole else 0


def _units(fields: Sequence[str]) -> list[str]:
    """Units of the columns if a line states them, empty for columns without a unit; no units for any other line."""
    plain = [_BRACKETED.sub(r"\1", field.strip()) for field in fields]
    are_units = [any(unit_named(field, kind) for kind in UNITS) for field in plain]
    others = [field for field, is_unit in zip(plain, are_units, strict=True) if not is_unit]
    if sum(are_units) < 2 or any(field.casefold() not in _NO_UNIT for field in others):
        return []
    return [field if is_unit else "" for field, is_unit in zip(plain, are_units, strict=True)]


def _header(lines: Sequence[str], filled: Sequence[int]) -> tuple[int, list[str]]:
    """Number of the line with the names, and a sample of the lines below it; `filled` numbers the lines not empty."""
    place = 0
    while place + 1 < len(filled) and _PREAMBLE.fullmatch(lines[filled[place]].strip()):
        if _names_what_is_below(lines[filled[place]], lines[filled[place + 1]]):
            break
        place += 1
    if not _has_rows_below(lines, filled, place):
        candidates = range(place + 1, len(filled) - 1)
        place = next((number for number in candidates if _begins_table(lines, filled, number)), place)
    return filled[place], [lines[number] for number in filled[place + 1 : place + 1 + SAMPLE_LINES]]


def _has_rows_below(lines: Sequence[str], filled: Sequence[int], place: int) -> bool:
    """True if at least half of the lines below line `filled[place]` have as many fields as it, with any delimiter."""
    below = [lines[number] for number in filled[place + 1 : place + 1 + SAMPLE_LINES]]
    for delimiter in _DELIMITERS:
        wanted = len(fields_of(lines[filled[place]].strip(" "), delimiter))
        if wanted > 1 and 2 * sum(len(fields_of(row.strip(" "), delimiter)) == wanted for row in below) >= len(below):
            return True
    return False


def _begins_table(lines: Sequence[str], filled: Sequence[int], place: int) -> bool:
    """True if line `filled[place]` holds names only, and the next one as many fields, with numbers among them."""
    for delimiter in _DELIMITERS:
        names, row = (fields_of(lines[filled[number]].strip(" "), delimiter) for number in (place, place + 1))
        if len(names) > 2 and len(names) == len(row) and all(names[1:]) and not any(map(_NUMBER.fullmatch, names)):
            return any(map(_NUMBER.fullmatch, row)) and _has_rows_below(lines, filled, place)
    return False


def _names_what_is_below(comment: str, line: str) -> bool:
    """True if a comment has as many fields as the line below, which holds numbers."""
    for delimiter in _DELIMITERS:
        fields = fields_of(line, delimiter)
        if len(fields) > 1 and len(fields) == len(fields_of(comment.lstrip("# "), delimiter)):
            return any(_NUMBER.fullmatch(field) for field in fields)
    return False


def _delimiter(header: str, rows: Sequence[str]) -> str:
    """The delimiter that gives the lines as many fields as the header; a comma if there is only one column."""
    scores = {}
    for delimiter in _DELIMITERS:
        wanted = len(fields_of(header, delimiter))
        if wanted > 1:
            same = sum(len(fields_of(row, delimiter)) == wanted for row in rows)
            scores[delimiter] = (same, delimiter != BLANKS, wanted)
    return max(scores, key=lambda delimiter: scores[delimiter], default=",")


def decimal_point_of(lines: Sequence[str], delimiter: str) -> str:
    """A comma if numbers of the lines have one and none has a point, else a point."""
    fields = [field.strip(' "') for line in lines for field in fields_of(line, delimiter)]
    marks = {found[1] for field in fields if (found := _NUMBER.fullmatch(field))} - {None}
    return "," if marks == {","} else "."


def _encoding(path: Path) -> tuple[str, bool]:
    """Codec of the content, and whether the file itself states it.

    Bytes that are valid UTF-8 are read as UTF-8. Others are read as Windows-1252, which includes Latin-1; bytes that
    Windows-1252 does not define are an error.
    """
    with opened(path) as file:
        head = file.read(SAMPLE_BYTES)
        if any(head.startswith(magic) for magic in MAGIC):
            raise bad_recording("not-text", "the file is compressed twice", "unpack it once", path)
        codec, is_sure = encoding_shown(head)
        if codec:
            return codec, is_sure
        if control := _CONTROL.search(head):
            text = f"the file is not text (byte {control.start()} is {control[0][0]:#04x})"
            raise bad_recording("not-text", text, "name a text or Parquet table", path)
        decoder, block, line = codecs.getincrementaldecoder("utf-8")(), head, 1
        while block:
            try:
                decoder.decode(block)
            except UnicodeDecodeError as error:
                content = block + file.read()
                if _UNDEFINED.search(content) or _MULTIBYTE.search(content) or _CONTROL.search(content):
                    line += error.object[: error.start].count(b"\n")
                    text = f"the line is not UTF-8 text ({error.reason})"
                    advice = "the file is damaged: copy it again"
                    raise bad_recording("not-text", text, advice, path, line=line) from None
                return _SINGLE_BYTE, False
            line += block.count(b"\n")
            block = file.read(_BLOCK_BYTES)
    return "utf-8", True
