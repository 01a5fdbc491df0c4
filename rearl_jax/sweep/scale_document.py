"""What a stream of rollouts says: time of a rollout by the number at a time, rates, memory."""

from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, Table
from rearl_jax.runtime import machine_line
from rearl_jax.sweep.scale_costs import BatchCost
from rearl_jax.sweep.scale_results import ScaleResults

_HEADINGS = ("simulate", "score", "together", "CPU simulate", "CPU score", "CPU together", "rollouts/s")


def document_of(results: ScaleResults) -> Document:
    """The document of a stream of rollouts."""
    rows = [Row(f"{cost.n_rollouts:,} at a time", _cells(cost)) for cost in results.costs]
    rates = results.rates()
    elapsed, cpu = rates["rollouts_per_s"], rates["rollouts_per_cpu_s"]
    if elapsed is None or cpu is None:
        verdict = f"All {results.n_rollouts:,} rollouts were on disk; nothing was simulated, so no rates."
    else:
        cells = (NONE, NONE, _ms(1 / elapsed), NONE, NONE, _ms(1 / cpu), f"{elapsed:,.0f}")
        title = f"stream of {results.stream.n_simulated:,}"
        rows.append(Row(title, tuple(map(Cell, cells)), Emphasis.strong))
        verdict = (
            f"{results.stream.n_simulated:,} of {results.n_rollouts:,} rollouts were simulated, scored and written in "
            f"{results.stream.wall_s:,.1f} s ({results.stream.cpu_s:,.1f} s of CPU time)."
        )
    title = f"{results.config.method.name}: time of a rollout of {results.seconds} s, ms"
    return Document(
        title=title,
        verdict=verdict,
        sections=(Section("Costs", tables=(Table(title, _HEADINGS, tuple(rows)),), notes=_notes(results)),),
        command="sweep scale",
        generated=results.generated,
    )


def _cells(cost: BatchCost) -> tuple[Cell, ...]:
    elapsed = (cost.simulate_s, cost.score_s, cost.simulate_s + cost.score_s)
    cpu = (cost.simulate_cpu_s, cost.score_cpu_s, cost.simulate_cpu_s + cost.score_cpu_s)
    return (*(Cell(_ms(seconds)) for seconds in (*elapsed, *cpu)), Cell(f"{1 / elapsed[-1]:,.0f}"))


def _ms(seconds: float) -> str:
    """Milliseconds with three significant digits."""
    return f"{1000 * seconds:#.3g}"


def _notes(results: ScaleResults) -> tuple[str, ...]:
    rates, memory = results.rates(), results.memory()
    notes = [
        f"batches: medians of {min(cost.repetitions for cost in results.costs)} repetitions or more, programs compiled;"
        f" the first calls took {sum(cost.first_s for cost in results.costs):.0f} s together",
    ]
    vehicles, substeps = rates["vehicle_seconds_per_s"], rates["substeps_per_s"]
    if vehicles is not None and substeps is not None:
        notes.append(
            f"{vehicles / 1e6:#.3g} million vehicle-seconds and {substeps / 1e6:#.3g} million agent-substeps (one "
            f"vehicle, 1/{results.config.core.ticks_per_second} s) per second"
        )
        if n_before := results.stream.n_before:
            notes.append(f"{n_before:,} rollouts were on disk before: the rates leave them out")
    for name, text in (("peak_mib", "peak memory"), ("resident_mib", "memory held at the end of a part")):
        first, last = memory[f"{name}_first_part"], memory[f"{name}_last_part"]
        if first is not None and last is not None:
            notes.append(f"{text} {first:,.0f} MiB after the first part, {last:,.0f} MiB after the last")
    return (*notes, machine_line(results.machine, results.load_average))
