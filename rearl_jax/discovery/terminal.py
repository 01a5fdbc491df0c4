"""The verdict in the terminal."""

from typing import Any

from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.discovery.words import effect_words, error_words, verdict_words

_WIDTH = 110

_SHOWN = 8
"""Candidates that are printed."""


def print_verdict(verdict: dict[str, Any], *, generated: bool) -> None:
    """Prints what was missing, how we know, and what it changes."""
    console = standard_output(_WIDTH)
    drivers = verdict["data"]["drivers"]
    title = (
        f"{verdict_words(verdict)} [{drivers['fitted']} drivers fitted, {drivers['checked']} checked, "
        f"{drivers['reported']} reported, {verdict['data']['driver_seconds'] / 60:.0f} driver-minutes]"
    )
    table = titled_table(title, generated=generated)
    for name in ("candidate", "surprise", "gain", "on others", ""):
        table.add_column(name, justify="left" if name in ("candidate", "") else "right", no_wrap=True)
    claimed = {effect["name"] for effect in verdict["effects"]}
    for row in verdict["candidates"][:_SHOWN]:
        name = row["name"] if row["kind"] != "generic" else f"{row['name']} on {', '.join(row['variables'])}"
        mark = "not told apart" if row["ambiguous"] else "named" if row["name"] in claimed else ""
        table.add_row(name, _nats(row["surprise"]), _nats(row["gain"]), _nats(row["check"]), mark)
    if verdict["candidates"]:
        console.print(table)
    else:
        console.print(title, highlight=False, markup=False)
    notes = [effect_words(effect) for effect in verdict["effects"]]
    notes += [error_words(verdict["error"])]
    notes += verdict["data"]["findings"]
    print_notes(console, notes)


def _nats(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
