"""Platoons of OpenACC, campaign ZalaZone, one Parquet file."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import openacc
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per unbroken part of a platoon."""
    path = openacc.find_platoons(root)
    for name, platoon in openacc.platoon_recordings(path).items():
        yield Entry(name, partial(openacc.read_platoon, path, name, platoon, data))


READER = Reader(
    expected="the folder of the Parquet file of OpenACC platoons",
    entries=entries,
    files=lambda root: [openacc.find_platoons(root)],
)
