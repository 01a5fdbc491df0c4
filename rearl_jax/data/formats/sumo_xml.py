"""Elements of SUMO's XML files, one after the other: no file is held in memory as a tree."""

from collections.abc import Callable, Iterator
from pathlib import Path
from xml.parsers import expat

from rearl_jax.data.files.content import DAMAGED, in_utf8, wide_encoding_of
from rearl_jax.data.files.delimited import text_endings
from rearl_jax.data.files.text_layout import readable
from rearl_jax.data.problems import bad_recording

XML = text_endings(".xml")
"""Endings of SUMO's XML files."""

_BLOCK = 2**18  # bytes parsed at a time
# Bytes within which the first element must begin, after the configuration that SUMO writes as a comment.
_FIRST_ELEMENT_BYTES = 2**16
_UNCLOSED = (3, 4, 5, 6)  # codes of expat: nothing found, broken token, unclosed token, partial character


class CutOff(Exception):
    """The file ends within an element; `line` is its last line."""

    def __init__(self, line: int) -> None:
        super().__init__(line)
        self.line = line


def elements(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Names and attributes of all elements, in order.

    Raises:
        CutOff: The file ends within an element, as if SUMO had been stopped.
        BadRecordingError: The file is not XML, or cannot be unpacked.
    """
    found: list[tuple[str, dict[str, str]]] = []
    with readable(path):
        parser = _parser_of(path)
    parser.StartElementHandler = lambda name, attributes: found.append((name, attributes))
    is_last = False
    with in_utf8(path) as file:
        while not is_last:
            with readable(path):
                block = file.read(_BLOCK)
            is_last = not block
            fault = _fault_of(parser.Parse, block, is_last)
            yield from found
            found.clear()
            if fault is not None and is_last and fault.code in _UNCLOSED:
                raise CutOff(fault.lineno)
            if fault is not None:
                text = f"the line is not XML ({expat.ErrorString(fault.code)})"
                remedy = "write or copy the file again, or move it out of the folder if it is none of SUMO's"
                raise bad_recording("not-xml", text, remedy, path, line=fault.lineno)


def root_of(path: Path) -> str | None:
    """Name of the first element; None if there is none at the beginning of the file."""
    names: list[str] = []
    try:
        parser = _parser_of(path)
        parser.StartElementHandler = lambda name, _: names.append(name)
        with in_utf8(path) as file:
            _fault_of(parser.Parse, file.read(_FIRST_ELEMENT_BYTES), False)
    except DAMAGED:
        return None
    return names[0] if names else None


def _parser_of(path: Path) -> expat.XMLParserType:
    """A parser of what `in_utf8` gives: a file in UTF-16 or UTF-32 names that encoding, or none, in its first line."""
    return expat.ParserCreate("utf-8" if wide_encoding_of(path) else None)


def _fault_of(parse: Callable, block: bytes, is_last: bool) -> expat.ExpatError | None:
    """The error that parsing a block raises; None if it is sound."""
    try:
        parse(block, is_last)
    except expat.ExpatError as error:
        return error
    return None
