"""Platoons of OpenACC: one Parquet file, as shipped for ZalaZone, or the published runs of any campaign, `.csv`."""

from collections.abc import Iterator
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.files.folder import visible_files
from rearl_jax.data.formats import openacc, openacc_raw
from rearl_jax.data.formats.openacc_labels import INDEX_FILE
from rearl_jax.data.reader import Entry, Reader, by_columns, by_first_file, parts_of, parts_of_files

_condensed = parts_of(openacc.find_platoons, openacc.platoon_recordings, openacc.read_platoon)
_published = parts_of_files(openacc_raw.find_runs, lambda path, _: openacc_raw.runs_of(path), openacc_raw.read_run)
_recognises_condensed = by_columns(openacc.COLUMNS)
_recognises_runs = by_first_file(openacc_raw.find_runs, openacc_raw.is_run)


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The parts of the Parquet file if there is one, else those of the published runs."""
    return (_condensed if _is_condensed(root) else _published)(data, root)


def files(root: Path) -> list[Path]:
    """The platoons, and the index of runs where there is one; or the published runs."""
    if not _is_condensed(root):
        return openacc_raw.find_runs(root)
    platoons, index = openacc.find_platoons(root), root / INDEX_FILE
    return [platoons, index] if index.is_file() else [platoons]


def recognises(path: Path) -> Path | None:
    """The folder of the Parquet file, or the file or folder of published runs."""
    return _recognises_condensed(path) or _recognises_runs(path)


def _is_condensed(root: Path) -> bool:
    return bool(visible_files(root, (".parquet",)))


READER = Reader(
    expected="the folder of one Parquet file of OpenACC platoons, or of the published runs (.csv); leave it empty for "
    "the shipped ones",
    entries=entries,
    files=files,
    recognises=recognises,
    same=openacc.MODEL,
)
