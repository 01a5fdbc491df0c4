"""The benchmark in the terminal: a table and what it does not show."""

from rearl_jax.bench.results import BenchResults, Series
from rearl_jax.bench.sessions import C_ALL, OURS
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line

_WIDTH = 110
"""Columns the whole table needs; a narrower terminal gets it without what happened in the traffic."""

_TITLES = {OURS: "rearl_jax", "c": "C, one thread", C_ALL: "C, all cores", "highway_env": "highway-env"}

_SPEEDS = ("M/CPU-s", "M/s", "ours/it", "from", "to")
_TRAFFIC = ("scenarios", "s", "changes", "crashed", "m/s")


def print_results(results: BenchResults) -> None:
    """Prints speeds and ratios, then compile times, memory, the machine, and what was absent."""
    console = standard_output(_WIDTH)
    has_room = console.width >= _WIDTH
    table = titled_table("Millions of agent-substeps (one vehicle, 1/15 s)")
    table.add_column("N", justify="right", no_wrap=True)
    table.add_column("program", no_wrap=True)
    for heading in _SPEEDS + (_TRAFFIC if has_room else ()):
        table.add_column(heading, justify="right", no_wrap=True)
    for n_vehicles in results.numbers:
        items = [item for name in results.programs if (item := results.find(name, n_vehicles)) is not None]
        for item in items:
            first = str(n_vehicles) if item.program == OURS else ""
            cells = _speed_cells(results, item) + (_traffic_cells(item) if has_room else [])
            title = _TITLES.get(item.program, item.program)
            table.add_row(first, title, *cells, end_section=item is items[-1])
    console.print(table)
    print_notes(console, _notes(results))


def _speed_cells(results: BenchResults, item: Series) -> list[str]:
    speeds = [f"{item.substeps_per_cpu_s / 1e6:#.4g}", f"{item.substeps_per_s / 1e6:#.4g}"]
    ratio = None if item.program == OURS else results.ratio(item.program, item.n_vehicles)
    if ratio is None:
        return [*speeds, "", "", ""]
    return [*speeds, *(_ratio(value) for value in (ratio.median, ratio.least, ratio.greatest))]


def _ratio(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:#.3g}"


def _traffic_cells(item: Series) -> list[str]:
    last, changes, crashed = item.measurements[-1], item.lane_changes_per_vehicle_min, item.crashed_share
    return [
        f"{last.n_scenarios:,}",
        f"{last.seconds}",
        "-" if changes is None else f"{changes:.3f}",
        "-" if crashed is None else f"{crashed:.3%}",
        f"{item.mean_speed:.2f}",
    ]


def _notes(results: BenchResults) -> list[str]:
    ours = [item for n in results.numbers if (item := results.find(OURS, n)) is not None]
    compiled = ", ".join(f"{item.facts['compile_s']:.1f}" for item in ours)
    chunks = ", ".join(f"{item.facts['chunk']}" for item in ours)
    lines = [
        "Medians. Ratios: within a repetition, per CPU-second; for C on all cores per elapsed second.",
        "Changes of lane per vehicle and minute, vehicles crashed by the end, mean speed at the end.",
        "Ours draws its scenes in the time; C has no collisions; SUMO steps 67 ms and changes lanes at once.",
        f"compile time by N: {compiled} s; scenarios a core takes at a time: {chunks}",
    ]
    growth, peak = results.cost_growth(), results.peak_memory_gib()
    if growth is not None:
        few, many = results.numbers[0], results.numbers[-1]
        lines.append(f"a vehicle step at N = {many} costs {growth:.2f} times that at N = {few}")
    if results.memory is not None and peak is not None:
        run = results.memory
        lines.append(f"{run.n_scenarios:,} rollouts of {run.seconds} s: {peak:.2f} GiB, {run.wall_s:.1f} s")
    lines.append(machine_line(results.machine, results.load_average))
    lines += [f"absent: {item.program} ({item.reason}); {item.remedy}" for item in results.absent]
    return lines
