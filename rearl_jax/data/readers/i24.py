"""I-24 MOTION INCEPTION, JSON documents in feet, cut into windows of `data.window` and sections of `data.section`."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import i24
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The windows and sections of all files."""
    for path in i24.find_files(root):
        for name, cell in i24.cells(path, data).items():
            yield Entry(name, partial(i24.read_cell, path, name, cell, data), file=path)


READER = Reader(expected="the folder of the trajectories (.json), or one file", entries=entries, files=i24.find_files)
