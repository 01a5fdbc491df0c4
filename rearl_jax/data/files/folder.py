"""Files of recordings in a folder: hidden ones are left out; errors name compressed files and files in subfolders."""

import hashlib
import logging
import os
from collections.abc import Collection, Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import quote

from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

log = logging.getLogger(__name__)

PACKED = (".gz", ".bz2", ".xz", ".zst", ".zip", ".7z", ".rar", ".tar", ".tgz")
"""Endings of compressed files and archives."""
_TABLES, _RECORDINGS = "tables", "recordings.parquet"  # of the results of `rearl prepare`
_MAX_DEPTH = 2  # levels of subfolders that are searched to name them in an error
_MAX_NAME_LENGTH = 150  # characters; 255 is the limit of most file systems, with an ending and a mark while unfinished
_DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows keeps for devices."""
_HIDDEN = (".", "~$", "__")  # beginnings of the names of hidden files


def visible_files(root: Path, endings: Sequence[str]) -> list[Path]:
    """Files in the folder whose names end like one of `endings`, whatever their case, by name.

    Hidden files are left out: lock files of editors (`.~lock.a.csv`, `~$a.csv`) and metadata files of macOS (`._a.csv`)
    end like recordings but are not recordings.

    Raises:
        InvalidInputError: The name of one is not text.
    """
    files = sorted(root.glob("*")) if root.is_dir() else []
    ends = tuple(ending.lower() for ending in endings)
    named = [file for file in files if is_visible(file) and file.name.lower().endswith(ends)]
    return [_with_text_name(file) for file in named if file.is_file()]


def named_files(root: Path, endings: Sequence[str], wanted: str, usual: str) -> list[Path]:
    """The file that is named, or the visible files of the folder whose names have one of the endings.

    Raises:
        MissingInputError: There is none. It states what data.root must name (`wanted`), and the usual endings in words
            (`usual`), such as `.csv or .txt`.
    """
    if root.is_file():
        return [_with_text_name(root)]
    found = visible_files(root, endings)
    if not found:
        raise recordings_missing(f"no {usual}", root, wanted, endings)
    tell_of_others_below(root, tuple(endings))
    return found


@lru_cache(maxsize=256)
def tell_of_others_below(root: Path, endings: tuple[str, ...]) -> None:
    """Warns once that files in subfolders are not read."""
    if below := _folders_below(root, endings):
        log.warning("%s: the files in %s are not read: name that folder, or move them up", root, _listed(below))


@lru_cache(maxsize=256)
def tell_of_unfinished(root: Path) -> None:
    """Warns once that a folder holds the tables of a task that has not written its list of recordings."""
    folder = root.absolute()
    study = folder.parent
    is_of_study = folder.name == _TABLES and (study / "config.json").is_file()
    if is_of_study and not (study / _RECORDINGS).is_file():
        log.warning("%s: the task that wrote these tables did not finish: recordings may be missing", root)


def file_name_of(recording: str, taken: Collection[str] = ()) -> str:
    """File name without ending for a recording, valid on every operating system.

    Different recordings get different file names. Letters, digits, - _ and . are kept, other characters are written as
    in web addresses, %5C for a backslash.

    Args:
        recording: Name of the recording.
        taken: File names in use. A hash is added to a name that differs from one of these by case only, because Windows
            and macOS do not distinguish case.
    """
    name = quote(recording, safe="")
    if name.startswith(_HIDDEN) or name.endswith(".") or name.partition(".")[0].lower() in _DEVICES:
        name = f"%{ord(name[0]):02X}{name[1:]}"
        name = f"{name[:-1]}%2E" if name.endswith(".") else name
    if len(name) > _MAX_NAME_LENGTH or name.lower() in {other.lower() for other in taken if other != name}:
        name = f"{name[:_MAX_NAME_LENGTH]}-{hashlib.sha256(recording.encode()).hexdigest()[:12]}"
    return name


def only_parquet(root: Path, wanted: str) -> Path:
    """The one Parquet file in the folder.

    Raises:
        MissingInputError: There is none, or more than one; `wanted` states what data.root must name.
    """
    files = visible_files(root, (".parquet",))
    if len(files) != 1:
        raise recordings_missing(f"{len(files)} Parquet files", root, wanted, (".parquet",))
    return files[0]


def _with_text_name(file: Path) -> Path:
    """The same file.

    Raises:
        InvalidInputError: Its path is not text in the encoding of file names, as on a disk of another system.
    """
    try:
        str(file).encode()
    except UnicodeEncodeError:
        shown = os.fsencode(file).decode(errors="backslashreplace")
        problem = Problem("name-not-text", "the name is not UTF-8 text", "rename it in ASCII letters", file=shown)
        raise InvalidInputError(problem) from None
    return file


def is_visible(file: Path) -> bool:
    """True unless the file is hidden, as lock files of editors and metadata files of operating systems are."""
    return not file.name.startswith(_HIDDEN)


def recordings_missing(found: str, root: Path, wanted: str, endings: Sequence[str] = ()) -> MissingInputError:
    """The error for a folder that holds `found`, such as `no .csv`, and not what data.root must name, `wanted`.

    Subfolders that hold files with one of the endings are named.
    """
    message = f"{found}: data.root must name {wanted}{_hint(root, endings)}"
    return MissingInputError(Problem("recordings-missing", message, file=str(root)))


def _hint(root: Path, endings: Sequence[str]) -> str:
    """End of the message: compressed files to unpack, or subfolders that hold recordings."""
    if not root.is_dir():
        return ""
    packed = [file.name for file in sorted(root.glob("*")) if is_visible(file) and file.suffix.lower() in PACKED]
    if packed:
        return f"; unpack {', '.join(packed[:3])}"
    if below := _folders_below(root, endings):
        return f"; there are some in {_listed(below)}: name that folder"
    return ""


def _folders_below(root: Path, endings: Sequence[str]) -> list[Path]:
    """The nearest subfolders that hold files with one of the endings; of a study folder, its folder of tables."""
    for depth in range(1, _MAX_DEPTH + 1):
        below = sorted(root.glob("/".join("*" * depth)))
        folders = [tables_of_study(folder) or folder for folder in below if folder.is_dir() and is_visible(folder)]
        if holding := [folder for folder in folders if endings and visible_files(folder, endings)]:
            return holding
    return []


def _listed(folders: Sequence[Path]) -> str:
    return ", ".join(str(folder) for folder in folders[:3])


def tables_of_study(folder: Path) -> Path | None:
    """The folder of the recordings in the results of `rearl prepare`; None for another folder."""
    tables = folder / _TABLES
    is_study = (folder / "config.json").is_file() and (folder / _RECORDINGS).is_file()
    return tables if is_study and tables.is_dir() else None
