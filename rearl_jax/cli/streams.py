"""Standard streams that any text can be written to, whatever a terminal can show and whether or not they are open."""

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
"""Characters of tables and notes, as a terminal gets them that does not know them."""

_HANDLER = "rearl-plain"


def make_writable() -> None:
    """Opens closed standard streams on the null device, and lets all write any text, if need be as plain characters.

    A closed descriptor would be given to the next file that is opened, and whatever a library prints would land there.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(_occupied(number), mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    codecs.register_error(_HANDLER, _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            if not _is_universal(stream.encoding):
                stream.reconfigure(errors=_HANDLER)
            elif stream.errors == "strict":  # names of files that are no text
                stream.reconfigure(errors="backslashreplace")


def _occupied(number: int) -> int:
    """A descriptor of the null device: this one, unless a file has taken its place."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    try:
        os.fstat(number)
    except OSError:
        os.dup2(nowhere, number)
    if nowhere == number or not os.path.sameopenfile(nowhere, number):
        return nowhere
    os.close(nowhere)
    return number


def _is_universal(encoding: str) -> bool:
    try:
        return codecs.lookup(encoding).name.startswith("utf")
    except LookupError:
        return False


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Characters that an encoding has for those it has not; a question mark where there are none."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(map(_plain_character, text)), error.end


def _plain_character(character: str) -> str:
    if character in _PLAIN:
        return _PLAIN[character]
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"
