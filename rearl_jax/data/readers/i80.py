"""Leader-follower pairs of NGSIM I-80, one Parquet file in SI units."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import ngsim_pairs
from rearl_jax.data.reader import Entry, Reader


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per quarter of an hour."""
    path = ngsim_pairs.find_pairs(root)
    for name, run in ngsim_pairs.pairs_recordings(path).items():
        yield Entry(name, partial(ngsim_pairs.read_pairs, path, name, run, data))


READER = Reader(
    expected="the folder of the Parquet file of NGSIM I-80 leader-follower pairs",
    entries=entries,
    files=lambda root: [ngsim_pairs.find_pairs(root)],
)
