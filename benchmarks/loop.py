"""Cost of detection and decisions beside the traffic core.

For every number of vehicles and every size of batch these programs are measured in turn:

- Base, IDM and MOBIL traffic without interventions;
- the closed loop that is never triggered: Base and the detection;
- for every policy, the loop in which all is computed but no vehicle is asked, with the traffic of Base;
- for every policy, the loop that is triggered every second.

Then follow the time of a few consecutive decision steps, whole and in parts, and Base with every effect switched on,
one at a time. No data are read: the references are synthetic.
"""

from collections.abc import Mapping

from benchmarks.loop_programs import EFFECT_PAIR, always, effect_programs, programs_of
from benchmarks.loop_results import GOAL, Cell, LoopResults, effect_of
from benchmarks.options import LoopBenchmark, LoopOptions
from benchmarks.terminal import print_table
from rearl_jax import runtime
from rearl_jax.machine import load_average
from rearl_jax.results import Study
from rearl_jax.timing.decision_steps import BASE, PAPER_MS, count_reports, measure_steps, program_arguments
from rearl_jax.timing.measurement import Simulator
from rearl_jax.timing.process import open_sessions
from rearl_jax.timing.turns import Report, reporting, take_turns, warm_up

ROLLOUTS = "benchmarks.loop_programs:rollouts"


def run(config: LoopBenchmark) -> dict:
    """The summary of the measurements, after writing table, configuration and summary."""
    loop = config.loop
    study = Study(config.results.root, config.study, config, "bench loop")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    load = load_average()
    with reporting(count_steps(loop)) as report:
        cells = [measure_rollouts(loop, n, batch, report) for n in loop.vehicles for batch in loop.batches]
        steps = [Cell(loop.steps_vehicles, n, measure_steps(loop, n, report)) for n in loop.steps_batches]
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
    summary = results.summary()
    study.write_summary(summary)
    show(results)
    return summary


def count_steps(loop: LoopOptions) -> int:
    """Steps of the progress bar: every program of every cell is compiled, warmed up and measured.

    Raises:
        InvalidInputError: There is no such effect.
    """
    n_cells = len(loop.vehicles) * len(loop.batches)
    of_rollouts = n_cells * len(programs_of(loop.policies)) * (loop.repetitions + 2)
    effects = _effect_programs(loop)
    of_effects = 1 + len(effects) * (3 + 2 * loop.repetitions) if effects else 0
    return of_rollouts + count_reports(loop) + of_effects


def _effect_programs(loop: LoopOptions) -> tuple[str, ...]:
    return effect_programs(loop.effects) if loop.batches else ()


def measure_rollouts(loop: LoopOptions, n_vehicles: int, batch: int, report: Report) -> Cell:
    """Measurements of Base and of the closed loop, never triggered, not asking and always triggered."""
    label = f"N = {n_vehicles}, {batch} at a time"
    scene = program_arguments(loop, n_vehicles, loop.seconds, batch)
    with open_sessions(ROLLOUTS, programs_of(loop.policies), scene, label, report) as sessions:
        return _measured(loop, n_vehicles, batch, sessions, label, report)


def measure_effects(loop: LoopOptions, report: Report) -> list[Cell]:
    """A cell per effect, each with Base measured in turn with it; Base is compiled once."""
    programs = _effect_programs(loop)
    if not programs:
        return []
    n_vehicles, batch = loop.vehicles[0], loop.batches[-1]
    label = f"effects, N = {n_vehicles}, {batch} at a time"
    scene = program_arguments(loop, n_vehicles, loop.seconds, batch)
    cells = []
    with open_sessions(ROLLOUTS, (BASE,), scene, label, report) as base:
        for name in programs:
            with open_sessions(ROLLOUTS, (name,), scene, label, report) as with_effect:
                cells.append(_measured(loop, n_vehicles, batch, base | with_effect, label, report))
    return cells


def _measured(
    loop: LoopOptions, n_vehicles: int, batch: int, sessions: Mapping[str, Simulator], label: str, report: Report
) -> Cell:
    """Measurements of all programs in turn; all simulate as many batches as Base does in `loop.repetition_cpu_s`."""
    first = warm_up(sessions, loop.seed, label, report)[BASE]
    rounds = max(1, round(loop.repetition_cpu_s / first.cpu_s)) if loop.rounds is None else loop.rounds
    n_scenarios = dict.fromkeys(sessions, batch * rounds)
    measured = take_turns(sessions, n_vehicles, n_scenarios, loop.repetitions, loop.seed, label, report)
    return Cell(n_vehicles, batch, measured)


def show(results: LoopResults) -> None:
    """Prints costs of rollouts, of decision steps and of effects, and how to read them."""
    rollouts = [
        {"N": cell.n_vehicles, "batch": cell.batch, "Base us": 1e6 * cell.cost(BASE), "detection": cell.detection}
        | {f"+{policy.name}": cell.policy(policy).median for policy in results.policies}
        | {f"{policy.name} / Base": cell.ratio(always(policy)).median for policy in results.policies}
        for cell in results.cells
    ]
    print_table("Closed loop: CPU time per simulated second of Base, and all else by it", rollouts)
    steps = [
        {"program": part, "batch": cell.batch, "ms": cell.steps_ms(part), "compile s": item.facts["compile_s"]}
        for cell in results.steps
        for part, item in cell.series.items()
    ]
    print_table(f"{results.n_steps} consecutive decision steps: elapsed time", steps)
    effects = [
        {"program": effect_of(cell), "ns/step": cell.step_ns(effect_of(cell)), "/ Base": cell.ratio(effect_of(cell))}
        for cell in results.effects
    ]
    print_table("Effects: CPU time of a vehicle step, and by that of Base", effects, _notes(results))


def _notes(results: LoopResults) -> list[str]:
    lines = [f"references: {results.references}; no data were read"]
    if results.cells:
        n_above = sum(cell.detection.median > GOAL for cell in results.cells)
        met = f"missed in {n_above} of {len(results.cells)} rows" if n_above else "kept"
        lines += [
            f"detection: the loop that is never triggered less Base; goal at most {GOAL:.0%}, {met}",
            "+policy: admissible actions, policy and orders where no threshold is passed; the traffic is that of Base",
            "policy / Base: triggered every second, which also changes the traffic: vehicles under orders keep lanes",
        ]
    if results.steps:
        published = ", ".join(f"{method} {value:,}" for method, value in PAPER_MS.items())
        lines.append(f"REARL (Bi et al.), ms per decision step or for ten, on another machine: {published}")
    if results.effects:
        lines.append(f"two_effects: {' and '.join(EFFECT_PAIR)}; rank_two_effects: the triggered loop on that traffic")
    return [*lines, runtime.machine_line(results.machine, results.load_average)]
