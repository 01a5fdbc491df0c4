"""The report on `rearl discover`: verdict, effects, candidates, errors beside their floor."""

from collections.abc import Mapping, Sequence
from typing import Any

from rearl_jax.discovery.report.page import CAPTIONS, MEASURES
from rearl_jax.discovery.report.words import (
    described,
    effect_words,
    error_words,
    is_claimed,
    is_lane_choice,
    lane_choice_words,
    verdict_words,
)
from rearl_jax.report.content import Cell, Content, Line, Section, Shown, interval, number, sentence, spoken
from rearl_jax.report.finished import FinishedStudy

_KEYS = ("verdict", "effects", "candidates", "unseen", "error", "adequacy", "lane_choice", "data")
_MOST_CANDIDATES = 12
"""Candidates that are lines of a table."""

_MOST_PARAMETERS = 5
"""Parameters of an effect that are lines of their own; more are values of a curve, which the maps show."""


def discovery_content(study: FinishedStudy) -> Content:
    """What the report on a discovery says.

    Raises:
        FileNotFoundError, ValueError: verdict.json is missing, or of an older version.
    """
    verdict = study.object("verdict.json")
    study.needs(verdict, _KEYS, "verdict.json")
    data, drivers = verdict["data"], verdict["data"]["drivers"]
    findings = tuple(f"The columns themselves show: {line}." for line in data["findings"])
    sections = (
        Section("What was found", findings, _effect_tables(verdict), _certainty(verdict)),
        Section("Error before and after", (sentence(error_words(verdict["error"])),), (_errors(verdict),)),
        *_candidates(verdict),
        *_unseen(verdict["unseen"]),
    )
    return Content(
        title="What the traffic model lacks",
        result=sentence(verdict_words(verdict)),
        sections=sections,
        data=f"{data['recordings']} recordings, {data['driver_seconds'] / 60:.0f} driver-minutes of "
        f"{sum(drivers.values())} drivers who follow somebody: {drivers['fitted']} calibrated, {drivers['checked']} to "
        f"check on, {drivers['reported']} that took no part, whose errors are reported.",
        words="discover",
        notes=tuple(sentence(note) for note in data["notes"]),
        captions=CAPTIONS,
    )


def _effect_tables(verdict: Mapping[str, Any]) -> tuple[Shown, ...]:
    """Parameters of the effects with their intervals."""
    lines = []
    for effect in verdict["effects"]:
        certainty, parameters = Cell(f"{effect['confidence']:.2f}"), effect["parameters"]
        if len(parameters) > _MOST_PARAMETERS:
            figures = (Cell(f"a curve through {len(parameters)} values"), Cell(""), certainty)
            lines.append(Line(described(effect), figures))
            continue
        for name, value in parameters.items():
            unit = "" if value["unit"] == "-" else f" {value['unit']}"
            figure = Cell(number(value["value"]) + unit, interval(value["low"], value["high"]))
            lines.append(Line(described(effect), (Cell(spoken(name)), figure, certainty)))
    headings = ("parameter", "value", "confidence")
    return (Shown("Effects and their parameters", headings, tuple(lines)),) if lines else ()


def _certainty(verdict: Mapping[str, Any]) -> tuple[str, ...]:
    """Effects in words, and what they could be mistaken for."""
    ambiguous = [
        f"{sentence(described(row))[:-1]} explains the data as well; to tell them apart: {row['told_apart_by']}."
        for row in verdict["candidates"]
        if row["ambiguous"]
    ]
    return (*(sentence(effect_words(effect)) for effect in verdict["effects"]), *ambiguous)


def _errors(verdict: Mapping[str, Any]) -> Shown:
    """Errors of drivers that took no part, before and after, and what their own noise alone makes."""
    error = verdict["error"]
    headings = ("before", "after", "change")
    lines = [
        Line(f"{title} [{unit}]", tuple(_figure(error["all"][name][at], "+" * (at == "change")) for at in headings))
        for name, (title, unit) in MEASURES.items()
        if name in error["all"]
    ]
    beside = {"oracle": "gap error of the oracle [m]", "floor": "gap error by drivers' own noise alone [m]"}
    for name, title in beside.items():
        if error[name] is not None:
            lines.append(Line(title, (Cell(""), _figure(error[name]), Cell(""))))
    return Shown("Errors on drivers nothing was fitted to", headings, tuple(lines))


def _figure(value: Mapping[str, float], sign: str = "") -> Cell:
    return Cell(f"{value['value']:{sign}.2f}", f"{value['low']:{sign}.2f} to {value['high']:{sign}.2f}")


def _candidates(verdict: Mapping[str, Any]) -> list[Section]:
    """Candidates of car following, then those of the choice of the lane."""
    rows = verdict["candidates"]
    following = [row for row in rows if not is_lane_choice(row)]
    lanes = [row for row in rows if is_lane_choice(row)]
    explained = (
        "Surprise: evidence above its mean where nothing is missing, in standard deviations of that. Gain: "
        "log-likelihood of the fitted drivers less the price of freedom; on others: that of drivers nothing else was "
        "fitted to. A candidate is believed if it gains on both."
    )
    found = [Section("Candidates", (explained,), (_ranked("Candidates of car following", following, verdict),))]
    if lanes:
        words = () if verdict["lane_choice"] is None else (sentence(lane_choice_words(verdict["lane_choice"])),)
        found.append(Section("The choice of the lane", words, (_ranked("Candidates of lane choice", lanes, verdict),)))
    return found if rows else []


def _ranked(title: str, rows: Sequence[Mapping[str, Any]], verdict: Mapping[str, Any]) -> Shown:
    lines = []
    for row in rows[:_MOST_CANDIDATES]:
        mark = "not told apart" if row["ambiguous"] else "added" if is_claimed(row, verdict) else ""
        figures = ("" if row[name] is None else f"{row[name]:.1f}" for name in ("surprise", "gain", "check"))
        lines.append(Line(described(row), (*map(Cell, figures), Cell(mark))))
    left = len(rows) - len(lines)
    title += f" (all {len(rows)} are in candidates.parquet)" if left else ""
    return Shown(title, ("surprise [σ]", "gain [nats]", "on others [nats]", "what became of it"), tuple(lines))


def _unseen(rows: Sequence[Mapping[str, Any]]) -> list[Section]:
    """Effects that these data could not have shown."""
    if not rows:
        return []
    lines = []
    for row in rows:
        unit = "" if row["unit"] == "-" else f" {row['unit']}"
        lines.append(Line(spoken(row["name"]), (Cell(spoken(row["parameter"])), Cell(f"{row['strength']:.2g}{unit}"))))
    shown = Shown("Weakest effects that would have been seen", ("parameter", "least value"), tuple(lines))
    words = ("An effect weaker than this is not ruled out.",)
    return [Section("What these data could not have shown", words, (shown,), is_folded=True)]
