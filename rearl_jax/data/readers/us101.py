"""The shipped part of NGSIM US-101: vehicles that change lanes; CC BY-SA 4.0."""

from pathlib import Path

from rearl_jax.data.files.columnar import column_names, is_parquet
from rearl_jax.data.formats import ngsim
from rearl_jax.data.reader import Reader, parts_of
from rearl_jax.problems import MissingInputError, Problem

FILE = "us101_lane_changers.parquet"


def find_file(root: Path) -> Path:
    """The table: the one file that is named, or in the folder.

    Raises:
        FileNotFoundError: It is not there.
    """
    path = root / FILE if root.is_dir() else root
    if not path.is_file():
        message = "there is no such file: leave data.root empty for the shipped one"
        raise MissingInputError(Problem("file-missing", message, file=str(path)))
    return path


def recognises(path: Path) -> Path | None:
    """The file if it has the columns of the shipped one."""
    file = path / FILE if path.is_dir() else path
    is_one = file.is_file() and is_parquet(file) and set(ngsim.US101_COLUMNS) <= set(column_names(file))
    return file if is_one else None


READER = Reader(
    expected=f"the file {FILE} or its folder; leave it empty for the shipped one",
    entries=parts_of(find_file, ngsim.us101_recordings, ngsim.read_us101),
    files=lambda root: [find_file(root)],
    recognises=recognises,
    has_one_clock=True,
)
