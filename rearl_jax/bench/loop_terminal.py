"""The cost of the closed loop in the terminal: a table of rollouts, one of decision steps, and how to read them."""

from statistics import mean, median

from rich.table import Table

from rearl_jax.bench.loop_programs import (
    BASE,
    DECISION,
    DETECTION,
    FOLLOWING,
    LOOP,
    NEVER,
    PPO,
    STEPS_POLICY,
    TWO,
    always,
)
from rearl_jax.bench.loop_results import GOAL, PAPER_MS, LoopResults, effect_of
from rearl_jax.bench.spread import Spread, three
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line

_WIDTH = 118
"""Columns the whole table needs; a narrower terminal gets it without least and greatest ratios."""

PART_TITLES = {
    BASE: "Base, simulating",
    PPO: "PPO drives everybody, simulating",
    LOOP: f"closed loop with {STEPS_POLICY.name}, simulating",
    DETECTION: "detection alone",
    DECISION: f"decision alone, {STEPS_POLICY.name}",
}
"""What people read for the programs of the decision steps."""

PAPER_TITLES = {"idm_mobil": "IDM+MOBIL", "ppo": "PPO", "rearl": "REARL"}


def print_results(results: LoopResults) -> None:
    """Prints shares and ratios, times of decision steps, what they mean, and the machine."""
    console = standard_output(_WIDTH)
    if results.cells:
        console.print(_rollout_table(results, has_room=console.width >= _WIDTH))
    if results.steps:
        console.print(_step_table(results))
    if results.effects:
        console.print(_effect_table(results))
    print_notes(console, _notes(results))


def _rollout_table(results: LoopResults, *, has_room: bool) -> Table:
    table = titled_table("Closed loop beside Base: CPU time, medians and range over the repetitions")
    for heading in (
        *("N", "batch", "Base us", "detection %"),
        *(f"+{policy.name} %" for policy in results.policies),
        *(f"{policy.name} / Base" for policy in results.policies),
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for n_vehicles in results.numbers:
        cells = [cell for cell in results.cells if cell.n_vehicles == n_vehicles]
        for cell in cells:
            first = f"{n_vehicles}" if cell is cells[0] else ""
            added = [f"{100 * cell.policy(policy).median:+.0f}" for policy in results.policies]
            ratios = [_ratio(cell.ratio(always(policy)), has_room) for policy in results.policies]
            known = [first, f"{cell.batch:,}", f"{1e6 * cell.cost(BASE):#.3g}", _share(cell.detection)]
            table.add_row(*known, *added, *ratios, end_section=cell is cells[-1])
    return table


def _step_table(results: LoopResults) -> Table:
    n_vehicles = results.steps[0].n_vehicles
    table = titled_table(f"{results.n_steps} consecutive decision steps, N = {n_vehicles}: elapsed ms, by batch")
    table.add_column("", no_wrap=True)
    for heading in (*(f"{cell.batch:,}" for cell in results.steps), "compile s", "published"):
        table.add_column(heading, justify="right", no_wrap=True)
    for part, words in PART_TITLES.items():
        times = [_milliseconds(cell.steps_ms(part)) for cell in results.steps]
        compiled = " ".join(f"{cell.series[part].facts['compile_s']:.1f}" for cell in results.steps)
        table.add_row(words, *times, compiled, end_section=part == DECISION)
    for method, words in PAPER_TITLES.items():
        table.add_row(f"REARL (Bi et al.): {words}", *[""] * (len(results.steps) + 1), f"{PAPER_MS[method]:,}")
    return table


def _effect_table(results: LoopResults) -> Table:
    first = results.effects[0]
    table = titled_table(f"Effects beside Base, N = {first.n_vehicles}, {first.batch:,} at a time: CPU time")
    table.add_column("", no_wrap=True)
    for heading in ("ns/step", "/ Base", "from", "to", "compile s"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_row("Base", f"{median(cell.step_ns(BASE) for cell in results.effects):.1f}", *[""] * 4, end_section=True)
    for cell in results.effects:
        program = effect_of(cell)
        ratio = (f"{value:.2f}" for value in three(cell.ratio(program)))
        compiled = f"{cell.series[program].facts['compile_s']:.1f}"
        table.add_row(program, f"{cell.step_ns(program):.1f}", *ratio, compiled, end_section=program == FOLLOWING)
    return table


def _share(spread: Spread) -> str:
    return f"{100 * spread.median:+.0f} ({100 * spread.least:+.0f} to {100 * spread.greatest:+.0f})"


def _ratio(spread: Spread, has_room: bool) -> str:
    return f"{spread.median:.2f}" + (f" {spread.least:.2f}-{spread.greatest:.2f}" if has_room else "")


def _milliseconds(spread: Spread) -> str:
    return f"{spread.median:#.3g} ({spread.least:#.3g} to {spread.greatest:#.3g})"


def _notes(results: LoopResults) -> list[str]:
    lines = [
        f"references: {results.references}; no data were read,",
        "so this traffic shows what the work costs, and nothing about realism",
    ]
    if results.cells:
        lines += _rollout_notes(results)
    if results.steps:
        lines += [
            "decision steps: one call after a warm-up; detection alone and decision alone look at recorded traffic",
            "published: on other machines, and of an ambiguous unit (per step or per 10 steps); no ratio can be taken",
        ]
    if results.effects:
        lines += [
            f"effects: each of usual strength on the drivers of `{FOLLOWING}`; ratios to Base in the same repetition",
            f"two_effects: {' and '.join(TWO)}; rank_two_effects: the triggered loop on that traffic",
        ]
    lines.append(machine_line(results.machine, results.load_average))
    return lines


def _rollout_notes(results: LoopResults) -> list[str]:
    n_cells = len(results.cells)
    n_above = sum(cell.detection.median > GOAL for cell in results.cells)
    met = "kept everywhere" if n_above == 0 else f"missed in {n_above} of {n_cells} rows"
    programs = (BASE, NEVER, *(always(policy) for policy in results.policies))
    compiled = ", ".join(f"{name} {_mean_compile_s(results, name):.1f}" for name in programs)
    crashed = ", ".join(f"{name} {_crashed_share(results, name):.2%}" for name in programs if name != NEVER)
    return [
        "batch: scenarios at a time on one core; Base us: per simulated second of a scenario; all else by Base",
        f"detection: the loop that is never triggered less Base; goal at most {GOAL:.0%}, {met}",
        "+policy: admissible actions, policy and orders where no threshold is passed; the traffic is that of Base",
        "policy / Base: triggered every second, which also changes the traffic: vehicles under orders weigh no lanes",
        f"vehicles crashed by the end: {crashed}",
        f"mean compile time without cache [s]: {compiled}",
    ]


def _mean_compile_s(results: LoopResults, program: str) -> float:
    return mean(cell.series[program].facts["compile_s"] for cell in results.cells)


def _crashed_share(results: LoopResults, program: str) -> float:
    """Vehicles that have collided by the end, of all vehicles of all cells."""
    runs = [(cell.n_vehicles, run) for cell in results.cells for run in cell.series[program].measurements]
    return sum(run.crashed or 0 for _, run in runs) / sum(n_vehicles * run.n_scenarios for n_vehicles, run in runs)
