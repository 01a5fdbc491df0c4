"""exiD: motorways with entries and exits, which are left out; not inD, rounD and uniD, which are no straight roads."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import exid
from rearl_jax.data.highd import find_recordings
from rearl_jax.data.reader import Entry, Reader
from rearl_jax.data.readers.highd import files


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per three files."""
    for path in find_recordings(root):
        yield Entry(exid.recording_id(path), partial(exid.read_recording, path, data), file=path)


READER = Reader(
    expected="the folder of NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv", entries=entries, files=files
)
