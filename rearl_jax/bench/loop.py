"""`rearl bench loop`: what detection and decisions cost beside the traffic core.

Measured in turn, for every number of vehicles and every size of batch: Base; the closed loop that is never triggered,
which is Base and the detection; with every policy the loop in which all is computed and nobody asked, which has the
traffic of Base and the work of the policy; and the loop that is triggered every second. Then the time of a few
consecutive decision steps, whole and in parts; and Base with every effect switched on, one at a time. No data are
read: the references are synthetic.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from rearl_jax import runtime
from rearl_jax.bench.loop_programs import BASE, PARTS, effect_programs, programs_of
from rearl_jax.bench.loop_results import Cell, LoopResults
from rearl_jax.bench.loop_terminal import print_results
from rearl_jax.bench.measurement import Simulator
from rearl_jax.bench.results import Series
from rearl_jax.bench.sessions import WorkerSession
from rearl_jax.bench.turns import Report, take_turns, warm_up
from rearl_jax.config import BenchLoopTask
from rearl_jax.config.bench import BenchLoopConfig
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study


def run(config: BenchLoopTask) -> dict:
    """The summary of the measurements, after writing table, figure, configuration and summary."""
    loop = config.loop
    study = Study(config.results.root, config.study, config, "bench loop")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    load = runtime.load_average()
    with progress_bar() as progress:
        bar = progress.add_task("starting", total=count_steps(loop))

        def report(doing: str, advance: int = 0) -> None:
            progress.update(bar, description=doing, advance=advance)

        cells = [measure_rollouts(loop, n, batch, report) for n in loop.vehicles for batch in loop.batches]
        steps = [measure_steps(loop, batch, report) for batch in loop.steps_batches]
        effects = measure_effects(loop, report)
    results = LoopResults(
        tuple(cells),
        tuple(steps),
        tuple(effects),
        loop.policies,
        loop.steps,
        f"{loop.n_references} synthetic ones of {loop.reference_seconds} s with {loop.reference_vehicles} vehicles"
        f" from seed {loop.seed}",
        load,
        runtime.describe_machine(),
    )
    study.write_table("bench_loop", results.table(), **results.metadata())
    print_results(results)
    if results.cells:
        # Matplotlib is slow to import; the table need not wait for it.
        from rearl_jax.bench.loop_figure import draw_costs

        study.write_bytes("cost.png", draw_costs(results))
    summary = results.summary()
    study.write_summary(summary)
    return summary


def count_steps(loop: BenchLoopConfig) -> int:
    """Steps of the progress bar: every program of every cell is compiled, warmed up and measured.

    Raises:
        ValueError: There is no such effect.
    """
    n_cells = len(loop.vehicles) * len(loop.batches)
    of_rollouts = n_cells * len(programs_of(loop.policies)) * (loop.repetitions + 2)
    effects = _effect_programs(loop)
    of_effects = 1 + len(effects) * (3 + 2 * loop.repetitions) if effects else 0
    return of_rollouts + len(loop.steps_batches) * len(PARTS) * (loop.steps_repetitions + 2) + of_effects


def _effect_programs(loop: BenchLoopConfig) -> tuple[str, ...]:
    return effect_programs(loop.effects) if loop.batches else ()


def measure_rollouts(loop: BenchLoopConfig, n_vehicles: int, batch: int, report: Report) -> Cell:
    """Base and the closed loop in its states; all simulate as many batches as fill Base's time."""
    label = f"N = {n_vehicles}, {batch} at a time"
    scene = {"n_vehicles": n_vehicles, "seconds": loop.seconds, "batch": batch, **_common(loop)}
    with open_sessions("rollouts", programs_of(loop.policies), scene, label, report) as sessions:
        return _measured_cell(loop, n_vehicles, batch, sessions, label, report)


def measure_steps(loop: BenchLoopConfig, batch: int, report: Report) -> Cell:
    """Consecutive decision steps, whole and in parts; a measurement is one call."""
    n_vehicles = loop.steps_vehicles
    label = f"{loop.steps} decision steps, {batch} at a time"
    scene = {"n_vehicles": n_vehicles, "seconds": loop.steps, "batch": batch, **_common(loop)}
    with open_sessions("decision_steps", PARTS, scene, label, report) as sessions:
        warm_up(sessions, loop.seed, label, report)
        n_scenarios = dict.fromkeys(sessions, batch)
        measured = take_turns(sessions, n_scenarios, loop.steps_repetitions, loop.seed, label, report)
        return _cell(n_vehicles, batch, sessions, measured)


def measure_effects(loop: BenchLoopConfig, report: Report) -> list[Cell]:
    """A cell per effect, each with Base measured in turn with it; Base is compiled once."""
    programs = _effect_programs(loop)
    if not programs:
        return []
    n_vehicles, batch = loop.vehicles[0], loop.batches[-1]
    label = f"effects, N = {n_vehicles}, {batch} at a time"
    scene = {"n_vehicles": n_vehicles, "seconds": loop.seconds, "batch": batch, **_common(loop)}
    cells = []
    with open_sessions("rollouts", (BASE,), scene, label, report) as base:
        for name in programs:
            with open_sessions("effect_rollouts", (name,), scene, label, report) as with_effect:
                sessions = base | with_effect
                cells.append(_measured_cell(loop, n_vehicles, batch, sessions, label, report))
    return cells


def _measured_cell(
    loop: BenchLoopConfig, n_vehicles: int, batch: int, sessions: dict[str, Simulator], label: str, report: Report
) -> Cell:
    """All programs in turn; all simulate as many batches as fill Base's time."""
    first = warm_up(sessions, loop.seed, label, report)[BASE]
    rounds = max(1, round(loop.repetition_cpu_s / first.cpu_s)) if loop.rounds is None else loop.rounds
    n_scenarios = dict.fromkeys(sessions, batch * rounds)
    measured = take_turns(sessions, n_scenarios, loop.repetitions, loop.seed, label, report)
    return _cell(n_vehicles, batch, sessions, measured)


def _common(loop: BenchLoopConfig) -> dict[str, Any]:
    references = {
        "seed": loop.seed,
        "n_references": loop.n_references,
        "n_seconds": loop.reference_seconds,
        "n_vehicles": loop.reference_vehicles,
    }
    return {"density": loop.density, "references": references}


@contextmanager
def open_sessions(
    kind: str, names: Sequence[str], scene: dict[str, Any], label: str, report: Report
) -> Iterator[dict[str, Simulator]]:
    """Programs by name, each compiled in a process of its own.

    Args:
        kind: The measured program of `rearl_jax.bench.worker`.
        names: What of it is measured.
        scene: Its other arguments.
        label: Begins what is reported.
        report: Told of every step.
    """
    sessions: dict[str, Simulator] = {}
    with ExitStack() as stack:
        for name in names:
            report(f"{label}: {name}, compiling", 0)
            session = WorkerSession(kind, name=name, **scene)
            stack.callback(session.close)
            sessions[name] = session
            report(f"{label}: {name}, compiled", 1)
        yield sessions


def _cell(n_vehicles: int, batch: int, sessions: dict[str, Simulator], measured: dict[str, tuple]) -> Cell:
    series = {name: Series(name, n_vehicles, measured[name], dict(session.facts)) for name, session in sessions.items()}
    return Cell(n_vehicles, batch, series)
