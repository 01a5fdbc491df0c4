"""Files of recordings in a folder: hidden ones are left out, packed and nested ones are pointed out."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from rearl_jax.problems import MissingInputError, Problem

PACKED = (".gz", ".bz2", ".xz", ".zst", ".zip", ".7z", ".rar", ".tar", ".tgz")
"""Endings of compressed files and archives."""
_DEEP = 2  # folders below the named one that are looked into for a hint
_MAX_NAME_LENGTH = 150  # characters; 255 is the limit of most file systems, with an ending and a mark while unfinished
_DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows keeps for devices."""
_HIDDEN = (".", "~$", "__")


def visible_files(root: Path, endings: Sequence[str]) -> list[Path]:
    """Files in the folder whose names end like one of `endings`, whatever their case, by name.

    Hidden files are left out: locks of editors (`.~lock.a.csv`, `~$a.csv`) and companions that macOS writes
    (`._a.csv`) have names like recordings but are not recordings.
    """
    files = sorted(root.glob("*")) if root.is_dir() else []
    return [file for file in files if is_visible(file) and _ends(file, endings) and file.is_file()]


def named_files(root: Path, endings: Sequence[str], wanted: str, usual: str) -> list[Path]:
    """The file that is named, or the visible files of the folder.

    Args:
        root: File or folder.
        endings: Endings of the names of recordings.
        wanted: Description of the file or folder that `data.root` must name.
        usual: The usual endings in words, such as `.csv or .txt`.

    Raises:
        MissingInputError: There is none.
    """
    found = [root] if root.is_file() else visible_files(root, endings)
    if not found:
        raise recordings_missing(f"no {usual}", root, wanted, endings)
    return found


def file_name_of(recording: str) -> str:
    """A file name without ending for a recording of any name, on every system; letters, digits, - _ . stay as they are.

    Different names give different file names. Other characters are written as in addresses, %5C for a backslash.
    """
    name = quote(recording, safe="")
    if name.startswith(_HIDDEN) or name.endswith(".") or name.partition(".")[0].lower() in _DEVICES:
        name = f"%{ord(name[0]):02X}{name[1:]}"
        name = f"{name[:-1]}%2E" if name.endswith(".") else name
    if len(name) > _MAX_NAME_LENGTH:
        name = f"{name[:_MAX_NAME_LENGTH]}-{hashlib.sha256(recording.encode()).hexdigest()[:12]}"
    return name


def only_parquet(root: Path, wanted: str) -> Path:
    """The one Parquet file in the folder.

    Raises:
        MissingInputError: There is none, or more than one; `wanted` states what `data.root` must name.
    """
    files = visible_files(root, (".parquet",))
    if len(files) != 1:
        raise recordings_missing(f"{len(files)} Parquet files", root, wanted, (".parquet",))
    return files[0]


def is_visible(file: Path) -> bool:
    """True unless the file is hidden, such as the locks and companions of programs and operating systems."""
    return not file.name.startswith(_HIDDEN)


def recordings_missing(found: str, root: Path, wanted: str, endings: Sequence[str] = ()) -> MissingInputError:
    """The error for a folder that holds `found`, such as `no .csv`, where `data.root` must name what is wanted.

    Args:
        found: Content of the folder.
        root: The folder.
        wanted: Description of the file or folder that `data.root` must name.
        endings: Endings of the names of recordings, to name other folders that have some.
    """
    message = f"{found}: data.root must name {wanted}{_hint(root, endings)}"
    return MissingInputError(Problem("recordings-missing", message, file=str(root)))


def _hint(root: Path, endings: Sequence[str]) -> str:
    if not root.is_dir():
        return ""
    packed = [file.name for file in sorted(root.glob("*")) if is_visible(file) and file.suffix.lower() in PACKED]
    if packed:
        return f"; unpack {', '.join(packed[:3])}"
    for depth in range(1, _DEEP + 1):
        folders = sorted(
            folder for folder in root.glob("/".join("*" * depth)) if folder.is_dir() and is_visible(folder)
        )
        holding = [folder for folder in folders if endings and visible_files(folder, endings)]
        if holding:
            return f"; there are some in {', '.join(str(folder) for folder in holding[:3])}: name that folder"
    return ""


def _ends(file: Path, endings: Sequence[str]) -> bool:
    return file.name.lower().endswith(tuple(ending.lower() for ending in endings))
