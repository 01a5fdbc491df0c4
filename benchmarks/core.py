"""Speed of the traffic core ("ours"), compared with that of other programs that are measured in turn with it.

For every number of vehicles the programs are measured several times, in turn. Ratios of speeds are taken within a
repetition; the result is their median over repetitions. Then the core alone is measured at several numbers of scenarios
per pass and of cores, and its peak memory.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace

from benchmarks.core_results import Agreement, Change, CoreResults, read_ratios
from benchmarks.figure import draw_costs
from benchmarks.options import CoreBenchmark, CoreOptions
from benchmarks.programs import GPU, OURS, TITLES, Absent, Session, open_programs, start_ours
from benchmarks.terminal import print_table
from rearl_jax import runtime
from rearl_jax.machine import load_average
from rearl_jax.problems import InvalidInputError, Problem, out_of_range
from rearl_jax.results import Study
from rearl_jax.runtime import machine_line
from rearl_jax.timing.measurement import Measurement, Series
from rearl_jax.timing.turns import Report, reporting, take_turns, warm_up


def run(config: CoreBenchmark) -> dict:
    """The summary of the measurements, after writing table, summary, configuration and figure.

    Raises:
        MissingInputError, InvalidInputError: The earlier benchmark cannot be compared with; if that shows only after
            the measurements, because the reference program is absent, they are written.
    """
    bench = config.bench
    earlier = {} if bench.against is None else read_ratios(bench.against, bench.reference)
    if earlier and not set(earlier) & set(bench.vehicles):
        fault = f"must name one of the numbers of bench.against, {sorted(earlier)}"
        raise out_of_range("bench.vehicles", fault, list(bench.vehicles))
    study = Study(config.results.root, config.study, config, "bench core")
    study.write_config()
    results = measure(bench)
    changes = (
        Change(n, then, now, bench.margin)
        for n, then in sorted(earlier.items())
        if (now := results.ratio(bench.reference.name, n)) is not None
    )
    results = replace(results, changes=tuple(changes))
    study.write_table("bench_core", results.table(), **results.metadata())
    study.write_bytes("cost.png", draw_costs(results))
    summary = results.summary()
    study.write_summary(summary)
    show(results)
    if earlier and not results.changes:
        fault = f"was not measured, so nothing is compared with {bench.against}"
        remedy = next((item.remedy for item in results.absent if item.program == bench.reference.name), "")
        problem = Problem("reference-absent", fault, remedy, key="bench.reference", value=bench.reference.name)
        raise InvalidInputError(problem)
    return summary


def measure(bench: CoreOptions) -> CoreResults:
    """All measurements."""
    load = load_average()
    threads = numbers_of_threads(bench)
    series: list[Series] = []
    agreements: list[Agreement] = []
    absent: dict[str, Absent] = {}
    memory: Measurement | None = None
    rounds = bench.repetitions + 1
    n_steps = (len(bench.vehicles) * len(TITLES) + len(bench.chunks) + len(threads)) * rounds
    with reporting(n_steps) as report:
        for n_vehicles in bench.vehicles:
            report(f"N = {n_vehicles}: compiling", 0)
            with open_programs(n_vehicles, bench) as (sessions, missing):
                absent |= {item.program: item for item in missing}
                series += measure_in_turn(sessions, n_vehicles, bench, report)
                if GPU in sessions:
                    agreements.append(compare_scenes(sessions, n_vehicles, bench))
            report(f"N = {n_vehicles}: absent programs", (len(TITLES) - len(sessions)) * rounds)
        by_chunk = measure_alone(bench, "chunk", bench.chunks, lambda n: {"chunk": n, "threads": 1}, report)
        by_threads = measure_alone(bench, "cores", threads, lambda n: {"threads": n}, report)
        if bench.memory_rollouts:
            report(f"peak memory of {bench.memory_rollouts:,} rollouts", 0)
            memory = measure_memory(bench)
    conditions = memory, load, runtime.describe_machine()
    return CoreResults(tuple(series), tuple(absent.values()), *conditions, by_chunk, by_threads, tuple(agreements))


def numbers_of_threads(bench: CoreOptions) -> tuple[int, ...]:
    """Numbers of cores to be measured: `bench.threads`, or 1, 2, 4 and so on up to all cores."""
    if bench.threads is not None:
        return bench.threads
    cores = runtime.available_cores()
    return (*(1 << power for power in range((cores - 1).bit_length())), cores)


def compare_scenes(sessions: Mapping[str, Session], n_vehicles: int, bench: CoreOptions) -> Agreement:
    """The same scenarios on CPU and GPU, as many as the GPU simulates at a time."""
    n_scenarios = int(sessions[GPU].facts["unit"])
    return Agreement(n_vehicles, *(sessions[name].measure(n_scenarios, bench.seed) for name in (OURS, GPU)))


def measure_alone(
    bench: CoreOptions, name: str, values: Sequence[int], setting: Callable[[int], dict[str, int]], report: Report
) -> tuple[Series, ...]:
    """Our core at several values of a setting, in turn; one series per value.

    `name` is the name of the setting in the progress bar, `setting` gives the arguments of `start_ours` for a value.
    """
    n_vehicles = bench.varied_vehicles
    label = f"{name}, N = {n_vehicles}"
    sessions: dict[str, Session] = {}
    with ExitStack() as stack:
        for value in values:
            report(f"{label}: {value}, compiling", 0)
            sessions[str(value)] = session = start_ours(n_vehicles, bench, **setting(value))
            stack.callback(session.close)
        measured = _fill_time(sessions, n_vehicles, bench, label, report)
    return tuple(replace(series, program=OURS) for series in measured.values())


def measure_in_turn(
    sessions: Mapping[str, Session], n_vehicles: int, bench: CoreOptions, report: Report
) -> list[Series]:
    """One series per program."""
    fixed = {} if bench.scenarios is None else {OURS: bench.scenarios[bench.vehicles.index(n_vehicles)]}
    return list(_fill_time(sessions, n_vehicles, bench, f"N = {n_vehicles}", report, fixed).values())


def _fill_time(
    sessions: Mapping[str, Session],
    n_vehicles: int,
    bench: CoreOptions,
    label: str,
    report: Report,
    fixed: Mapping[str, int] | None = None,
) -> dict[str, Series]:
    """Series of each program with `fixed` scenarios, or else with as many as fill `bench.repetition_cpu_s`."""
    n_scenarios = {}
    for name, first in warm_up(sessions, bench.seed, label, report).items():
        unit = int(sessions[name].facts["unit"])
        n_scenarios[name] = unit * max(1, round(bench.repetition_cpu_s / first.cpu_s))
    n_scenarios |= fixed or {}
    return take_turns(sessions, n_vehicles, n_scenarios, bench.repetitions, bench.seed, label, report)


def measure_memory(bench: CoreOptions) -> Measurement:
    """Our core simulating many rollouts in a fresh process, which keeps the frames of one chunk at a time."""
    session = start_ours(bench.memory_vehicles, bench)
    try:
        return session.measure(bench.memory_rollouts, bench.seed)
    finally:
        session.close()


def show(results: CoreResults) -> None:
    """Prints speeds and ratios, the change since the earlier benchmark, memory, the machine, and what was absent."""
    rows = [
        {
            "N": item.n_vehicles,
            "program": TITLES[item.program],
            "M/CPU-s": item.substeps_per_cpu_s / 1e6,
            "M/s": item.substeps_per_s / 1e6,
            "ours by it": None if item.program == OURS else results.ratio(item.program, item.n_vehicles),
            "changes/min": item.lane_changes_per_vehicle_min,
            "crashed": item.crashed_share,
            "m/s": item.mean_speed,
        }
        for item in results.series
    ]
    print_table("Millions of agent-substeps (one vehicle, 1/15 s)", rows)
    alone = [
        {"scenarios": item.facts["chunk"], "cores": item.facts["threads"], "M/CPU-s": item.substeps_per_cpu_s / 1e6}
        | {"M/s": item.substeps_per_s / 1e6}
        for item in (*results.by_chunk, *results.by_threads)
    ]
    print_table("Ours alone, by scenarios a core takes at a time and by cores", alone)
    changes = [
        {"N": change.n_vehicles, "then": change.then, "now": change.now, "now / then": change.factor}
        | {"": "SLOWER" if change.is_slower else "ok"}
        for change in results.changes
    ]
    print_table("Ratio to the reference program, beside the earlier benchmark", changes, _notes(results))


def _notes(results: CoreResults) -> list[str]:
    lines = [
        "Medians. Ratios: within a repetition, per CPU-second; for C on all cores and the GPU per elapsed second.",
        "Ours draws its scenes in the time; C has no collisions; SUMO steps 67 ms and changes lanes at once.",
        "HighJax leaves one vehicle to a policy, which here keeps lane and speed, and computes its observation.",
    ]
    lines += [f"{name}: {value:.3g}" for name, value in results.extra_figures().items() if value is not None]
    lines.append(machine_line(results.machine, results.load_average))
    return lines + [f"absent: {item.program} ({item.reason}); {item.remedy}" for item in results.absent]
