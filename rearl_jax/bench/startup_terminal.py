"""How long commands take to start, in the terminal."""

from rearl_jax.bench.spread import three
from rearl_jax.bench.startup_results import COLD, IMPORT, PYTHON, WARM, StartupResults
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.runtime import machine_line

_WIDTH = 90
"""Columns the whole table needs."""

TITLES = {
    PYTHON: "Python alone",
    IMPORT: "import rearl_jax",
    "import_jax": "import jax",
    "help": "rearl --help",
    COLD: "rearl evaluate method=base, empty cache",
    WARM: "rearl evaluate method=base again",
}
"""What people read for the commands."""


def print_results(results: StartupResults) -> None:
    """Prints a row per command, whether the goals are met, and the machine."""
    console = standard_output(_WIDTH)
    table = titled_table("From the command to its first line of output, and to its end: elapsed time")
    table.add_column("", no_wrap=True)
    for heading in ("first s", "from", "to", "whole s", "CPU s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for command in results.commands:
        first = (f"{value:.2f}" for value in three(results.spread(command, "first_s")))
        rest = (f"{results.spread(command, figure).median:.2f}" for figure in ("wall_s", "cpu_s"))
        table.add_row(TITLES[command], *first, *rest)
    console.print(table)
    goals = ((COLD, "with an empty cache", results.cold_goal_s), (WARM, "with a full one", results.warm_goal_s))
    notes = [f"import rearl_jax takes {results.import_ms:.0f} ms beyond the start of Python, medians"]
    for command, when, goal in goals:
        met = "met" if results.spread(command, "first_s").median < goal else "missed"
        notes.append(f"first table {when}: goal below {goal:g} s, {met}")
    print_notes(console, [*notes, machine_line(results.machine, results.load_average)])
