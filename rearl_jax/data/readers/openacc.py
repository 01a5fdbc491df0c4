"""Platoons of OpenACC: one Parquet file, as shipped for ZalaZone, or the published runs of any campaign, `.csv`."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data import openacc, openacc_index, openacc_raw
from rearl_jax.data.folder import visible_files
from rearl_jax.data.reader import Entry, Reader, by_columns, parts_of

_condensed = parts_of(openacc.find_platoons, openacc.platoon_recordings, openacc.read_platoon)
_is_condensed_file = by_columns(openacc.COLUMNS)


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The parts of the Parquet file if there is one, else those of the published runs."""
    if _is_condensed(root):
        yield from _condensed(data, root)
        return
    for path in openacc_raw.find_runs(root):
        for name, platoon in openacc_raw.runs_of(path).items():
            yield Entry(name, partial(openacc_raw.read_run, path, name, platoon, data), file=path)


def files(root: Path) -> list[Path]:
    """The platoons, and the index of runs where there is one; or the published runs."""
    if not _is_condensed(root):
        return openacc_raw.find_runs(root)
    platoons, index = openacc.find_platoons(root), root / openacc_index.FILE
    return [platoons, index] if index.is_file() else [platoons]


def _is_condensed(root: Path) -> bool:
    return bool(visible_files(root, (".parquet",)))


READER = Reader(
    expected="the folder of one Parquet file of OpenACC platoons, or of the published runs (.csv); leave it empty for "
    "the shipped ones",
    entries=entries,
    files=files,
    recognises=by_columns(openacc.COLUMNS),
    same=openacc.MODEL,
)
