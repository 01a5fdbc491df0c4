"""The benchmark in the terminal: a table and what it does not show."""

from rich.table import Table

from rearl_jax.bench.results import BenchResults, Series
from rearl_jax.bench.sessions import C_ALL, GPU, OURS
from rearl_jax.bench.spread import three
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line

_WIDTH = 110
"""Columns the whole table needs; a narrower terminal gets it without what happened in the traffic."""

_TITLES = {OURS: "rearl_jax", "c": "C, one thread", C_ALL: "C, all cores", "highway_env": "highway-env"}
_TITLES |= {"libsumo": "SUMO", "highjax": "HighJax", GPU: "rearl_jax, GPU"}

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
    for title, heading, setting, items, unit in (
        ("Ours on one core, by scenarios at a time", "scenarios", "chunk", results.by_chunk, "substeps_per_cpu_s"),
        ("Ours, by cores", "cores", "threads", results.by_threads, "substeps_per_s"),
    ):
        if items:
            console.print(_alone_table(title, heading, setting, items, unit))
    if results.changes:
        console.print(_changes_table(results))
    print_notes(console, _notes(results))


def _alone_table(title: str, heading: str, setting: str, items: tuple[Series, ...], unit: str) -> Table:
    """Our core at several values of a setting."""
    table = titled_table(f"{title}, N = {items[0].n_vehicles}")
    for name in (heading, "M/CPU-s" if unit == "substeps_per_cpu_s" else "M/s", "from", "to"):
        table.add_column(name, justify="right", no_wrap=True)
    for item in items:
        speeds = [getattr(run, unit) / 1e6 for run in item.measurements]
        cells = (f"{speed:#.4g}" for speed in (getattr(item, unit) / 1e6, min(speeds), max(speeds)))
        table.add_row(f"{item.facts[setting]:,}", *cells)
    return table


def _changes_table(results: BenchResults) -> Table:
    """The ratio to the reference program, then and now."""
    table = titled_table("Beside the earlier benchmark: our speed by the reference program's")
    for name in ("N", "then", "now", "now / then", "from", "to", ""):
        table.add_column(name, justify="right", no_wrap=True)
    for change in results.changes:
        factor = (f"{value:.2f}" for value in three(change.factor))
        verdict = "SLOWER" if change.is_slower else "ok"
        ratios = _ratio(change.then.median), _ratio(change.now.median)
        table.add_row(str(change.n_vehicles), *ratios, *factor, verdict)
    return table


def _speed_cells(results: BenchResults, item: Series) -> list[str]:
    speeds = [f"{item.substeps_per_cpu_s / 1e6:#.4g}", f"{item.substeps_per_s / 1e6:#.4g}"]
    ratio = None if item.program == OURS else results.ratio(item.program, item.n_vehicles)
    if ratio is None:
        return [*speeds, "", "", ""]
    return [*speeds, *(_ratio(value) for value in three(ratio))]


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
        "Medians. Ratios: within a repetition, per CPU-second; for C on all cores and the GPU per elapsed second.",
        "Changes of lane per vehicle and minute, vehicles crashed by the end, mean speed at the end.",
        "Ours draws its scenes in the time; C has no collisions; SUMO steps 67 ms and changes lanes at once.",
        "HighJax leaves one vehicle to a policy, which here keeps lane and speed, and computes its observation.",
        f"compile time by N: {compiled} s; scenarios a core takes at a time: {chunks}",
    ]
    growth, peak = results.cost_growth(), results.peak_memory_gib()
    if growth:
        times = ", ".join(f"{few}: {ratio:.2f}" for few, ratio in growth.items())
        lines.append(f"a vehicle step at N = {results.numbers[-1]} costs, times that at N = {times}")
    lines += _limit_lines(results)
    if results.memory is not None and peak is not None:
        run = results.memory
        lines.append(f"{run.n_scenarios:,} rollouts of {run.seconds} s: {peak:.2f} GiB, {run.wall_s:.1f} s")
    lines.append(machine_line(results.machine, results.load_average))
    for agreement in results.agreements:
        said = ", ".join(f"{name} {value:.2g}" for name, value in agreement.figures().items())
        lines.append(f"GPU and CPU on {agreement.cpu.n_scenarios:,} same scenes: {said}")
    if results.changes:
        margin = results.changes[0].margin
        lines.append(f"slower: more than {margin:.0%} of the ratio lost, and no repetition at the median of then")
    lines += [f"absent: {item.program} ({item.reason}); {item.remedy}" for item in results.absent]
    return lines


def _limit_lines(results: BenchResults) -> list[str]:
    """What the machine can do at best, and what that makes of a vehicle step."""
    lines = [
        f"this machine at best, {limit.threads} thread{'s' * (limit.threads > 1)}: {limit.bytes_per_s / 1e9:.1f} GB/s,"
        f" {limit.operations_per_s / 1e9:.0f} GFLOP/s"
        for limit in results.limits
    ]
    n_vehicles = results.numbers[-1]
    ours, limit = results.find(OURS, n_vehicles), results.limit_ns(n_vehicles)
    if ours is not None and limit is not None:
        lines += [
            f"a vehicle step at N = {n_vehicles} takes {1e9 / ours.substeps_per_cpu_s:.0f} ns of CPU time;",
            f"its state once through memory {limit[0]:.1f} ns, its least arithmetic at peak {limit[1]:.1f} ns",
        ]
    return lines
