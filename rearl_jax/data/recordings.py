"""Recordings of a data set, one read at a time, whatever their format; a table in memory is a data set too."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from rearl_jax.config.data import TABLE_KEYS, DataConfig
from rearl_jax.data.checks.copies import Copies
from rearl_jax.data.checks.remarks import noted
from rearl_jax.data.reader import Entry
from rearl_jax.data.readers import reader_of
from rearl_jax.data.records import Recording
from rearl_jax.data.tables import in_memory
from rearl_jax.data.tables.in_memory import TableInMemory
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

_ONLY_WITH = {key: "table" for key in (*TABLE_KEYS, "ring")} | {"stretch": "pneuma", "window": "i24", "section": "i24"}
"""The data format with which a key has an effect."""


def iterate_recordings(data: DataConfig, labels: Sequence[str] = ()) -> Iterator[Recording]:
    """The recordings that `data.recordings` selects, each read when it is asked for.

    Args:
        data: The data set.
        labels: Columns of canonical tables that are wanted as labels of tracks; other formats have labels of their own.

    Raises:
        FileNotFoundError: data.root does not exist or holds no recordings of this format.
        ValueError: data.recordings selects none.
        BadRecordingError: A recording breaks the schema, see `schema.validate`.
    """
    entries = _selected(data)
    copies = Copies()
    while entries:
        # Taken out of the list, so that the memory of a file is freed with its last recording.
        entry = entries.pop(0)
        recording = noted(entry.labelled(labels) if labels and entry.labelled is not None else entry.read())
        recording.info.check()
        # In a published data set a copy is only noted, because the user cannot correct it.
        yield copies.checked(recording, entry.file if data.format.name == "table" else None)


def label_of_same(data: DataConfig) -> str | None:
    """Label that identifies the same driver or car in several recordings of the format; None if there is none."""
    return reader_of(data.format).same


def has_one_clock(data: DataConfig) -> bool:
    """True if the times of all vehicles in a recording of the format come from one clock."""
    return reader_of(data.format).has_one_clock


def count_recordings(data: DataConfig) -> int:
    """Number of recordings `iterate_recordings` yields; reads names and one column, not the rows."""
    return len(_selected(data))


def is_generated(data: DataConfig) -> bool:
    """True if any of the recordings was generated or simulated, also if it is read in another format."""
    if isinstance(data, TableInMemory):
        return False
    made = reader_of(data.format).generated
    return made is not None and made(data, _root(data))


def data_id(data: DataConfig) -> str:
    """Identity of the rows: the format, and a hash of names, sizes, beginnings and ends of the files and of the keys of
    data on which the rows depend.

    Equal files give equal ids on every machine.
    """
    keys: tuple[object, ...] = (data.recordings, data.on_bad.name, data.max_jump, data.default_length)
    parts = (data.window, data.section, data.stretch)
    if parts != (DataConfig.window, DataConfig.section, DataConfig.stretch):
        keys += parts
    if data.ring is not None:
        keys += (data.ring,)
    digest = hashlib.sha256(repr(keys).encode())
    for key in TABLE_KEYS:
        if given := getattr(data, key):
            digest.update(repr((key, sorted((str(name), str(value)) for name, value in given.items()))).encode())
    if isinstance(data, TableInMemory):
        digest.update(str(data.root).encode())
    for file in sorted(_files(data), key=lambda path: path.name):
        with file.open("rb") as content:
            head = content.read(2**16)
            content.seek(max(file.stat().st_size - 2**16, 0))
            tail = content.read()
        for part in (file.name.encode(), str(file.stat().st_size).encode(), head, tail):
            digest.update(hashlib.sha256(part).digest())
    return f"{data.format.name}-{digest.hexdigest()[:12]}"


def file_stamps(data: DataConfig) -> list[tuple[str, int, int]]:
    """Name, size in bytes and time of the last change in nanoseconds of every file of a data set.

    Changes whenever a file is touched, even if `data_id` stays the same, and differs between machines.
    """
    if isinstance(data, TableInMemory):
        return [(str(data.root), len(data.table), 0)]
    stats = sorted((path.name, path.stat()) for path in _files(data))
    return [(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]


def _selected(data: DataConfig) -> list[Entry]:
    if isinstance(data, TableInMemory):
        entries = list(in_memory.entries(data))
    else:
        defaults = DataConfig()
        for key, name in _ONLY_WITH.items():
            if getattr(data, key) != getattr(defaults, key) and data.format.name != name:
                message = f"has an effect with data={name} alone: choose that, or leave the key out"
                problem = Problem("key-without-effect", message, key=f"data.{key}", value=f"data={data.format.name}")
                raise InvalidInputError(problem)
        entries = list(reader_of(data.format).entries(data, _root(data)))
    # Equality is tested too, because a name with brackets does not match itself as a pattern.
    chosen = [entry for entry in entries if entry.id == data.recordings or fnmatchcase(entry.id, data.recordings)]
    if not chosen:
        names = ", ".join(entry.id for entry in entries[:5]) + (", ..." if len(entries) > 5 else "")
        message = f"is {data.recordings}, which selects none of {len(entries)} recordings: {names}"
        raise InvalidInputError(Problem("selects-none", message, key="data.recordings"))
    counts = Counter(entry.id for entry in chosen)
    twice = [entry for entry in chosen if counts[entry.id] > 1]
    if twice:
        files = list(dict.fromkeys(str(entry.file) for entry in twice if entry.id == twice[0].id))
        message = f"several recordings have the id {twice[0].id}, in {' and '.join(files)}"
        remedy = "keep one of the files if they hold the same recording, else read them from folders of their own"
        raise InvalidInputError(Problem("recording-twice", message, remedy, file=data.root))
    return chosen


def _root(data: DataConfig) -> Path:
    """Folder or file of the recordings; without data.root that of the shipped ones."""
    root = Path(data.root) if data.root else data.format.shipped
    if root is not None and root.exists():
        return root
    message = f"must name {reader_of(data.format).expected}"
    if data.root:
        message, file = f"{message}, but there is no such file or folder", str(Path(data.root).absolute())
        raise MissingInputError(Problem("root-missing", message, key="data.root", file=file))
    raise MissingInputError(Problem("root-unset", message, key="data.root", value="nothing"))


def _files(data: DataConfig) -> list[Path]:
    """The files that hold the rows of a data set, and those that describe them; none for a table in memory."""
    return [] if isinstance(data, TableInMemory) else reader_of(data.format).files(_root(data))
