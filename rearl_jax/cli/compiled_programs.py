"""Warnings of JAX about its folder of compiled programs, in words for the user; damaged programs are replaced.

A process that is killed while it stores a program, or a full disk, leaves a part of the program, which JAX itself would
neither use nor replace.
"""

import glob
import logging
import re
import warnings
import zlib
from pathlib import Path
from typing import TextIO

log = logging.getLogger(__name__)

_WARNING = re.compile(r"Error (reading|writing) persistent compilation cache entry for '([^']*)': (.*)", re.DOTALL)


def explain_warnings(folder: Path) -> None:
    """From here on, warnings of JAX about its folder of compiled programs are explained, and their cause is removed."""
    if not isinstance(warnings.showwarning, _Explained):
        warnings.showwarning = _Explained(folder)


class _Explained:
    """Display of warnings, each of those about the folder once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._others = warnings.showwarning
        self._said: set[str] = set()

    def __call__(
        self,
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        found = _WARNING.match(str(message))
        if found is None:
            self._others(message, category, filename, lineno, file, line)
            return
        action, program, error = found.groups()
        damaged = self._damaged(program, may_be_any=action == "reading")
        for path in damaged:
            path.unlink(missing_ok=True)
        if action in self._said:
            return
        self._said.add(action)
        if action == "reading":
            log.warning("%s holds damaged programs: they are removed and compiled again", self._folder)
        else:
            remedy = "free some space, or set JAX_COMPILATION_CACHE_DIR to another folder"
            log.warning("compiled programs are not stored in %s (%s): %s", self._folder, error, remedy)

    def _damaged(self, program: str, *, may_be_any: bool) -> list[Path]:
        """Files of the program that are not whole; if all seem whole and `may_be_any`, all of them."""
        paths = list(self._folder.glob(f"{glob.escape(program)}-*"))
        return [path for path in paths if not _is_whole(path)] or (paths if may_be_any else [])


def _is_whole(path: Path) -> bool:
    """True if a file can be decompressed; files compressed otherwise than by zlib count as damaged."""
    try:
        zlib.decompress(path.read_bytes())
    except (OSError, zlib.error):
        return False
    return True
