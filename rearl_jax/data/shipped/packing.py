"""Makes the shipped recordings of leaders and followers from the published tables.

    python -m rearl_jax.data.shipped.packing i80 FOLDER_OF_THE_SOURCE FOLDER_TO_WRITE

with `i80`, `i80_slice`, `i80_lateral`, `openacc` or `fhwa`. `SETS` states which rows and columns are taken. Numbers are
rounded to a fixed number of decimals and stored as decimal numbers, encoded as differences from row to row and
compressed with zstd; such files are smaller than with 32-bit floating point numbers.
"""

import argparse
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.data.files.columnar import is_string, value_type
from rearl_jax.data.files.folder import only_parquet

TIME_DECIMALS = 1
"""Decimals of times [s]; all recordings have ten rows per second."""

_PRECISION = 9  # digits of a decimal number, the most that four bytes hold


@dataclass(frozen=True)
class Packed:
    """Selection from a published table.

    Attributes:
        file: Name of the shipped file.
        columns: Names of the columns, separated by blanks: first the key columns, which identify a track, then the
            time.
        n_key_columns: Number of key columns.
        decimals: Decimals of measured numbers [m], [m/s], [m/s^2]: 3 if the source has more, because no camera or
            receiver resolves less than a millimetre, else as many as the source.
        row_filter: Name of a text column, and the regular expression that it must match in the rows that are taken;
            None for all rows.
        min_rows: Least number of rows of a track that is taken.
        index_file: CSV file of the source with one row per run, copied with the rows of the runs that are taken; None
            for none.
    """

    file: str
    columns: str
    n_key_columns: int
    decimals: int
    row_filter: tuple[str, str] | None = None
    min_rows: int = 0
    index_file: str | None = None


_I80 = Packed(
    "i80_pairs.parquet",
    "run follower leader t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2 leader_length_m lane",
    n_key_columns=3,
    decimals=3,
)

SETS = {
    "i80": _I80,
    # One recording, pairs of 60 s or more: so few that `rearl discover` takes a minute or two.
    "i80_slice": replace(_I80, file="i80_slice_pairs.parquet", row_filter=("run", "^0500"), min_rows=600),
    "i80_lateral": Packed(
        "i80_lateral_pairs.parquet",
        "follower leader frame lane x_f_m y_f_m v_f_mps a_f_mps2 length_f_m width_f_m class_f y_l_m v_l_mps a_l_mps2 "
        "leader_length_m leader_width_m class_l",
        n_key_columns=2,
        decimals=2,
    ),
    "openacc": Packed(
        "zalazone_platoons.parquet",
        "file pos t_s speed_mps gap_to_follower_m model",
        n_key_columns=2,
        decimals=3,
        # All runs on the dynamic platform, where adaptive cruise control follows undisturbed, and all of human drivers.
        row_filter=("file", "__dynamic_|^no_ACC__"),
        index_file="zalazone_index.csv",
    ),
    "fhwa": Packed(
        "fhwa_pairs.parquet",
        "recording group follower_id leader_id pair t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2",
        n_key_columns=5,
        decimals=3,
    ),
}
"""Selections by name of the format."""


def pack(name: str, source: Path, target: Path) -> Path:
    """Path of the shipped file of a format, a key of `SETS`, written to a folder with the index file if there is one.

    `source` is the folder of the published table, one Parquet file.
    """
    packed = SETS[name]
    columns = packed.columns.split()
    key_columns = columns[: packed.n_key_columns]
    table = pq.read_table(only_parquet(source, f"the folder of the published table of {name}"))
    if packed.row_filter is not None:
        column, pattern = packed.row_filter
        table = table.filter(pa.array([bool(re.search(pattern, text)) for text in table[column].to_pylist()]))
    table = pa.table({column: _as_stored(table[column], column, packed.decimals) for column in columns})
    if packed.min_rows:
        tracks = table.group_by(key_columns).aggregate([([], "count_all")])
        tracks = tracks.filter(np.asarray(tracks["count_all"]) >= packed.min_rows).select(key_columns)
        table = table.join(tracks, key_columns, join_type="left semi")  # keeps the rows of these tracks
    # By track and time, so that the differences from row to row are small.
    table = table.sort_by([(column, "ascending") for column in columns[: packed.n_key_columns + 1]])
    text_columns = [field.name for field in table.schema if pa.types.is_string(field.type)]
    path = target / packed.file
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=19,
        use_dictionary=text_columns,  # type: ignore[arg-type]
        column_encoding={column: "DELTA_BINARY_PACKED" for column in columns if column not in text_columns},
        store_decimal_as_integer=True,
    )
    if packed.index_file is not None:
        runs = set(table["file"].to_pylist())
        header, *lines = (source / packed.index_file).read_text(encoding="utf-8").splitlines()
        kept = [line for line in lines if line.partition(".csv")[0] in runs]  # a line begins with RUN.csv
        (target / packed.index_file).write_text("\n".join([header, *kept]) + "\n", encoding="utf-8")
    return path


def _as_stored(column: pa.ChunkedArray, name: str, decimals: int) -> pa.ChunkedArray:
    """A column as it is stored: texts, whole numbers in four bytes, other numbers rounded to decimal numbers."""
    kind = value_type(column.type)
    if is_string(kind):
        return column.cast(pa.string())
    if pa.types.is_integer(kind) or name == "lane":
        return column.cast(pa.int32())
    n_decimals = TIME_DECIMALS if name == "t_s" else decimals
    rounded = np.round(column.cast(pa.float64()).to_numpy(), n_decimals)
    return pa.chunked_array([pa.array(rounded, from_pandas=True).cast(pa.decimal128(_PRECISION, n_decimals))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make a shipped file from the published table.")
    parser.add_argument("name", choices=SETS)
    parser.add_argument("source", type=Path, help="folder of the published table")
    parser.add_argument("target", type=Path, help="folder to write to")
    arguments = parser.parse_args()
    print(pack(arguments.name, arguments.source, arguments.target))
