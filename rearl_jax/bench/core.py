"""`rearl bench core`: speed of the traffic core and, in turn with it, of other programs.

Every number of vehicles is measured several times. Within a repetition the programs run one after the other,
in the reverse order the next time, so that other load on the machine meets all alike; a ratio is taken within
a repetition, and the median over repetitions is the result. Then our core alone, by scenarios at a time and by cores;
what the machine can do at best; and, where an earlier benchmark is named, what has changed since.
"""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from rearl_jax import runtime
from rearl_jax.bench.earlier import Change, read_ratios
from rearl_jax.bench.figure import draw_costs
from rearl_jax.bench.measurement import Measurement
from rearl_jax.bench.native import CompilerError, MachineLimits, measure_limits
from rearl_jax.bench.results import Agreement, BenchResults, Series
from rearl_jax.bench.rollouts import least_work
from rearl_jax.bench.sessions import GPU, OURS, REMEDIES, Absent, Session, open_sessions, start_ours
from rearl_jax.bench.terminal import print_results
from rearl_jax.bench.turns import Report, take_turns, warm_up
from rearl_jax.config import BenchCoreTask
from rearl_jax.config.bench import BenchConfig, Peer
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study

N_PROGRAMS = 7
"""Programs at most: ours, on a GPU, the C program on one and on all cores, highway-env, SUMO, HighJax."""


def run(config: BenchCoreTask) -> dict:
    """The summary of the measurements, after writing table, summary, configuration and figure.

    Raises:
        FileNotFoundError, ValueError: The earlier benchmark cannot be compared with.
    """
    bench = config.bench
    earlier = {} if bench.against is None else read_ratios(bench.against, bench.reference)
    if earlier and not set(earlier) & set(bench.vehicles):
        raise ValueError(
            f"bench.against has been measured with {sorted(earlier)} vehicles, bench.vehicles names none of these:"
            f" {list(bench.vehicles)}"
        )
    study = Study(config.results.root, config.study, config, "bench core")
    study.write_config()
    results = _measured(bench)
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
    print_results(results)
    return summary


def _measured(bench: BenchConfig) -> BenchResults:
    load = runtime.load_average()
    threads = numbers_of_threads(bench)
    steps_per_number = N_PROGRAMS * (bench.repetitions + 1)
    n_alone = (len(bench.chunks) + len(threads)) * (bench.repetitions + 1)
    series: list[Series] = []
    agreements: list[Agreement] = []
    absent: dict[str, Absent] = {}
    memory: Measurement | None = None
    with progress_bar() as progress:
        total = len(bench.vehicles) * steps_per_number + n_alone + 1 + (bench.memory_rollouts > 0)
        bar = progress.add_task("starting", total=total)

        def report(doing: str, advance: int = 0) -> None:
            progress.update(bar, description=doing, advance=advance)

        report("what the machine can do at best")
        limits, missing = limits_of_machine()
        absent |= {item.program: item for item in missing}
        report("N: compiling", 1)
        for position, n_vehicles in enumerate(bench.vehicles):
            report(f"N = {n_vehicles}: compiling")
            with open_sessions(n_vehicles, bench) as (sessions, missing):
                absent |= {item.program: item for item in missing}
                series += measure_in_turn(sessions, n_vehicles, bench, report)
                if GPU in sessions:
                    agreements.append(compare_scenes(sessions, n_vehicles, bench))
            progress.update(bar, completed=(position + 1) * steps_per_number + 1)
        by_chunk = measure_alone(bench, "chunk", bench.chunks, lambda n: {"chunk": n, "threads": 1}, report)
        by_threads = measure_alone(bench, "cores", threads, lambda n: {"threads": n}, report)
        if bench.memory_rollouts:
            report(f"peak memory of {bench.memory_rollouts:,} rollouts")
            memory = measure_memory(bench)
            report("done", 1)
    work = {n: least_work(n) for n in bench.vehicles}
    found = tuple(series), tuple(absent.values()), memory, load, runtime.describe_machine()
    return BenchResults(*found, by_chunk, by_threads, limits, work, tuple(agreements))


def numbers_of_threads(bench: BenchConfig) -> tuple[int, ...]:
    """Cores, each number measured: those asked for, or 1, 2, 4 and so on to all there are."""
    if bench.threads is not None:
        return tuple(bench.threads)
    cores = runtime.available_cores()
    return (*(1 << power for power in range((cores - 1).bit_length())), cores)


def limits_of_machine() -> tuple[tuple[MachineLimits, ...], list[Absent]]:
    """What one core and all cores can do at best; nothing without a compiler, and why."""
    numbers = sorted({1, runtime.available_cores()})
    with tempfile.TemporaryDirectory(prefix="rearl_c_") as folder:
        try:
            return tuple(measure_limits(number, Path(folder)) for number in numbers), []
        except CompilerError as error:
            return (), [Absent("machine_limits", str(error), REMEDIES[Peer.c])]


def compare_scenes(sessions: dict[str, Session], n_vehicles: int, bench: BenchConfig) -> Agreement:
    """One GPU's worth of scenarios, on CPU and GPU."""
    n_scenarios = int(sessions[GPU].facts["unit"])
    return Agreement(n_vehicles, *(sessions[name].measure(n_scenarios, bench.seed) for name in (OURS, GPU)))


def measure_alone(
    bench: BenchConfig, name: str, values: Sequence[int], setting: Callable[[int], dict[str, int]], report: Report
) -> tuple[Series, ...]:
    """Our core at several values of a setting, in turn; one series per value.

    Args:
        bench: The rest.
        name: Of the setting, as reported.
        values: That are measured.
        setting: What `start_ours` takes for a value.
        report: Told of every step.
    """
    label = f"{name}, N = {bench.varied_vehicles}"
    with ExitStack() as stack:
        sessions: dict[str, Session] = {}
        for value in values:
            report(f"{label}: {value}, compiling", 0)
            session = start_ours(bench.varied_vehicles, bench, **setting(value))
            stack.callback(session.close)
            sessions[str(value)] = session
        measured = _fill_time(sessions, bench, label, report)
    return tuple(
        Series(OURS, bench.varied_vehicles, measured[value], dict(session.facts)) for value, session in sessions.items()
    )


def measure_in_turn(
    sessions: dict[str, Session],
    n_vehicles: int,
    bench: BenchConfig,
    report: Report,
) -> list[Series]:
    """One series per program.

    A first run of each warms it up and tells how many scenarios fill the time asked for.
    """
    fixed = {} if bench.scenarios is None else {OURS: bench.scenarios[bench.vehicles.index(n_vehicles)]}
    measured = _fill_time(sessions, bench, f"N = {n_vehicles}", report, fixed)
    return [Series(name, n_vehicles, measured[name], dict(session.facts)) for name, session in sessions.items()]


def _fill_time(
    sessions: dict[str, Session],
    bench: BenchConfig,
    label: str,
    report: Report,
    fixed: dict[str, int] | None = None,
) -> dict[str, tuple[Measurement, ...]]:
    """Measurements of each program, of so many scenarios as fill the time asked for unless their number is fixed."""
    n_scenarios = {}
    for name, first in warm_up(sessions, bench.seed, label, report).items():
        unit = int(sessions[name].facts["unit"])
        n_scenarios[name] = unit * max(1, round(bench.repetition_cpu_s / first.cpu_s))
    return take_turns(sessions, n_scenarios | (fixed or {}), bench.repetitions, bench.seed, label, report)


def measure_memory(bench: BenchConfig) -> Measurement:
    """Our core simulating many rollouts in a fresh process, which keeps the frames of one chunk at a time."""
    session = start_ours(bench.memory_vehicles, bench)
    try:
        return session.measure(bench.memory_rollouts, bench.seed)
    finally:
        session.close()
