"""The table of batch sizes and of the stream in the terminal."""

from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line
from rearl_jax.sweep.scale_costs import BatchCost
from rearl_jax.sweep.scale_results import ScaleResults

_WIDTH = 114
"""Columns the table and its notes need."""


def print_scale(results: ScaleResults) -> None:
    """Prints one row per batch size, one for the stream, and what must be read with them."""
    console = standard_output(_WIDTH)
    title = f"{results.config.method.name}: time of a rollout of {results.seconds} s, ms"
    shown = titled_table(title, generated=results.generated)
    shown.add_column("rollouts", justify="right", no_wrap=True)
    for heading in ("simulate", "score", "together", "CPU simulate", "CPU score", "CPU together", "rollouts/s"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for cost in results.costs:
        shown.add_row(f"{cost.n_rollouts:,} at a time", *_cells(cost))
    rates = results.rates()
    elapsed, cpu = rates["rollouts_per_s"], rates["rollouts_per_cpu_s"]
    if elapsed is not None and cpu is not None:
        name = f"stream of {results.stream.n_simulated:,}"
        shown.add_section()
        shown.add_row(name, "", "", _ms(1 / elapsed), "", "", _ms(1 / cpu), f"{elapsed:,.0f}", style="bold")
    console.print(shown)
    print_notes(console, _notes(results))


def _cells(cost: BatchCost) -> list[str]:
    elapsed = (cost.simulate_s, cost.score_s, cost.simulate_s + cost.score_s)
    cpu = (cost.simulate_cpu_s, cost.score_cpu_s, cost.simulate_cpu_s + cost.score_cpu_s)
    return [*(_ms(seconds) for seconds in (*elapsed, *cpu)), f"{1 / elapsed[-1]:,.0f}"]


def _ms(seconds: float) -> str:
    """Milliseconds with three digits that count."""
    return f"{1000 * seconds:#.3g}"


def _notes(results: ScaleResults) -> list[str]:
    stream, rates = results.stream, results.rates()
    notes = [
        f"batches: medians of {min(cost.repetitions for cost in results.costs)} repetitions or more, programs compiled;"
        f" the first calls took {sum(cost.first_s for cost in results.costs):.0f} s together",
    ]
    elapsed, vehicles, substeps = (rates[f"{name}_per_s"] for name in ("rollouts", "vehicle_seconds", "substeps"))
    if elapsed is None or vehicles is None or substeps is None:
        notes.append(f"stream: all {results.n_rollouts:,} rollouts were on disk; nothing was simulated, so no rates")
    else:
        notes += [
            f"stream: {stream.n_simulated:,} of {results.n_rollouts:,} rollouts simulated, scored and written in"
            f" {stream.wall_s:,.1f} s ({stream.cpu_s:,.1f} s of CPU time)",
            f"that is {vehicles / 1e6:#.3g} million vehicle-seconds and {substeps / 1e6:#.3g} million agent-substeps"
            f" (one vehicle, 1/{results.config.core.ticks_per_second} s) per second",
        ]
        if stream.n_before:
            notes.append(f"{stream.n_before:,} rollouts were on disk before: the rates leave them out")
    memory = results.memory()
    if memory["peak_mib_last_part"] is not None:
        notes.append("peak memory " + _span(memory, "peak_mib"))
    if memory["resident_mib_last_part"] is not None:
        notes.append("memory held at the end of a part " + _span(memory, "resident_mib"))
    return [*notes, machine_line(results.machine, results.load_average)]


def _span(memory: dict[str, float | None], name: str) -> str:
    first, last = memory[f"{name}_first_part"], memory[f"{name}_last_part"]
    return f"{first:,.0f} MiB after the first part, {last:,.0f} MiB after the last"
