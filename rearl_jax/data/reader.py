"""What a format of recordings is: how its recordings are listed and read, and which files they come from."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.records import Recording


@dataclass(frozen=True)
class Entry:
    """A recording that can be read.

    Attributes:
        id: Its name, unique in its data set.
        read: The recording, checked by `schema.validate`; called when it is its turn.
    """

    id: str
    read: Callable[[], Recording]


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Every function gets the file or folder that data.root names; it exists.

    Attributes:
        expected: What data.root must name, in words.
        entries: The recordings, in order. Names are read here, rows are not.
        files: The files the rows come from, and those that say how to read them. Raises FileNotFoundError for none.
        generated: Whether any of the recordings was made by the generator; None for a format that has no such mark.
    """

    expected: str
    entries: Callable[[DataConfig, Path], Iterator[Entry]]
    files: Callable[[Path], list[Path]]
    generated: Callable[[DataConfig, Path], bool] | None = None
