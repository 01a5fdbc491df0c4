"""`rearl bench core`: speed of the traffic core and, in turn with it, of other programs.

Every number of vehicles is measured several times. Within a repetition the programs run one after the other,
in the reverse order the next time, so that other load on the machine meets all alike; a ratio is taken within
a repetition, and the median over repetitions is the result.
"""

from rearl_jax import runtime
from rearl_jax.bench.figure import draw_costs
from rearl_jax.bench.measurement import Measurement
from rearl_jax.bench.results import BenchResults, Series
from rearl_jax.bench.sessions import OURS, Absent, Session, open_sessions, start_ours
from rearl_jax.bench.terminal import print_results
from rearl_jax.bench.turns import Report, take_turns, warm_up
from rearl_jax.config import BenchCoreTask
from rearl_jax.config.bench import BenchConfig
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study

N_PROGRAMS = 5
"""Programs at most: ours, the C program on one and on all cores, highway-env, SUMO."""


def run(config: BenchCoreTask) -> dict:
    """The summary of the measurements, after writing table, summary, configuration and figure."""
    bench = config.bench
    study = Study(config.results.root, config.study, config, "bench core")
    study.write_config()
    load = runtime.load_average()
    steps_per_number = N_PROGRAMS * (bench.repetitions + 1)
    n_steps = len(bench.vehicles) * steps_per_number + (bench.memory_rollouts > 0)
    series: list[Series] = []
    absent: dict[str, Absent] = {}
    memory: Measurement | None = None
    with progress_bar() as progress:
        bar = progress.add_task("starting", total=n_steps)

        def report(doing: str, advance: int = 0) -> None:
            progress.update(bar, description=doing, advance=advance)

        for position, n_vehicles in enumerate(bench.vehicles):
            report(f"N = {n_vehicles}: compiling")
            with open_sessions(n_vehicles, bench) as (sessions, missing):
                absent |= {item.program: item for item in missing}
                series += measure_in_turn(sessions, n_vehicles, bench, report)
            progress.update(bar, completed=(position + 1) * steps_per_number)
        if bench.memory_rollouts:
            report(f"peak memory of {bench.memory_rollouts:,} rollouts")
            memory = measure_memory(bench)
            report("done", 1)
    results = BenchResults(tuple(series), tuple(absent.values()), memory, load, runtime.describe_machine())
    study.write_table("bench_core", results.table(), **results.metadata())
    study.write_bytes("cost.png", draw_costs(results))
    summary = results.summary()
    study.write_summary(summary)
    print_results(results)
    return summary


def measure_in_turn(
    sessions: dict[str, Session],
    n_vehicles: int,
    bench: BenchConfig,
    report: Report,
) -> list[Series]:
    """One series per program.

    A first run of each warms it up and tells how many scenarios fill the time asked for.
    """
    label = f"N = {n_vehicles}"
    n_scenarios = {}
    for name, first in warm_up(sessions, bench.seed, label, report).items():
        unit = int(sessions[name].facts["unit"])
        n_scenarios[name] = unit * max(1, round(bench.repetition_cpu_s / first.cpu_s))
    if bench.scenarios is not None:
        n_scenarios[OURS] = bench.scenarios[bench.vehicles.index(n_vehicles)]
    measured = take_turns(sessions, n_scenarios, bench.repetitions, bench.seed, label, report)
    return [Series(name, n_vehicles, measured[name], dict(session.facts)) for name, session in sessions.items()]


def measure_memory(bench: BenchConfig) -> Measurement:
    """Our core simulating many rollouts in a fresh process, which keeps the frames of one chunk at a time."""
    session = start_ours(bench.memory_vehicles, bench)
    try:
        return session.measure(bench.memory_rollouts, bench.seed)
    finally:
        session.close()
