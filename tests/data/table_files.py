"""Tables in files, in the format that the ending of their name says."""

from pathlib import Path

import pandas as pd


def write_table(rows: pd.DataFrame, path: Path) -> Path:
    """The path, after the rows have been written to it: Parquet for .parquet, CSV for every other ending."""
    if path.suffix == ".parquet":
        rows.to_parquet(path)
    else:
        rows.to_csv(path, index=False)
    return path
