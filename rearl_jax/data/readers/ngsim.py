"""NGSIM tables as published, in feet, `.csv` or `.txt`; portal copies hold many rows twice."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import ngsim_published
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The highway recordings of all files."""
    for path in ngsim_published.find_published(root):
        file = ngsim_published.PublishedFile(path, data)
        for name in file.recordings():
            yield Entry(name, partial(file.read, name))


READER = Reader(
    expected="the folder of the NGSIM tables (.csv or .txt)", entries=entries, files=ngsim_published.find_published
)
