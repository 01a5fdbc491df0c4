"""Tables in files, in the format that the ending of their name says, and in memory."""

from pathlib import Path

import pandas as pd

from rearl_jax import read_recordings
from rearl_jax.config.data import DataConfig
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.tables.in_memory import in_memory


def write_table(rows: pd.DataFrame, path: Path) -> Path:
    """The path, after the rows have been written to it: Parquet for .parquet, CSV for every other ending."""
    if path.suffix == ".parquet":
        rows.to_parquet(path)
    else:
        rows.to_csv(path, index=False)
    return path


def read_table(path: Path, **keys):
    """The one recording of a table, read with these keys of `data`."""
    (recording,) = read_recordings(format="table", root=str(path), **keys)
    return recording


def read_rows(rows: pd.DataFrame, **keys):
    """The one recording of a table in memory, read with these keys of `data`."""
    (recording,) = iterate_recordings(in_memory(rows, DataConfig(**keys)))
    return recording
