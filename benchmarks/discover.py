"""Cost of discovery by number of drivers and recorded time.

Every size is measured in a process of its own, `python -m benchmarks.discover KEY=VALUE ...`, which carries out `rearl
discover` with empty caches on recordings generated for it. The sizes measured before an interruption are kept: the same
command continues after them.
"""

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.options import DiscoverBenchmark, DiscoverOptions
from benchmarks.terminal import print_table
from rearl_jax import runtime
from rearl_jax.blind.traffic.dataset import write_dataset
from rearl_jax.blind.traffic.scenario import Planted, Scenario
from rearl_jax.cli.command_line import main as rearl
from rearl_jax.machine import load_average
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study, part_name
from rearl_jax.timing.measurement import peak_memory_bytes
from rearl_jax.timing.process import fresh_environment

TABLE = "bench_discover"

HIDDEN = "reaction_delay"
"""Effect that is hidden in the recordings."""

SPARE = 6
"""Vehicles per recording in addition to the wanted drivers, because the first of each lane follows nobody and some
follow too briefly.
"""

MEANINGS = {
    "wall_s_d{D}_s{S}": "elapsed time of the whole command with D drivers and S recorded seconds [s]",
    "cpu_s_d{D}_s{S}": "its CPU time over all threads [s]",
    "peak_memory_gib_d{D}_s{S}": "peak resident memory [GiB]",
    "n_drivers_d{D}_s{S}": "drivers that discovery used: those of the fit, of the choice of effects and of the report",
    "load_average": "processes that wanted to run when the measurements began",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


def run(config: DiscoverBenchmark) -> dict:
    """The summary of the measurements, after writing table, configuration and summary.

    Raises:
        RuntimeError: A measured command failed.
    """
    sizes = list(product(config.discover.drivers, config.discover.seconds))
    study = Study(config.results.root, config.study, config, "bench discover")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    load, kept = load_average(), study.finished_parts(TABLE)
    with progress_bar() as bar:
        show = shown(bar, "discovery")
        for number, (drivers, seconds) in enumerate(sizes):
            show(number, len(sizes))
            if number not in kept:
                row = measure(config.discover, drivers, seconds)
                study.write_table(part_name(TABLE, number), pd.DataFrame([row]))
    parts = [pd.read_parquet(study.path / f"{part_name(TABLE, number)}.parquet") for number in range(len(sizes))]
    table, machine = pd.concat(parts, ignore_index=True), runtime.describe_machine()
    study.write_table(TABLE, table, machine=json.dumps(machine))
    rows: list[dict[str, Any]] = table.to_dict("records")  # type: ignore[assignment]  # its keys are names
    figures = {
        f"{name}_d{row['drivers']}_s{row['seconds']}": row[name]
        for row in rows
        for name in ("wall_s", "cpu_s", "peak_memory_gib", "n_drivers")
    }
    summary = {**machine, "load_average": load, **figures}
    study.write_summary(summary)
    # Removed, so that the next call without results.resume=true measures every size again.
    shutil.rmtree(study.path / TABLE)
    print_table("Discovery with empty caches", rows, [runtime.machine_line(machine, load)])
    return summary


def measure(options: DiscoverOptions, drivers: int, seconds: int) -> dict[str, Any]:
    """One command: `drivers`, `seconds` [s], `n_drivers`, `wall_s` [s], `cpu_s` [s], `peak_memory_gib` [GiB].

    Raises:
        RuntimeError: The command failed.
    """
    with tempfile.TemporaryDirectory(prefix="rearl_discover_") as name:
        folder = Path(name)
        write_dataset(folder / "data", scenario_of(options, drivers, seconds))
        keys = ["data=table", f"data.root={folder / 'data'}", f"results.root={folder}", "study=found"]
        keys += [f"discover.max_drivers={drivers}", f"discover.seed={options.seed}"]
        command = [sys.executable, "-m", "benchmarks.discover", *keys, f"discover.replicates={options.replicates}"]
        environment = fresh_environment(on_cpu=False) | {"XDG_CACHE_HOME": str(folder / "cache")}
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        wall_s = time.perf_counter() - begin
        if done.returncode:
            last_lines = "\n".join(done.stderr.splitlines()[-20:])
            raise RuntimeError(f"{' '.join(command)} ended with code {done.returncode}. Its last words:\n{last_lines}")
        verdict = json.loads((folder / "found" / "verdict.json").read_text(encoding="utf-8"))
        n_drivers = sum(verdict["data"]["drivers"].values())
        cost = json.loads(done.stdout.splitlines()[-1])
    return {"drivers": drivers, "seconds": seconds, "n_drivers": n_drivers, "wall_s": wall_s, **cost}


def scenario_of(options: DiscoverOptions, drivers: int, seconds: int) -> Scenario:
    """Recordings of `seconds` [s] in which at least `drivers` drivers follow a leader."""
    lanes, recordings = Scenario.n_lanes, Scenario.n_recordings
    per_lane = math.ceil((math.ceil(drivers / recordings) + SPARE) / lanes)
    planted = (Planted(HIDDEN),)
    return Scenario(options.seed, planted, n_vehicles=per_lane * lanes, duration=float(seconds), lane_changes=0)


def main(words: Sequence[str]) -> int:
    """Exit code of `rearl discover`; its last line on standard output is its cost in JSON."""
    code = rearl(["discover", *words])
    peak = peak_memory_bytes()
    # User and system time of this process and of its ended child processes.
    cost = {"cpu_s": sum(os.times()[:4]), "peak_memory_gib": None if peak is None else peak / 2**30}
    print(json.dumps(cost))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
