"""Vehicle records of Vissim, `.fzp`: the road that most vehicles follow, in the units that the file states."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import vissim
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per file."""
    for path in vissim.find_records(root):
        yield Entry(vissim.recording_id(path), partial(vissim.read_record, path, data), file=path)


def is_generated(data: DataConfig, root: Path) -> bool:
    """True: simulated traffic is no measurement."""
    return True


READER = Reader(
    expected="a vehicle record of Vissim (.fzp), or a folder of them",
    entries=entries,
    files=vissim.find_records,
    generated=is_generated,
)
