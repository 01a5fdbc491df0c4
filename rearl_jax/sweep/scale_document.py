"""Document of `rearl sweep scale`: time of a rollout by the number simulated at a time, rates, memory."""

import pandas as pd

from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Emphasis, table_of
from rearl_jax.runtime import machine_line
from rearl_jax.sweep.scale_results import ScaleResults

_COLUMNS = {
    "title": "",
    "simulate_s": "simulate",
    "score_s": "score",
    "together_s": "together",
    "simulate_cpu_s": "CPU simulate",
    "score_cpu_s": "CPU score",
    "together_cpu_s": "CPU together",
    "rate": "rollouts/s",
}


def document_of(results: ScaleResults) -> Document:
    """The document of a stream of rollouts."""
    costs = pd.DataFrame(map(vars, results.costs))
    for clock in ("s", "cpu_s"):
        costs[f"together_{clock}"] = costs[f"simulate_{clock}"] + costs[f"score_{clock}"]
    costs["title"] = [f"{n:,} at a time" for n in costs["n_rollouts"]]
    rates, stream = results.rates(), results.stream
    elapsed, cpu = rates["rollouts_per_s"], rates["rollouts_per_cpu_s"]
    if elapsed is None or cpu is None:
        verdict = f"All {results.n_rollouts:,} rollouts were on disk; nothing was simulated, so no rates."
    else:
        name = f"stream of {stream.n_simulated:,}"
        record = {"title": name, "together_s": 1 / elapsed, "together_cpu_s": 1 / cpu}
        costs = pd.concat([costs, pd.DataFrame([record])])
        verdict = (
            f"{stream.n_simulated:,} of {results.n_rollouts:,} rollouts were simulated, scored and written in "
            f"{stream.wall_s:,.1f} s ({stream.cpu_s:,.1f} s of CPU time)."
        )
    costs["rate"] = 1 / costs["together_s"]
    times = [name for name in costs if name.endswith("_s")]
    costs[times] = 1000 * costs[times]
    title = f"{results.config.method.name}: time of a rollout of {results.seconds} s, ms"
    table = table_of(title, costs, _COLUMNS, {f"stream of {stream.n_simulated:,}": Emphasis.strong})
    return Document(
        title=title,
        verdict=verdict,
        sections=(Section("Costs", tables=(table,), notes=_notes(results)),),
        command="sweep scale",
        generated=results.generated,
    )


def _notes(results: ScaleResults) -> tuple[str, ...]:
    rates, memory = results.rates(), results.memory()
    notes = [
        f"batches: medians of {min(cost.repetitions for cost in results.costs)} repetitions or more, programs compiled;"
        f" the first calls took {sum(cost.first_s for cost in results.costs):.0f} s together"
    ]
    vehicles, substeps = rates["vehicle_seconds_per_s"], rates["substeps_per_s"]
    if vehicles is not None and substeps is not None:
        notes.append(
            f"{vehicles / 1e6:#.3g} million vehicle-seconds and {substeps / 1e6:#.3g} million agent-substeps (one "
            f"vehicle, 1/{results.config.core.ticks_per_second} s) per second"
        )
        if n_before := results.stream.n_before:
            notes.append(f"{n_before:,} rollouts were on disk before and do not count for the rates")
    for name, text in (("peak_mib", "peak memory"), ("resident_mib", "memory held at the end of a part")):
        after_first, after_last = memory[f"{name}_first_part"], memory[f"{name}_last_part"]
        if after_first is not None and after_last is not None:
            notes.append(f"{text} {after_first:,.0f} MiB after the first part, {after_last:,.0f} MiB after the last")
    return (*notes, machine_line(results.machine, results.load_average))
