"""JSON documents of a file that does not fit into memory: an array of objects, or one object after another.

The file is read in blocks. The documents of a block are found by their brackets; Arrow parses the requested fields.
"""

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import json

from rearl_jax.data.files.content import compression_of, in_utf8, wide_encoding_of
from rearl_jax.data.problems import bad_recording, file_missing

BLOCK_BYTES = 16 * 2**20
"""Bytes that are read at a time."""
MAX_DOCUMENT_BYTES = 64 * 2**20
"""Size [bytes] above which an object without an end is an error: a bracket has been lost."""
_MAX_BACKSLASHES = 1000  # consecutive backslashes before a quotation mark that are counted
_SEPARATORS = b" \t\r\n,"


@dataclass(frozen=True)
class Documents:
    """Documents of one block.

    Attributes:
        starts: Byte offsets of the documents in the file.
        sizes: Their lengths in the file [bytes].
        texts: Content of the documents, in UTF-8.
        n_broken: Number of documents after these that have no end, because the file is cut off.
    """

    starts: list[int]
    sizes: list[int]
    texts: list[bytes]
    n_broken: int = 0


def documents(path: Path) -> Iterator[Documents]:
    """The documents of a file, block by block.

    Raises:
        BadRecordingError: The file is empty, compressed, or holds something else than objects.
        FileNotFoundError: There is no such file.
    """
    if not path.is_file():
        raise file_missing(path)
    if packed := compression_of(path):
        raise bad_recording("not-json", f"the file is compressed ({packed})", "unpack it", path)
    codec = wide_encoding_of(path)
    rest, offset, is_array, closed, n_found = b"", 0, False, False, 0
    with in_utf8(path) as file:
        while block := file.read(BLOCK_BYTES):
            text = rest + block
            if offset == 0 and not n_found:
                is_array = text.lstrip(b"\xef\xbb\xbf" + _SEPARATORS).startswith(b"[")
            begins, ends = _spans(text)
            _require_json(text, begins, ends, offset, path)
            done = int(ends[-1]) if ends.size else 0
            if ends.size:
                bounds = np.stack([begins[: ends.size], ends], axis=1).ravel()
                texts = [text[begin:end] for begin, end in bounds.reshape(-1, 2)]
                in_file = offset + _places_in_file(text, bounds, codec)
                yield Documents(in_file[::2].tolist(), np.diff(in_file)[::2].tolist(), texts)
                n_found += ends.size
                offset = int(in_file[-1])
            rest = text[done:]
            closed = rest.rstrip(_SEPARATORS).endswith(b"]") and begins.size == ends.size
            if len(rest) > MAX_DOCUMENT_BYTES:
                fault = f"the object at byte {offset} does not end within {MAX_DOCUMENT_BYTES // 2**20} MB"
                raise bad_recording("document-broken", fault, "the file is damaged: copy it again", path)
    tail = rest.strip(_SEPARATORS + b"[]")
    if not n_found and not tail:
        raise bad_recording("file-empty", "the file holds no documents", "remove the file or complete it", path)
    if tail or (is_array and not closed):
        yield Documents([], [], [], max(tail.count(b'"_id"'), 1))


def _spans(text: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Offsets of the beginnings of the objects in a text, and of their ends; the last object may have no end."""
    codes = np.frombuffer(text, np.uint8)
    marks = np.flatnonzero((codes == ord("{")) | (codes == ord("}")) | (codes == ord('"')))
    quote = codes[marks] == ord('"')
    escaped = np.zeros(len(marks), dtype=bool)
    if b"\\" in text:
        for number in np.flatnonzero(quote & (marks > 0) & (codes[np.maximum(marks - 1, 0)] == ord("\\"))):
            before = text[max(marks[number] - _MAX_BACKSLASHES, 0) : marks[number]]
            # A backslash that is itself escaped does not escape the next character.
            escaped[number] = (len(before) - len(before.rstrip(b"\\"))) % 2 == 1
    within = np.cumsum(quote & ~escaped) % 2 == 1
    marks = marks[~quote & ~within]
    step = np.where(codes[marks] == ord("{"), 1, -1)
    depth = np.cumsum(step)
    begins, ends = marks[(step == 1) & (depth == 1)], marks[(step == -1) & (depth == 0)] + 1
    # An extra bracket shifts all that follow, so everything after it is ignored.
    n = min(len(begins), len(ends))
    wrong = np.flatnonzero(ends[:n] <= begins[:n])
    n = int(wrong[0]) if wrong.size else n
    return begins[: n + 1], ends[:n]


def _require_json(text: bytes, begins: np.ndarray, ends: np.ndarray, offset: int, path: Path) -> None:
    """Raise BadRecordingError if there is anything except commas and blanks between the objects of a text, which is the
    part of the file from the byte `offset` on.
    """
    before = np.concatenate([[0], ends])[: begins.size]
    for start, stop in zip(before, begins, strict=True):
        between = text[start:stop].strip(_SEPARATORS)
        if between and not (
            offset == 0 and start == 0 and between.removeprefix(b"\xef\xbb\xbf").strip() in (b"[", b"")
        ):
            fault = f"not JSON documents: {between[:20].decode(errors='replace')!r} at byte {offset + int(start)}"
            raise bad_recording("not-json", fault, "the file is damaged: copy it again", path)
    if not begins.size and text.strip(_SEPARATORS + b"[]\xef\xbb\xbf"):
        fault = f"not JSON documents: the file begins with {text[:20].decode(errors='replace')!r}"
        raise bad_recording("not-json", fault, "give an array of objects, or one object per line", path)


def _places_in_file(text: bytes, places: np.ndarray, codec: str) -> np.ndarray:
    """Places in a text in UTF-8, ascending, as places in its spelling in another encoding; codec is empty for none."""
    if not codec:
        return places
    parts = zip([0, *places[:-1]], places, strict=True)
    return np.cumsum([len(text[begin:end].decode(errors="replace").encode(codec)) for begin, end in parts])


def read_documents(path: Path, starts: Sequence[int], sizes: Sequence[int]) -> list[bytes]:
    """The documents at byte offsets of a file, in UTF-8."""
    codec = wide_encoding_of(path)
    with path.open("rb") as file:
        texts = []
        for start, size in zip(starts, sizes, strict=True):
            file.seek(start)
            texts.append(file.read(size))
    return [text.decode(codec, errors="replace").encode() for text in texts] if codec else texts


def parsed(texts: Sequence[bytes], fields: dict[str, pa.DataType]) -> tuple[pa.Table, np.ndarray]:
    """Fields of documents, null where a document lacks one, and the mask of those that cannot be parsed.

    Documents that cannot be parsed, because they are damaged or a field has another type, have no row in the table.
    """
    schema = pa.schema(list(fields.items()))
    table = _table(b"\n".join(texts), schema)
    if table is not None and table.num_rows == len(texts):
        return table, np.zeros(len(texts), dtype=bool)
    tables = [_table(text, schema) for text in texts]
    single = [document if document is not None and document.num_rows == 1 else None for document in tables]
    good = [document for document in single if document is not None]
    table = pa.concat_tables(good) if good else schema.empty_table()
    return table, np.array([document is None for document in single], dtype=bool)


def unreadable_field(text: bytes, fields: dict[str, pa.DataType]) -> str | None:
    """Name of the first field that a document states in another type; None if the document is not JSON."""
    if _table(text, pa.schema([])) is None:
        return None
    return next((name for name, kind in fields.items() if _table(text, pa.schema([(name, kind)])) is None), None)


def _table(text: bytes, schema: pa.Schema) -> pa.Table | None:
    """The fields of the documents in a text, one row each; None if it cannot be parsed."""
    options = json.ParseOptions(schema, newlines_in_values=True, unexpected_field_behavior="ignore")
    try:
        # One block, because a document must not lie across two.
        blocks = json.ReadOptions(use_threads=False, block_size=len(text) + 1)
        table = json.read_json(io.BytesIO(text), blocks, options)
        table.validate(full=True)  # finds damaged text here, which pandas would find only where it is used
    except pa.ArrowInvalid:
        return None
    return table
