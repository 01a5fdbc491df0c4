"""Checks of the cache and of the folder of results: existence, permissions, free space."""

import os
import shutil
import tempfile
from pathlib import Path

from rearl_jax.doctor.check import Check, fail, ok, warn
from rearl_jax.whole_files import is_private

_GIB = 2**30
_LARGE_CACHE = 20 * _GIB
"""Size of a cache [bytes] from which it should be emptied."""

_LITTLE_SPACE = 5 * _GIB
"""Free space [bytes] below which a large study may not fit."""

_NO_SPACE = 2**29
"""Free space [bytes] below which even the files of a small study may not fit."""


def cache_checks(cache: Path) -> list[Check]:
    """Checks of the folder of compiled programs and scenes."""
    return [_cache(cache), _space("the cache", cache)]


def results_checks(results: Path) -> list[Check]:
    """Checks of the folder of all studies."""
    return [_results(results), _space("results", results)]


def _cache(cache: Path) -> Check:
    remedy = "set XDG_CACHE_HOME to a folder of your own"
    if problem := _unwritable(cache):
        return warn("cache", f"{cache}: {problem}; every run compiles programs and cuts scenes again", remedy)
    if cache.is_dir() and not is_private(cache):
        return warn(
            "cache", f"others can write to {cache}, whose programs are run", f"chmod -R o-w {cache}, or {remedy}"
        )
    size, n_files = _size(cache)
    size_line = f"{cache}, {size / _GIB:.2f} GiB in {n_files} files"
    if size > _LARGE_CACHE:
        return warn("cache", size_line, f"rm -r {cache} (needed files are created again)")
    return ok("cache", size_line)


def _results(results: Path) -> Check:
    if problem := _unwritable(results):
        return fail("results", f"{results.absolute()}: {problem}", "name another folder with results.root=FOLDER")
    there = "" if results.is_dir() else " (not there yet)"
    return ok("results", f"{results.absolute()}{there}")


def _space(name: str, folder: Path) -> Check:
    free = shutil.disk_usage(_existing(folder)).free
    free_space = f"{free / _GIB:.1f} GiB free for {name}"
    if free < _NO_SPACE:
        return fail("disk", free_space, f"free some space, or move {name} to another disk")
    if free < _LITTLE_SPACE:
        return warn("disk", free_space, "large studies need a few GiB")
    return ok("disk", free_space)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that exists."""
    folder = folder.absolute()
    while not folder.exists():
        folder = folder.parent
    return folder


def _unwritable(folder: Path) -> str:
    """Reason why no file can be written to a folder; empty if one can. No file remains."""
    existing = _existing(folder)
    if not existing.is_dir():
        return f"{existing} is not a folder"
    try:
        with tempfile.TemporaryFile(dir=existing) as file:
            file.write(b"rearl")
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _size(folder: Path) -> tuple[int, int]:
    """Bytes and number of files."""
    size = n_files = 0
    for root, _, names in os.walk(folder):
        for name in names:
            try:
                size += os.lstat(os.path.join(root, name)).st_size
            except OSError:  # removed meanwhile
                continue
            n_files += 1
    return size, n_files
