"""Check of the recordings: they are found, and one of them is read."""

import time

from rearl_jax.config.data import DataConfig
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
    found = f"{name}: {n_recordings} recordings; {first.info.id} has {vehicles} vehicles, read in {seconds:.1f} s"
    return [ok("data", found)]
