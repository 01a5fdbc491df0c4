"""The shipped leader-follower recordings, made from the published tables.

    python -m rearl_jax.data.shipped.packing i80 FOLDER_OF_THE_SOURCE FOLDER_TO_WRITE

with `i80`, `i80_lateral`, `openacc` or `fhwa`. Rows are chosen as `SETS` says, numbers are rounded to a fixed count of
decimals and stored as decimal numbers, differences from row to row, compressed with zstd. That is a third of the size
of the same numbers in 32-bit floating point.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from rearl_jax.data.problems import only_parquet

TIME_DECIMALS = 1
_PRECISION = 9  # digits of a decimal number, the most that four bytes hold


@dataclass(frozen=True)
class Packed:
    """What is taken from a published table.

    Attributes:
        file: Name of the shipped file.
        columns: Columns, in order; those that tell one track from another come first, then the time.
        tracks: Number of columns that tell one track from another.
        decimals: Decimals of measured numbers [m], [m/s], [m/s^2]: millimetres where the source has more than any
            camera or receiver resolves, the source's own where it has fewer.
        chosen: Mask of the rows that are taken; None for all.
        beside: Files of the source that are copied, with the rows of the chosen runs.
    """

    file: str
    columns: str
    tracks: int
    decimals: int
    chosen: Callable[[pa.Table], pa.ChunkedArray] | None = None
    beside: str | None = None


def _dynamic_and_people(table: pa.Table) -> pa.ChunkedArray:
    """Runs on the dynamic platform, clean following under adaptive cruise control, and all runs of people."""
    return pc.match_substring_regex(table["file"].cast(pa.string()), "__dynamic_|^no_ACC__")


SETS = {
    "i80": Packed(
        "i80_pairs.parquet",
        "run follower leader t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2 leader_length_m lane",
        tracks=3,
        decimals=3,
    ),
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
        chosen=_dynamic_and_people,
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
        table = table.filter(what.chosen(table))
    table = pa.table({column: _packed(table[column], column, what.decimals) for column in columns})
    table = table.sort_by([(column, "ascending") for column in columns[: what.tracks + 1]])
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    path = target / what.file
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=19,
        use_dictionary=texts,
        column_encoding={column: "DELTA_BINARY_PACKED" for column in columns if column not in texts},
        store_decimal_as_integer=True,
    )
    if what.beside is not None:
        runs = set(pc.unique(table["file"]).to_pylist())
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
    return pc.round(column.cast(pa.float64()), places).cast(pa.decimal128(_PRECISION, places))


if __name__ == "__main__":
    print(pack(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])))
