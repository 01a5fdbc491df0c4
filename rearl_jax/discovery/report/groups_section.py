"""Section of the document on differences between groups of drivers."""

from collections.abc import Mapping, Sequence
from typing import Any

from rearl_jax.discovery.report.failed_tests import failed_test_words
from rearl_jax.discovery.report.words import described
from rearl_jax.document.document import Section
from rearl_jax.document.table import NONE, Cell, Row, Table, cell_of, number, percent, sentence, spoken

MOST_NUMBERS = 2
"""Largest number of parameters shown with an effect; the verdict of the group contains all."""


def groups_section(verdict: Mapping[str, Any]) -> Section:
    """A row per group: drivers, verdict, effects, errors and time gaps; empty without groups."""
    rows = verdict.get("groups", ())
    if not rows:
        return Section("Groups")
    speeds = list(rows[0]["equilibrium_time_gap"])
    headings = ("drivers", "model", "verdict", "effects", "gap error before [m]", "after [m]")
    headings += tuple(f"time gap at {speed} m/s [s]" for speed in speeds)
    drawn = tuple(Row(row["value"], _cells(row, speeds)) for row in rows)
    by = spoken(verdict["grouping"]["by"])
    words = (
        f"Each group by {by} was calibrated and searched separately, with its own division of drivers. Time gaps are "
        "those at equilibrium behind a leader of constant speed, medians of the calibrated drivers. The folder of each "
        "group contains its candidates, curves and repaired model."
    )
    notes = _kinds_notes(verdict["grouping"], rows)
    notes += [f"{row['value']}: {failed_test_words(failed)}" for row in rows for failed in row.get("failed_tests", ())]
    for name, n in verdict["grouping"]["left_out"].items():
        notes.append(f"{n} drivers of group {name} are left out")
    return Section("Groups", (words,), (Table(f"Groups by {by}", headings, drawn),), tuple(map(sentence, notes)))


def _kinds_notes(grouping: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Sentences on the number of kinds found without labels, its confidence, and agreement with labels."""
    if "kinds" not in grouping:
        return []
    if grouping["kinds"] == 1:
        return [
            "no kinds of drivers were distinguished: the evidence for several is not above that of single-kind data"
        ]
    notes = [
        f"{grouping['kinds']} kinds of drivers were distinguished without labels: the evidence is "
        f"{grouping['gain']:.0f} nats above that for one kind; of simulated data sets of one kind and these data, "
        f"{percent(grouping['chance'])} reach as much"
    ]
    for label, share in grouping["purity"].items():
        words = f"{percent(share['value'])} of drivers have the most common {spoken(label)} of their kind"
        notes.append(f"purity: {words}, {percent(share['by_chance'])} by chance")
    for row in rows:
        labels = (
            f"{spoken(name)} {common['value']} {percent(common['share'])}" for name, common in row["labels"].items()
        )
        notes.append(f"most common in {row['value']}: {', '.join(labels) or NONE}")
    return notes


def _cells(row: Mapping[str, Any], speeds: list[str]) -> tuple[Cell, ...]:
    error = row["error"]
    effects = "; ".join(with_numbers(effect) for effect in row["effects"]) or NONE
    figures = [error["before"], error["after"], *(row["equilibrium_time_gap"][speed] for speed in speeds)]
    n_drivers = f"{sum(row['drivers'].values())}" + (f" of {row['cars']} persons or cars" if row["cars"] else "")
    model = spoken(row["car_following"])
    return (Cell(n_drivers), Cell(model), Cell(row["verdict"]), Cell(effects), *map(cell_of, figures))


def with_numbers(effect: Mapping[str, Any]) -> str:
    """An effect of a verdict with its parameters, if it has few."""
    numbers = list(effect["parameters"].values())
    if len(numbers) > MOST_NUMBERS:
        return described(effect)
    values = (f"{number(parameter['value'])} {parameter['unit']}".removesuffix(" -") for parameter in numbers)
    return " ".join((described(effect), ", ".join(values))).strip()
