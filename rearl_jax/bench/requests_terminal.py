"""The speed of asking in the terminal."""

from rich.table import Table

from rearl_jax.bench.requests_results import Asking, RequestsResults
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line

_WIDTH = 118
"""Columns the table needs."""


def print_results(results: RequestsResults) -> None:
    """Prints a row per server and asker, then what it means."""
    console = standard_output(_WIDTH)
    table = titled_table("Requests per second, medians and range over the repetitions")
    table.add_column("server", no_wrap=True)
    table.add_column("asked by", no_wrap=True)
    for heading in ("requests", "per s", "of ideal", "CPU ms", "ours / plain"):
        table.add_column(heading, justify="right", no_wrap=True)
    requests, summary = results.requests, results.summary()
    fixed = f"{1000 * requests.latency:g} ms, {requests.slots} at a time"
    for name, title, asking in (("fixed", fixed, results.fixed), ("server", requests.server or "", results.real)):
        if asking is not None:
            _add_rows(table, name, title, asking, summary)
    console.print(table)
    print_notes(console, _notes(results))


def _add_rows(table: Table, name: str, title: str, asking: Asking, summary: dict) -> None:
    for asker, prefix, bursts in (("our client", "", asking.ours), ("plain load generator", "plain_", asking.plain)):
        key = f"{name}_{prefix}"
        share = summary.get(f"{key}share_of_ideal")
        ratio = [summary[f"{name}_ratio_to_plain{end}"] for end in ("", "_min", "_max")]
        table.add_row(
            "" if prefix else title,
            asker,
            f"{bursts[0].n_requests:,}",
            f"{summary[f'{key}per_s']:.4g} ({summary[f'{key}per_s_min']:.4g} to {summary[f'{key}per_s_max']:.4g})",
            "" if share is None else f"{100 * share:.0f} %",
            f"{summary[f'{key}cpu_ms']:.2f}",
            "" if prefix else f"{ratio[0]:.2f} ({ratio[1]:.2f} to {ratio[2]:.2f})",
            end_section=bool(prefix),
        )


def _notes(results: RequestsResults) -> list[str]:
    lines = [
        f"at most {results.in_flight} requests at a time (llm.max_in_flight); ideal: {results.ideal_per_s:,.0f} per s",
        "our client also writes the requests, parses and keeps every answer and lists it; the plain load generator "
        "sends what was written before and looks at nothing",
    ]
    if results.real is not None:
        prompt, cached = results.real.tokens
        share = ""
        if prompt and cached is not None:
            share = f"; {100 * cached / prompt:.0f} % of {prompt:,} prompt tokens from its prefix cache"
        lines.append(f"{results.requests.server}: {results.real.model}{share}")
    lines.append(machine_line(results.machine, results.load_average))
    return lines
