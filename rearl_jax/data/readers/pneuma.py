"""pNEUMA, vehicles of a city in wide rows, of which a straight stretch `data.stretch` is read."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import pneuma
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per file."""
    for path in pneuma.find_files(root):
        yield Entry(pneuma.recording_id(path), partial(pneuma.read_recording, path, data), file=path)


READER = Reader(expected="the folder of the files of pNEUMA (.csv)", entries=entries, files=pneuma.find_files)
