"""Format of recordings: how they are listed and read, and which files they come from."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rearl_jax.config.data import DataConfig
from rearl_jax.data.columnar import column_names, is_parquet
from rearl_jax.data.folder import visible_files
from rearl_jax.data.records import Recording


@dataclass(frozen=True)
class Entry:
    """A recording that can be read.

    Attributes:
        id: Its name, unique in its data set.
        read: The recording, checked by `schema.validate`; called when the recording is needed.
        labelled: The same with further columns as labels; None where the format has its own and no others.
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
        expected: What data.root must name, in words.
        entries: The recordings, in order. Names are read here, rows are not.
        files: The files the rows come from, and those that say how to read them. Raises FileNotFoundError for none.
        same: Label that joins what the same driver or car did in several recordings; None where nothing does.
        generated: Whether any of the recordings was made by the generator; None for a format that has no such mark.
        recognises: What data.root must name for a file or folder in this format, None for one in another; tells from
            names and first lines alone, and raises nothing but errors of reading. None for a format without signs.
    """

    expected: str
    entries: Callable[[DataConfig, Path], Iterator[Entry]]
    files: Callable[[Path], list[Path]]
    same: str | None = None
    generated: Callable[[DataConfig, Path], bool] | None = None
    recognises: Callable[[Path], Path | None] | None = None


def parts_of(
    find: Callable[[Path], Path],
    parts: Callable[[Path], dict[str, Any]],
    read: Callable[[Path, str, Any, DataConfig], Recording],
) -> Callable[[DataConfig, Path], Iterator[Entry]]:
    """Entries of a format whose recordings are parts of one file.

    Args:
        find: The file.
        parts: Recording id -> what tells its rows from others.
        read: One recording of the file by its id and part.
    """

    def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
        path = find(root)
        for name, part in parts(path).items():
            yield Entry(name, partial(read, path, name, part, data), file=path)

    return entries


def by_columns(columns: Collection[str]) -> Callable[[Path], Path | None]:
    """Recognises the one Parquet file of a folder by columns that it has; what data.root must name is the folder."""

    def recognises(path: Path) -> Path | None:
        files = visible_files(path, (".parquet",)) if path.is_dir() else [path]
        is_one = len(files) == 1 and is_parquet(files[0]) and set(columns) <= set(column_names(files[0]))
        return files[0].parent if is_one else None

    return recognises
