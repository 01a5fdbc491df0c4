"""Progress of a stream of rollouts, part by part: speed, and memory of the process.

Written after every part, so that an interrupted study keeps its measurements; every run of the task is a session.
"""

import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from rich.progress import Progress

from rearl_jax.progress import in_words
from rearl_jax.results import Study
from rearl_jax.timing.measurement import peak_memory_bytes

PROGRESS = "progress"
"""Name of the table."""

_COLUMNS = ("session", "part", "rollouts", "seconds", "cpu_s", "peak_mib", "resident_mib")

_MIB = 2**20


class StreamLog:
    """Rollouts simulated since the log was opened, and rollouts of earlier runs in the table.

    Attributes:
        n_before: Rollouts on disk when the log was opened.
        n_simulated: Rollouts simulated since the log was opened.
        wall_s: Time from the opening of the log to the end of the last part [s].
        cpu_s: CPU time of all threads of the process over the same time [s].
    """

    def __init__(self, study: Study, n_before: int, metadata: dict[str, str]) -> None:
        """Starts the clocks; `n_before` rollouts are on disk already, the metadata go into the table's schema."""
        self._study, self._metadata = study, metadata
        self._earlier = pd.read_parquet(study.path / f"{PROGRESS}.parquet") if study.owns(PROGRESS) else None
        self._session = 0 if self._earlier is None else self._earlier["session"].to_numpy().max().item() + 1
        self._rows: list[tuple] = []
        self._begin = time.perf_counter(), time.process_time()
        self.n_before, self.n_simulated, self.wall_s, self.cpu_s = n_before, 0, 0.0, 0.0

    def add(self, number: int, n_rollouts: int) -> None:
        """Records that a part has been written."""
        self.n_simulated += n_rollouts
        self.wall_s = time.perf_counter() - self._begin[0]
        self.cpu_s = time.process_time() - self._begin[1]
        memory = _mib(peak_memory_bytes()), _mib(resident_bytes())
        on_disk = self.n_before + self.n_simulated
        self._rows.append((self._session, number, on_disk, self.wall_s, self.cpu_s, *memory))
        self._study.write_table(PROGRESS, self.table(), **self._metadata)

    def table(self) -> pd.DataFrame:
        """One row per part simulated, in the order of time.

        Columns: `session`, `part`, `rollouts` (on disk by then), `seconds` and `cpu_s` (since the session's stream
            began), `peak_mib` (largest resident memory of the process so far), `resident_mib` (present resident
            memory).
        """
        parts = [part for part in (self._earlier, self.this_session()) if part is not None and len(part)]
        return pd.concat(parts, ignore_index=True) if parts else self.this_session()

    def this_session(self) -> pd.DataFrame:
        """The rows of the parts simulated since the log was opened."""
        return pd.DataFrame(self._rows, columns=list(_COLUMNS))


def shown_with_rate(bar: Progress, title: str, before: list[slice]) -> Callable[[int, int], None]:
    """A line of the bar with rollouts per second and the time left, as a function of the rollouts done and their total.

    Args:
        bar: The bar.
        title: Beginning of the line.
        before: Parts that were on disk already; they do not count for the rate.
    """
    line = bar.add_task(title, total=None)
    begin = time.perf_counter()

    def advance(done: int, total: int) -> None:
        simulated = done - sum(part.stop - part.start for part in before if part.stop <= done)
        left = total - sum(part.stop - part.start for part in before) - simulated
        text = title
        if simulated:
            rate = simulated / (time.perf_counter() - begin)
            text += f", {rate:,.0f}/s, {in_words(left / rate)} left"
        bar.update(line, description=text, completed=done, total=total)

    return advance


def resident_bytes() -> int | None:
    """Present resident memory of this process [bytes]; None if the system does not report it."""
    if sys.platform != "linux":
        return None
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _mib(n_bytes: int | None) -> float:
    return math.nan if n_bytes is None else n_bytes / _MIB
