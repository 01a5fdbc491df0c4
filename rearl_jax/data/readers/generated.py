"""Recordings in the format of highD that `rearl prepare data=generated` writes; marked as generated everywhere."""

from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.formats.highd import find_recordings
from rearl_jax.data.reader import Reader
from rearl_jax.data.readers import highd


def is_generated(data: DataConfig, root: Path) -> bool:
    """True if there are recordings at all."""
    return bool(find_recordings(root))


READER = Reader(
    expected="the folder of generated recordings; `rearl prepare data=generated` writes them",
    entries=partial(highd.entries_of, generated=True),
    files=highd.files,
    generated=is_generated,
)
