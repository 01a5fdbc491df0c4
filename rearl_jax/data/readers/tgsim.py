"""TGSIM highways (I-90/I-94, I-294, I-395), one `.csv` per place with several runs, in metres."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import tgsim
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The runs of all files."""
    for path in tgsim.find_files(root):
        for name, run in tgsim.runs(path, data).items():
            yield Entry(name, partial(tgsim.read_run, path, name, run, data), file=path)


READER = Reader(expected="the folder of the TGSIM trajectories (.csv)", entries=entries, files=tgsim.find_files)
