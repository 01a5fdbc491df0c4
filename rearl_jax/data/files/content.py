"""Content of text files: uncompressed, and in UTF-8 where the file is in UTF-16 or UTF-32."""

import bz2
import codecs
import gzip
import io
import lzma
import zipfile
import zlib
from pathlib import Path
from typing import BinaryIO, cast

from rearl_jax.data.files.folder import is_visible
from rearl_jax.data.problems import bad_recording

OPENERS = {".gz": gzip.GzipFile, ".bz2": bz2.BZ2File, ".xz": lzma.LZMAFile}
DAMAGED = (EOFError, OSError, lzma.LZMAError, zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError)
"""Errors of the standard library for compressed files that are damaged, encrypted, or compressed in another way."""
MAGIC = {b"\x1f\x8b": ".gz", b"BZh": ".bz2", b"\xfd7zXZ\x00": ".xz", b"PK\x03\x04": ".zip"}
"""Usual ending of compressed files by their first bytes."""
SAMPLE_BYTES = 2**16
"""Bytes from which it is decided whether a file is text, and in which encoding."""
# In this order, because the mark of UTF-32 begins like that of UTF-16.
_BYTE_ORDER_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def compression_of(path: Path) -> str:
    """Usual ending of files with the compression of this one, by its first bytes; empty for none."""
    with path.open("rb") as file:
        head = file.read(8)
    return next((ending for magic, ending in MAGIC.items() if head.startswith(magic)), "")


def opened(path: Path) -> io.BufferedIOBase:
    """The content of a text file, uncompressed.

    Raises:
        BadRecordingError: The .zip does not hold exactly one file.
    """
    packed = compression_of(path)
    if packed == ".zip":
        with zipfile.ZipFile(path) as archive:
            listed = (name for name in archive.namelist() if not name.endswith("/") and not name.startswith("__MACOSX"))
            names = [name for name in listed if is_visible(Path(name))]
            if "[Content_Types].xml" in names:
                raise bad_recording("not-a-table", "the file is a spreadsheet", "save its sheet as CSV", path)
            if len(names) != 1:
                text = f"the archive holds {len(names)} files, not one table"
                raise bad_recording("not-a-table", text, "unpack it, and name the folder", path)
            return io.BytesIO(archive.read(names[0]))
    return OPENERS[packed](path, "rb") if packed else path.open("rb")


def in_utf8(path: Path) -> io.BufferedIOBase:
    """The content of a text file, uncompressed, and in UTF-8 if the file is in UTF-16 or UTF-32.

    Bytes that these encodings do not define are replaced; other encodings stay as they are. A byte order mark stays, as
    that of UTF-8.

    Raises:
        BadRecordingError: The .zip does not hold exactly one file.
    """
    file = opened(path)
    try:
        codec = _wide_codec(file.read(SAMPLE_BYTES))
    except BaseException:
        file.close()
        raise
    file.seek(0)
    if not codec:
        return file
    text = io.TextIOWrapper(cast(BinaryIO, file), encoding=codec, errors="replace", newline="")
    return io.BufferedReader(_InUtf8(text))


def wide_encoding_of(path: Path) -> str:
    """Codec of a file in UTF-16 or UTF-32 with its order of bytes, by its first bytes; empty for another encoding."""
    with opened(path) as file:
        return _wide_codec(file.read(SAMPLE_BYTES))


def _wide_codec(head: bytes) -> str:
    """As `wide_encoding_of`, from the first bytes of the content."""
    codec, is_stated = encoding_shown(head)
    if not codec or codec == "utf-8-sig":
        return ""
    # The byte order mark is FF FE in UTF-16 and FF FE 00 00 in UTF-32 if the first byte is the least.
    return f"{codec}-{'le' if head[0] == 0xFF else 'be'}" if is_stated else codec


def encoding_shown(head: bytes) -> tuple[str, bool]:
    """Codec that the first bytes of a file show, empty for none, and whether a byte order mark states it.

    Text in UTF-16 without a mark is recognised by the zeros in every second byte.
    """
    codec = next((codec for mark, codec in _BYTE_ORDER_MARKS.items() if head.startswith(mark)), "")
    if codec:
        return codec, True
    zeros = [head[start::2].count(0) / max(len(head) / 2, 1) for start in (0, 1)]
    if max(zeros) > 0.4 and min(zeros) < 0.1:
        return ("utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"), False
    return "", False


class _InUtf8(io.RawIOBase):
    """Bytes of a text in UTF-8."""

    def __init__(self, text: io.TextIOWrapper) -> None:
        self._text = text
        self._rest = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray | memoryview, /) -> int:
        self._rest = self._rest or self._text.read(SAMPLE_BYTES).encode(errors="replace")
        n = min(len(buffer), len(self._rest))
        buffer[:n], self._rest = self._rest[:n], self._rest[n:]
        return n

    def close(self) -> None:
        self._text.close()
        super().close()
