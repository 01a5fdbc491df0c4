"""Platoons of OpenACC, campaign ZalaZone, one Parquet file."""

from pathlib import Path

from rearl_jax.data import openacc, openacc_index
from rearl_jax.data.reader import Reader, by_columns, parts_of


def files(root: Path) -> list[Path]:
    """The platoons, and the index of runs where there is one."""
    platoons, index = openacc.find_platoons(root), root / openacc_index.FILE
    return [platoons, index] if index.is_file() else [platoons]


READER = Reader(
    expected="the folder of the Parquet file of OpenACC platoons; leave it empty for the shipped one",
    entries=parts_of(openacc.find_platoons, openacc.platoon_recordings, openacc.read_platoon),
    files=files,
    recognises=by_columns(openacc.COLUMNS),
    same=openacc.MODEL,
)
