"""Format of recordings: how they are listed and read, and which files they come from."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rearl_jax.config.data import DataConfig
from rearl_jax.data.files.columnar import column_names, is_parquet
from rearl_jax.data.files.folder import visible_files
from rearl_jax.data.records import Recording
from rearl_jax.problems import ProblemError


@dataclass(frozen=True)
class Entry:
    """A recording that can be read.

    Attributes:
        id: Its name, unique in its data set.
        read: The recording, checked by `schema.validate`; called when the recording is needed.
        labelled: As `read`, with the named columns as labels of tracks; None for a format whose labels are fixed.
        file: File its rows come from; None for a table in memory.
    """

    id: str
    read: Callable[[], Recording]
    labelled: Callable[[Sequence[str]], Recording] | None = None
    file: Path | None = None


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Every function gets the file or folder that data.root names; it exists.

    Attributes:
        expected: Description of the file or folder that data.root must name.
        entries: The recordings, in order. Names are read here, rows are not.
        files: The files that hold the rows, and those that describe them. Raises FileNotFoundError if there are none.
        same: Label by which the same driver or car is recognised in several recordings; None for a format without one.
        generated: Whether any of the recordings was generated or simulated; None for a format of measurements only.
        recognises: Value of data.root for a file or folder in this format, None for another format. It decides by
            names and first lines alone, and raises errors of reading only. None for a format without such features.
        has_one_clock: Whether one system, such as cameras or a simulation, gives the times of all vehicles; False if
            vehicles may have loggers with clocks of their own.
    """

    expected: str
    entries: Callable[[DataConfig, Path], Iterator[Entry]]
    files: Callable[[Path], list[Path]]
    same: str | None = None
    generated: Callable[[DataConfig, Path], bool] | None = None
    recognises: Callable[[Path], Path | None] | None = None
    has_one_clock: bool = False


def one_per_file(
    find: Callable[[Path], list[Path]], name: Callable[[Path], str], read: Callable[[Path, DataConfig], Recording]
) -> Callable[[DataConfig, Path], Iterator[Entry]]:
    """Entries of a format with one recording per file: functions that find the files, name a recording and read it."""

    def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
        for path in find(root):
            yield Entry(name(path), partial(read, path, data), file=path)

    return entries


def parts_of_files(
    find: Callable[[Path], list[Path]],
    parts: Callable[[Path, DataConfig], Mapping[str, Any]],
    read: Callable[[Path, str, Any, DataConfig], Recording],
) -> Callable[[DataConfig, Path], Iterator[Entry]]:
    """Entries of a format whose recordings are parts of files.

    `parts` gives the id of each recording of a file, and what selects its rows; `read` gets both.
    """

    def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
        for path in find(root):
            for name, part in parts(path, data).items():
                yield Entry(name, partial(read, path, name, part, data), file=path)

    return entries


def parts_of(
    find: Callable[[Path], Path],
    parts: Callable[[Path], Mapping[str, Any]],
    read: Callable[[Path, str, Any, DataConfig], Recording],
) -> Callable[[DataConfig, Path], Iterator[Entry]]:
    """As `parts_of_files`, for a format with one file, whose division into recordings depends on no key of data."""
    return parts_of_files(lambda root: [find(root)], lambda path, _: parts(path), read)


def by_first_file(find: Callable[[Path], list[Path]], is_one: Callable[[Path], bool]) -> Callable[[Path], Path | None]:
    """Recognises a file, or a folder by the first of its files; data.root must name the file or folder itself.

    `is_one` judges a file by its first lines.
    """

    def recognises(path: Path) -> Path | None:
        try:
            return path if is_one(find(path)[0]) else None
        except ProblemError:
            return None  # no file of the format, or a damaged one

    return recognises


def by_columns(columns: Collection[str]) -> Callable[[Path], Path | None]:
    """Recognises the one Parquet file of a folder by its columns; data.root must name the folder."""

    def recognises(path: Path) -> Path | None:
        files = visible_files(path, (".parquet",)) if path.is_dir() else [path]
        is_one = len(files) == 1 and is_parquet(files[0]) and set(columns) <= set(column_names(files[0]))
        return files[0].parent if is_one else None

    return recognises
