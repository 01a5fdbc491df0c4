"""Speed and memory of the readers of recordings, each on one large file in its layout.

Every file is written anew and read in a process of its own, `python -m benchmarks.readers LAYOUT FOLDER`.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.layouts import LAYOUTS
from benchmarks.options import ReadersBenchmark
from benchmarks.terminal import print_table
from rearl_jax import runtime
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.machine import load_average
from rearl_jax.problems import out_of_range
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.timing.measurement import peak_memory_bytes
from rearl_jax.timing.process import fresh_environment

TABLE = "bench_readers"

MEANINGS = {
    "file_mb_{layout}": "size of the file [MB]",
    "rows_{layout}": "rows of the table that was read",
    "rows_per_s_{layout}": "rows read and checked per second of elapsed time [1/s]",
    "cpu_s_{layout}": "CPU time of reading over all threads [s]",
    "peak_memory_gib_{layout}": "peak resident memory of the process [GiB]",
    "start_memory_gib_{layout}": "the same before the file was opened [GiB]",
    "load_average": "processes that wanted to run when the measurements began",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


def run(config: ReadersBenchmark) -> dict:
    """The summary of the measurements, after writing table, configuration and summary.

    Raises:
        InvalidInputError: A layout is unknown.
        RuntimeError: A file was not read.
    """
    names = tuple(LAYOUTS) if config.readers.layouts is None else config.readers.layouts
    unknown = [name for name in names if name not in LAYOUTS]
    if unknown:
        raise out_of_range("readers.layouts", f"must be some of {', '.join(LAYOUTS)}", unknown[0])
    study = Study(config.results.root, config.study, config, "bench readers")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    load, rows = load_average(), []
    with progress_bar() as bar:
        show = shown(bar, "readers")
        for number, name in enumerate(names):
            show(number, len(names))
            rows.append(measure(name, config.readers.megabytes))
    machine = runtime.describe_machine()
    study.write_table(TABLE, pd.DataFrame(rows), machine=json.dumps(machine))
    figures = {f"{key}_{row['layout']}": value for row in rows for key, value in row.items() if key != "layout"}
    summary = {**machine, "load_average": load, **figures}
    study.write_summary(summary)
    print_table("Readers of recordings, one file each", rows, [runtime.machine_line(machine, load)])
    return summary


def measure(name: str, megabytes: float) -> dict[str, Any]:
    """One layout: `layout` and the figures of `MEANINGS`.

    Raises:
        RuntimeError: The file was not read.
    """
    with tempfile.TemporaryDirectory(prefix="rearl_readers_") as folder:
        LAYOUTS[name].write(Path(folder), round(1e6 * megabytes))
        size = max(file.stat().st_size for file in Path(folder).iterdir())
        command = [sys.executable, "-m", "benchmarks.readers", name, folder]
        done = subprocess.run(command, capture_output=True, text=True, env=fresh_environment(on_cpu=True))
        if done.returncode:
            last_lines = "\n".join(done.stderr.splitlines()[-20:])
            raise RuntimeError(f"{' '.join(command)} ended with code {done.returncode}. Its last words:\n{last_lines}")
    return {"layout": name, "file_mb": size / 1e6, **json.loads(done.stdout.splitlines()[-1])}


def read(name: str, folder: Path) -> dict[str, Any]:
    """Cost of reading the recordings in a folder: the figures of `MEANINGS` except the size of the file.

    Raises:
        BadRecordingError: A recording is invalid.
    """
    layout = LAYOUTS[name]
    data = DataConfig(DataFormat[layout.format], str(folder), stretch=layout.stretch)
    start_bytes, cpu_begin, begin = peak_memory_bytes(), sum(os.times()[:2]), time.perf_counter()
    rows = sum(len(recording.table) for recording in iterate_recordings(data))
    wall_s, cpu_s = time.perf_counter() - begin, sum(os.times()[:2]) - cpu_begin
    peak, start = (None if value is None else value / 2**30 for value in (peak_memory_bytes(), start_bytes))
    rates = {"rows": rows, "rows_per_s": rows / wall_s, "cpu_s": cpu_s}
    return {**rates, "peak_memory_gib": peak, "start_memory_gib": start}


def main(arguments: Sequence[str]) -> int:
    """Exit code 0; the last line on standard output is the cost in JSON."""
    print(json.dumps(read(arguments[0], Path(arguments[1]))))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
