"""The benchmark in the terminal: a bar while it runs, then a table and what it does not show."""

import sys

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from rearl_jax.bench.results import BenchResults, Series
from rearl_jax.bench.sessions import C_ALL, OURS

_WIDTH = 112
"""Columns the table needs."""

_TITLES = {
    OURS: "rearl_jax",
    "c": "C, one thread",
    C_ALL: "C, all cores (elapsed)",
    "highway_env": "highway-env",
}


def progress_bar() -> Progress:
    """A progress bar on standard error; silent where that is no terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True)


def print_results(results: BenchResults) -> None:
    """Prints speeds and ratios, then compile times, memory, the machine, and what was absent."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)  # a file or a pipe has no width of its own
    table = Table(
        title="Agent-substeps (one vehicle, 1/15 s)", title_justify="left", title_style="bold", box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )  # fmt: skip
    table.add_column("N", justify="right")
    table.add_column("program", no_wrap=True)
    for heading in (
        "per CPU-s", "per s", "ours / it", "least-greatest", "scenarios x s", "changes/veh-min", "crashed", "m/s",
    ):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    for n_vehicles in results.numbers:
        items = [item for name in results.programs if (item := results.find(name, n_vehicles)) is not None]
        for item in items:
            first = str(n_vehicles) if item.program == OURS else ""
            table.add_row(first, *_cells(results, item), end_section=item is items[-1])
    console.print(table)
    for line in _notes(results):
        console.print(line, highlight=False, markup=False)


def _cells(results: BenchResults, item: Series) -> list[str]:
    ratio = None if item.program == OURS else results.ratio(item.program, item.n_vehicles)
    last, changes, crashed = item.measurements[-1], item.lane_changes_per_vehicle_min, item.crashed_share
    return [
        _TITLES.get(item.program, item.program),
        _short(item.substeps_per_cpu_s),
        _short(item.substeps_per_s),
        "" if ratio is None else f"{ratio.median:.3g}",
        "" if ratio is None else f"{ratio.least:.3g}-{ratio.greatest:.3g}",
        f"{last.n_scenarios} x {last.seconds}",
        "-" if changes is None else f"{changes:.3f}",
        "-" if crashed is None else f"{crashed:.2%}",
        f"{item.mean_speed:.1f}",
    ]


def _short(speed: float) -> str:
    return f"{speed / 1e6:.2f} M" if speed >= 1e5 else f"{speed / 1e3:.2f} k"


def _notes(results: BenchResults) -> list[str]:
    ours = [item for n in results.numbers if (item := results.find(OURS, n)) is not None]
    compiled = ", ".join(f"{item.facts['compile_s']:.1f} (N = {item.n_vehicles})" for item in ours)
    chunks = ", ".join(f"{item.facts['chunk']}" for item in ours)
    machine = results.machine
    lines = [
        "medians; ratios are taken within a repetition, per CPU-second, for C on all cores per elapsed second",
        "C has no collisions; SUMO steps 67 ms and changes lanes at once; ours includes drawing the scenes",
        f"compile time [s]: {compiled}; scenarios a core takes at a time: {chunks}",
    ]
    growth, peak = results.cost_growth(), results.peak_memory_gib()
    if growth is not None:
        numbers = results.numbers
        lines.append(f"cost of a vehicle step at N = {numbers[-1]}: {growth:.2f} x that at N = {numbers[0]}")
    if results.memory is not None and peak is not None:
        lines.append(
            f"{results.memory.n_scenarios:,} rollouts of {results.memory.seconds} s: {peak:.2f} GiB at the peak,"
            f" {results.memory.wall_s:.1f} s"
        )
    load = "" if results.load_average is None else f", load {results.load_average:.1f} at the start"
    lines.append(f"{machine['cpu_model']}, {machine['cpu_cores']} cores, jax {machine['jax_version']}{load}")
    lines += [f"absent: {item.program} ({item.reason}); {item.remedy}" for item in results.absent]
    return lines
