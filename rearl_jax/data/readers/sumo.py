"""SUMO's floating car data, `.xml`, `.csv` or `.parquet`: the road that most vehicles follow."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.formats import sumo
from rearl_jax.data.formats.simulated import is_generated
from rearl_jax.data.formats.sumo_fcd import is_fcd
from rearl_jax.data.reader import Entry, Reader, by_first_file


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """One recording per file."""
    beside = sumo.files_beside(root)
    for path in sumo.find_fcd(root):
        yield Entry(sumo.recording_id(path), partial(sumo.read_recording, path, beside, data), file=path)


def files(root: Path) -> list[Path]:
    """The floating car data, and the networks and types beside them."""
    return [*sumo.find_fcd(root), *sumo.files_beside(root)]


READER = Reader(
    expected="a file of `sumo --fcd-output` or a folder of them, with the route and network files beside it",
    entries=entries,
    files=files,
    generated=is_generated,
    recognises=by_first_file(sumo.find_fcd, is_fcd),
    has_one_clock=True,
)
