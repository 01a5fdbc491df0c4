"""Recordings of a data set, one in memory at a time, whatever their format."""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from importlib.resources import files
from pathlib import Path

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data import canonical, highd, ngsim, ngsim_pairs, ngsim_published, openacc
from rearl_jax.data.records import Recording, RecordingInfo

__all__ = [
    "Recording",
    "RecordingInfo",
    "count_recordings",
    "data_id",
    "file_stamps",
    "is_generated",
    "iterate_recordings",
]

US101_FILE = "us101_lane_changers.parquet"


_EXPECTED = {
    DataFormat.us101: f"the file {US101_FILE} or its folder; leave it empty for the shipped one",
    DataFormat.ngsim: "the folder of the NGSIM tables (.csv or .txt)",
    DataFormat.i80: "the folder of the Parquet file of NGSIM I-80 leader-follower pairs",
    DataFormat.openacc: "the folder of the Parquet file of OpenACC platoons",
    DataFormat.highd: "the folder of NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv",
    DataFormat.generated: "the folder of generated recordings; `rearl prepare data=generated` writes them",
    DataFormat.table: "a .parquet or .csv file in the canonical schema, or a folder of them",
}


@dataclass(frozen=True)
class _Entry:
    """A recording that can be read."""

    id: str
    read: Callable[[], Recording]


def iterate_recordings(data: DataConfig) -> Iterator[Recording]:
    """The recordings that `data.recordings` selects, each read when it is asked for.

    Raises:
        FileNotFoundError: data.root does not exist or holds no recordings of this format.
        ValueError: data.recordings selects none.
        BadRecordingError: A recording breaks the schema, see `schema.validate`.
    """
    entries = _selected(data)
    while entries:
        # Taken out of the list, so that what a file keeps in memory goes with its last recording.
        yield entries.pop(0).read()


def count_recordings(data: DataConfig) -> int:
    """Number of recordings `iterate_recordings` yields; reads names and one column, not the rows."""
    return len(_selected(data))


def is_generated(data: DataConfig) -> bool:
    """Whether any of the recordings was made by the generator, whatever they are read as."""
    if data.format in (DataFormat.highd, DataFormat.generated):
        # Here, because the generator brings scipy.stats, which reading does not need.
        from rearl_jax.data.generator.dataset import TRUTH_FILE

        # The generator leaves a mark in the folder of its files.
        folder = highd.find_recordings(_root(data))[0].parent
        return data.format is DataFormat.generated or (folder / TRUTH_FILE).exists()
    if data.format is DataFormat.table:
        files = (canonical.TableFile(path, data) for path in canonical.find_tables(_root(data)))
        return any(info.generated for file in files for info in file.stated().values())
    return False


def data_id(data: DataConfig) -> str:
    """Identity of the rows: the format, a hash of names, sizes and ends of the files, and of the policy.

    Equal files give equal ids on every machine.
    """
    policy = (data.recordings, data.on_bad.name, data.max_jump, data.default_length)
    digest = hashlib.sha256(repr(policy).encode())
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

    Changes whenever a file is touched, also where `data_id` cannot see it, and on every machine.
    """
    stats = sorted((path.name, path.stat()) for path in _files(data))
    return [(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]


def _selected(data: DataConfig) -> list[_Entry]:
    entries = list(_ENTRIES[data.format](data, _root(data)))
    chosen = [entry for entry in entries if fnmatchcase(entry.id, data.recordings)]
    if not chosen:
        names = ", ".join(entry.id for entry in entries[:5]) + (", ..." if len(entries) > 5 else "")
        raise ValueError(f"data.recordings={data.recordings} selects none of {len(entries)} recordings: {names}")
    twice = sorted(name for name, n in Counter(entry.id for entry in chosen).items() if n > 1)
    if twice:
        raise ValueError(f"several recordings in {data.root} are called {twice[0]}: give each its own id")
    return chosen


def _root(data: DataConfig) -> Path:
    """Folder or file of the recordings."""
    if data.format is DataFormat.us101 and not data.root:
        return Path(str(files("rearl_jax.data").joinpath("us101", US101_FILE)))
    if data.root and Path(data.root).exists():
        return Path(data.root)
    problem = f"{Path(data.root).absolute()} does not exist" if data.root else "data.root is not set"
    raise FileNotFoundError(f"{problem}: data.root must name {_EXPECTED[data.format]}")


def _us101_file(root: Path) -> Path:
    path = root / US101_FILE if root.is_dir() else root
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist: leave data.root empty for the shipped file")
    return path


def _us101(data: DataConfig, root: Path) -> Iterator[_Entry]:
    path = _us101_file(root)
    for name, period in ngsim.us101_recordings(path).items():
        yield _Entry(name, partial(ngsim.read_us101, path, name, period, data))


def _published(data: DataConfig, root: Path) -> Iterator[_Entry]:
    for path in ngsim_published.find_published(root):
        file = ngsim_published.PublishedFile(path, data)
        for name in file.recordings():
            yield _Entry(name, partial(file.read, name))


def _pairs(data: DataConfig, root: Path) -> Iterator[_Entry]:
    path = ngsim_pairs.find_pairs(root)
    for name, run in ngsim_pairs.pairs_recordings(path).items():
        yield _Entry(name, partial(ngsim_pairs.read_pairs, path, name, run, data))


def _platoons(data: DataConfig, root: Path) -> Iterator[_Entry]:
    path = openacc.find_platoons(root)
    for name, platoon in openacc.platoon_recordings(path).items():
        yield _Entry(name, partial(openacc.read_platoon, path, name, platoon, data))


def _highd(data: DataConfig, root: Path) -> Iterator[_Entry]:
    generated = is_generated(data)
    for path in highd.find_recordings(root):
        name = highd.recording_id(path, generated=generated)
        yield _Entry(name, partial(highd.read_recording, path, data, generated=generated))


def _tables(data: DataConfig, root: Path) -> Iterator[_Entry]:
    for path in canonical.find_tables(root):
        file = canonical.TableFile(path, data)
        for name in file.recordings():
            yield _Entry(name, partial(file.read, name))


_ENTRIES: dict[DataFormat, Callable[[DataConfig, Path], Iterator[_Entry]]] = {
    DataFormat.us101: _us101,
    DataFormat.ngsim: _published,
    DataFormat.i80: _pairs,
    DataFormat.openacc: _platoons,
    DataFormat.highd: _highd,
    DataFormat.generated: _highd,
    DataFormat.table: _tables,
}


def _files(data: DataConfig) -> list[Path]:
    """The files the rows of a data set come from, and those that say how to read them."""
    root = _root(data)
    if data.format in (DataFormat.highd, DataFormat.generated):
        return [file for tracks in highd.find_recordings(root) for file in highd.require_files(tracks)]
    if data.format is DataFormat.us101:
        return [_us101_file(root)]
    if data.format is DataFormat.ngsim:
        return ngsim_published.find_published(root)
    if data.format is DataFormat.table:
        tables = canonical.find_tables(root)
        return [*tables, *filter(Path.is_file, map(canonical.sidecar, tables))]
    return [(ngsim_pairs.find_pairs if data.format is DataFormat.i80 else openacc.find_platoons)(root)]
