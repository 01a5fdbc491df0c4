"""highD: `x`, `y` are the corner of the box, y points down, `width` is the length of the vehicle."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.files.text_layout import first_names
from rearl_jax.data.formats import highd
from rearl_jax.data.reader import Entry, Reader
from rearl_jax.problems import MissingInputError


def is_generated(data: DataConfig, root: Path) -> bool:
    """True if the generator has left its mark beside the files."""
    # Imported here, because the generator imports scipy.stats, which reading does not need.
    from rearl_jax.data.generator.dataset import TRUTH_FILE

    return (highd.find_recordings(root)[0].parent / TRUTH_FILE).exists()


def files(root: Path) -> list[Path]:
    """The three files of every recording."""
    return [file for tracks in highd.find_recordings(root) for file in highd.require_files(tracks)]


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per three files."""
    return entries_of(data, root, generated=is_generated(data, root))


def entries_of(data: DataConfig, root: Path, *, generated: bool) -> Iterator[Entry]:
    """Entries of which it is known whether the generator made them."""
    for path in highd.find_recordings(root):
        name = highd.recording_id(path, generated=generated)
        yield Entry(name, partial(highd.read_recording, path, data, generated=generated), file=path)


def by_tracks(columns: Collection[str]) -> Callable[[Path], Path | None]:
    """Recognises the folder of three files per recording by columns of the first tracks."""

    def recognises(path: Path) -> Path | None:
        folder = path if path.is_dir() else path.parent
        if path.is_file() and not path.name.lower().endswith(("_tracks.csv", "_tracksmeta.csv", "_recordingmeta.csv")):
            return None
        try:
            first = highd.find_recordings(folder)[0]
        except MissingInputError:
            return None
        is_whole = all(file.is_file() for file in highd.recording_files(first))
        return folder if is_whole and set(columns) <= set(first_names(first)) else None

    return recognises


READER = Reader(
    expected="the folder of NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv",
    entries=entries,
    files=files,
    generated=is_generated,
    recognises=by_tracks(highd.COLUMNS),
    has_one_clock=True,
)
