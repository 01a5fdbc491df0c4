"""NGSIM tables as published, in feet, `.csv` or `.txt`; portal copies hold many rows twice."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.formats import ngsim_published
from rearl_jax.data.reader import Entry, Reader
from rearl_jax.problems import MissingInputError, Problem


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The highway recordings of all files.

    Raises:
        MissingInputError: All files hold arterials only.
    """
    any_recording, passed_over = False, dict[str, None]()
    paths = ngsim_published.find_published(root)
    for path in paths:
        file = ngsim_published.PublishedFile(path, data)
        for name in file.recordings():
            any_recording = True
            yield Entry(name, partial(file.read, name), file=path)
        passed_over |= dict.fromkeys(file.passed_over)
    if not any_recording:
        names = ", ".join(path.name for path in paths)
        message = f"{names}: only {' and '.join(passed_over)}, which is not a highway and is passed over"
        remedy = "name a folder with recordings of US-101 or I-80"
        raise MissingInputError(Problem("arterials-only", message, remedy, file=str(root)))


READER = Reader(
    expected="the folder of the NGSIM tables (.csv or .txt)",
    entries=entries,
    files=ngsim_published.find_published,
    recognises=ngsim_published.recognises,
    has_one_clock=True,
)
