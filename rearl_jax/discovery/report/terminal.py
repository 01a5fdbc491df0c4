"""The verdict in the terminal."""

from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table

from rearl_jax.console import Console, as_text, print_notes, standard_output, titled_table
from rearl_jax.discovery.report.words import (
    described,
    effect_words,
    error_words,
    is_claimed,
    is_lane_choice,
    lane_choice_words,
    verdict_words,
)

_WIDTH = 110

_SHOWN, _SHOWN_LANES = 8, 5
"""Candidates that are printed, of car following and of the choice of the lane."""


def print_verdict(verdict: dict[str, Any]) -> None:
    """Prints what was missing, how we know, and what it changes."""
    _show(standard_output(_WIDTH), verdict)


def text_of(verdict: dict[str, Any]) -> str:
    """The same as text without colours."""
    return as_text(_WIDTH, lambda console: _show(console, verdict))


def _show(console: Console, verdict: dict[str, Any]) -> None:
    generated = verdict["data"]["generated"]
    drivers = verdict["data"]["drivers"]
    title = (
        f"{verdict_words(verdict)} [{drivers['fitted']} drivers fitted, {drivers['checked']} checked, "
        f"{drivers['reported']} reported, {verdict['data']['driver_seconds'] / 60:.0f} driver-minutes]"
    )
    following = [row for row in verdict["candidates"] if not is_lane_choice(row)]
    lanes = [row for row in verdict["candidates"] if is_lane_choice(row)]
    if following:
        console.print(_table(title, following[:_SHOWN], verdict, generated=generated))
    else:
        console.print(title, highlight=False, markup=False)
    if lanes:
        title = f"choice of the lane: {lane_choice_words(verdict['lane_choice'])}"
        console.print(_table(title, lanes[:_SHOWN_LANES], verdict, generated=generated))
    notes = [effect_words(effect) for effect in verdict["effects"]]
    notes += [error_words(verdict["error"])]
    notes += [*verdict["data"]["findings"], *verdict["data"]["notes"]]
    print_notes(console, notes)


def _table(title: str, rows: Iterable[Mapping[str, Any]], verdict: Mapping[str, Any], *, generated: bool) -> Table:
    """Candidates with their figures, and which of them are named."""
    table = titled_table(title, generated=generated)
    for name in ("candidate", "surprise", "gain", "on others", ""):
        table.add_column(name, justify="left" if name in ("candidate", "") else "right", no_wrap=True)
    for row in rows:
        mark = "not told apart" if row["ambiguous"] else "named" if is_claimed(row, verdict) else ""
        table.add_row(described(row), *(_figure(row[name]) for name in ("surprise", "gain", "check")), mark)
    return table


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
