"""The shipped part of NGSIM US-101: vehicles that change lanes; CC BY-SA 4.0."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import ngsim
from rearl_jax.data.reader import Entry, Reader
from rearl_jax.problems import MissingInputError, Problem

FILE = "us101_lane_changers.parquet"


def find_file(root: Path) -> Path:
    """The table: the one file that is named, or in the folder.

    Raises:
        FileNotFoundError: It is not there.
    """
    path = root / FILE if root.is_dir() else root
    if not path.is_file():
        raise MissingInputError(
            Problem("file-missing", "there is no such file: leave data.root empty for the shipped one", file=str(path))
        )
    return path


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per quarter of an hour."""
    path = find_file(root)
    for name, period in ngsim.us101_recordings(path).items():
        yield Entry(name, partial(ngsim.read_us101, path, name, period, data))


READER = Reader(
    expected=f"the file {FILE} or its folder; leave it empty for the shipped one",
    entries=entries,
    files=lambda root: [find_file(root)],
)
