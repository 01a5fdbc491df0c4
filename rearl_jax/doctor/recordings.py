"""Checks of the recordings: whether they are found, one of them can be read, and the shipped ones are there."""

import time

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import count_recordings, iterate_recordings
from rearl_jax.doctor.check import Check, fail, ok


def recording_checks(data: DataConfig) -> list[Check]:
    """One line: how many recordings there are, and whether the first one can be read."""
    name = f"data={data.format.name}"
    begin = time.perf_counter()
    try:
        n_recordings = count_recordings(data)
        first = next(iterate_recordings(data))
    except (OSError, ValueError) as error:
        remedy = "correct data.root and data.format; docs/reference/recordings.md describes the formats"
        return [fail("data", f"{name}: {error}", remedy)]
    vehicles, seconds = first.table["track_id"].nunique(), time.perf_counter() - begin
    recordings = f"{name}: {n_recordings} recordings; {first.info.id} has {vehicles} vehicles, read in {seconds:.1f} s"
    return [ok("data", recordings)]


def shipped_checks() -> list[Check]:
    """One line: the sets that come with the package, and how many recordings each has."""
    try:
        sets = [f"{kind.name} {count_recordings(DataConfig(kind))}" for kind in DataFormat if kind.shipped]
    except (OSError, ValueError) as error:
        return [fail("shipped", str(error), "install the package again")]
    return [ok("shipped", f"recordings by data=NAME: {', '.join(sets)}")]
