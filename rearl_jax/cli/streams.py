"""Standard streams that accept any text, even if they are closed or their encoding lacks characters."""

import codecs
import io
import os
import sys
import unicodedata

_PLAIN = {
    "\u2013": "-",
    "\u2014": "-",
    "\u2212": "-",
    "\u00b1": "+-",
    "\u00d7": "x",
    "\u00b7": "*",
    "\u2264": "<=",
    "\u2265": ">=",
    "\u2248": "~",
    "\u2192": "->",
    "\u2026": "...",
    "\u00b5": "u",
    "\u03bc": "u",
    "\u0394": "d",
}
"""ASCII replacements of characters in tables and notes, for encodings that lack these characters."""

_HANDLER = "rearl-plain"


def make_writable() -> None:
    """Opens closed standard streams on the null device, and replaces characters that the encoding of a stream lacks.

    The operating system gives a closed descriptor to the next file that is opened; output of libraries would go there.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(_null_descriptor(number), mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    codecs.register_error(_HANDLER, _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            if not _is_unicode(stream.encoding):
                stream.reconfigure(errors=_HANDLER)
            elif stream.errors == "strict":  # because file names may contain bytes that are not text
                stream.reconfigure(errors="backslashreplace")


def _null_descriptor(number: int) -> int:
    """Descriptor of the null device: the given number, or another one if an open file uses that number."""
    null = os.open(os.devnull, os.O_RDWR)
    try:
        os.fstat(number)
    except OSError:
        os.dup2(null, number)
    if null == number or not os.path.sameopenfile(null, number):
        return null
    os.close(null)
    return number


def _is_unicode(encoding: str) -> bool:
    try:
        return codecs.lookup(encoding).name.startswith("utf")
    except LookupError:
        return False


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Codec error handler that replaces characters by ASCII ones; a question mark where there is no similar one."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(map(_plain_character, text)), error.end


def _plain_character(character: str) -> str:
    if character in _PLAIN:
        return _PLAIN[character]
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"
