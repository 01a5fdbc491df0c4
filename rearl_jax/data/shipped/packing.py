"""The shipped leader-follower recordings, made from the published tables.

    python -m rearl_jax.data.shipped.packing i80 FOLDER_OF_THE_SOURCE FOLDER_TO_WRITE

with `i80`, `i80_slice`, `i80_lateral`, `openacc` or `fhwa`. Rows are chosen as `SETS` says, numbers are rounded to a
fixed count of decimals and stored as decimal numbers, differences from row to row, compressed with zstd, because these
files take less than the same numbers in 32-bit floating point.
"""

import argparse
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.data.files.folder import only_parquet

TIME_DECIMALS = 1
_PRECISION = 9  # digits of a decimal number, the most that four bytes hold


@dataclass(frozen=True)
class Packed:
    """Selection from a published table.

    Attributes:
        file: Name of the shipped file.
        columns: Columns, in order; those that identify a track come first, then the time.
        tracks: Number of columns that identify a track.
        decimals: Decimals of measured numbers [m], [m/s], [m/s^2]: millimetres where the source has more than any
            camera or receiver resolves, the source's own where it has fewer.
        chosen: Column of text, and what it must match in the rows that are taken; None for all rows.
        shortest: Least number of rows of a track that is taken.
        beside: File of the source that is copied, with the rows of the chosen runs; None for none.
    """

    file: str
    columns: str
    tracks: int
    decimals: int
    chosen: tuple[str, str] | None = None
    shortest: int = 0
    beside: str | None = None


_I80 = Packed(
    "i80_pairs.parquet",
    "run follower leader t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2 leader_length_m lane",
    tracks=3,
    decimals=3,
)

SETS = {
    "i80": _I80,
    # One recording, pairs of 60 s or more: few enough for a verdict in a minute or two.
    "i80_slice": replace(_I80, file="i80_slice_pairs.parquet", chosen=("run", "^0500"), shortest=600),
    "i80_lateral": Packed(
        "i80_lateral_pairs.parquet",
        "follower leader frame lane x_f_m y_f_m v_f_mps a_f_mps2 length_f_m width_f_m class_f y_l_m v_l_mps a_l_mps2 "
        "leader_length_m leader_width_m class_l",
        tracks=2,
        decimals=2,
    ),
    "openacc": Packed(
        "zalazone_platoons.parquet",
        "file pos t_s speed_mps gap_to_follower_m model",
        tracks=2,
        decimals=3,
        # Runs on the dynamic platform, clean following under adaptive cruise control, and all runs of people.
        chosen=("file", "__dynamic_|^no_ACC__"),
        beside="zalazone_index.csv",
    ),
    "fhwa": Packed(
        "fhwa_pairs.parquet",
        "recording group follower_id leader_id pair t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2",
        tracks=5,
        decimals=3,
    ),
}
"""By name of the format."""


def pack(name: str, source: Path, target: Path) -> Path:
    """The shipped file of a format, written to a folder.

    Args:
        name: A key of `SETS`.
        source: Folder of the published table, one Parquet file.
        target: Folder to write to.
    """
    what = SETS[name]
    columns = what.columns.split()
    table = pq.read_table(only_parquet(source, f"the folder of the published table of {name}"))
    if what.chosen is not None:
        column, pattern = what.chosen
        table = table.filter(pa.array([bool(re.search(pattern, text)) for text in table[column].to_pylist()]))
    table = pa.table({column: _packed(table[column], column, what.decimals) for column in columns})
    if what.shortest:
        tracks = columns[: what.tracks]
        long = table.group_by(tracks).aggregate([([], "count_all")])
        long = long.filter(np.asarray(long["count_all"]) >= what.shortest).select(tracks)
        table = table.join(long, tracks, join_type="left semi")
    table = table.sort_by([(column, "ascending") for column in columns[: what.tracks + 1]])
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    path = target / what.file
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=19,
        use_dictionary=texts,  # type: ignore[arg-type]
        column_encoding={column: "DELTA_BINARY_PACKED" for column in columns if column not in texts},
        store_decimal_as_integer=True,
    )
    if what.beside is not None:
        runs = set(table["file"].to_pylist())
        head, *lines = (source / what.beside).read_text(encoding="utf-8").splitlines()
        kept = [line for line in lines if line.partition(".csv")[0] in runs]
        (target / what.beside).write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")
    return path


def _packed(column: pa.ChunkedArray, name: str, decimals: int) -> pa.ChunkedArray:
    """Texts as texts, whole numbers in four bytes, others rounded."""
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return column.cast(pa.string())
    if pa.types.is_integer(kind) or name == "lane":
        return column.cast(pa.int32())
    places = TIME_DECIMALS if name == "t_s" else decimals
    rounded = np.round(column.cast(pa.float64()).to_numpy(), places)
    return pa.chunked_array([pa.array(rounded, from_pandas=True).cast(pa.decimal128(_PRECISION, places))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make a shipped file from the published table.")
    parser.add_argument("name", choices=SETS)
    parser.add_argument("source", type=Path, help="folder of the published table")
    parser.add_argument("target", type=Path, help="folder to write to")
    words = parser.parse_args()
    print(pack(words.name, words.source, words.target))
