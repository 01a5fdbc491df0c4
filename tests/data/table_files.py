"""Tables in files, in the format that the ending of their name says."""

from pathlib import Path

import pandas as pd

from rearl_jax import read_recordings


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
