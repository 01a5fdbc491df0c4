"""Car-following models compared, as a section of the document."""

from collections.abc import Mapping
from typing import Any

from rearl_jax.discovery.report.protocols import PROTOCOLS
from rearl_jax.discovery.report.words import base_words, described
from rearl_jax.document.document import Section
from rearl_jax.document.table import NONE, Cell, Row, Table, interval, number, percent, sentence, spoken


def base_section(verdict: Mapping[str, Any]) -> Section:
    """A row per model: evidence on the checked drivers, and mean gap errors; empty where none were compared."""
    base, title = verdict.get("base"), "Car-following models compared"
    if base is None:
        return Section(title)
    shown = [name for name in PROTOCOLS if any(row["protocols"][name] for row in base["compared"])]
    headings = ("gain [nats]", "most likely in", *(f"{spoken(name)} [m]" for name in shown), "")
    rows = []
    for row in base["compared"]:
        errors = (_error(row["protocols"][name]) for name in shown)
        rows.append(Row(spoken(row["name"]), (*_evidence(row, base), *errors, _mark(row, base))))
    drivers = base["drivers"]
    how = (
        f"Each was calibrated to {drivers['fitted']} of the fitted drivers and asked about {drivers['checked']} of the "
        f"check drivers. Gain: log-likelihood beyond that of {spoken(base['driver'])}, every driver's own parameters "
        "integrated out, so that each parameter costs what the data narrow it by. Most likely in: share of resamples "
        "of drivers. Errors are mean closed-loop gap errors of the check drivers, by what is known of a driver; models "
        "that surely are less likely than the best were not simulated."
    )
    notes = [words for words in (_anew(base), _time_gaps(base), *_dependences(verdict)) if words]
    said = base_words(base) or f"no model surely is better than {spoken(base['driver'])}, which stays"
    return Section(
        title, (f"{sentence(said)} {how}",), (Table(title, headings, tuple(rows)),), tuple(map(sentence, notes))
    )


def _evidence(row: Mapping[str, Any], base: Mapping[str, Any]) -> tuple[Cell, Cell]:
    gain = row["gain"]
    if row["name"] == base["driver"]:
        return Cell(NONE), Cell(percent(row["best_share"]))
    return Cell(number(gain["value"], "+"), interval(gain["low"], gain["high"], "+")), Cell(percent(row["best_share"]))


def _error(found: Mapping[str, Any] | None) -> Cell:
    if found is None:
        return Cell(NONE)
    mean = found["gap_rmse"]["mean"]
    return Cell(number(mean["value"]), interval(mean["low"], mean["high"]))


def _mark(row: Mapping[str, Any], base: Mapping[str, Any]) -> Cell:
    if row["name"] == base["chosen"]:
        return Cell("chosen")
    return Cell("simulations speak against it" if row["is_vetoed"] else "")


def _anew(base: Mapping[str, Any]) -> str:
    """The model that was chosen before effects were found."""
    if base.get("before") is None:
        return ""
    return (
        f"the search first went beside {spoken(base['before'])}; it began anew beside {spoken(base['chosen'])}, with "
        "which what was found is surely more likely, or has a name that it did not have"
    )


def _time_gaps(base: Mapping[str, Any]) -> str:
    """Equilibrium time gaps of the chosen model."""
    found = [
        f"{figure['value']:.2f} s ({figure['low']:.2f} to {figure['high']:.2f}) at {speed} m/s"
        for speed, figure in base["equilibrium_time_gap"].items()
        if figure is not None
    ]
    return f"time gap at equilibrium under {spoken(base['chosen'])}: {', '.join(found)}" if found else ""


def _dependences(verdict: Mapping[str, Any]) -> list[str]:
    """Effects that need the chosen model."""
    return [
        f"{described(effect)} holds beside {spoken(verdict['base']['chosen'])} and not beside "
        f"{' and '.join(map(spoken, effect['depends_on_base']))}: it depends on the car-following model"
        for effect in verdict["effects"]
        if effect.get("depends_on_base")
    ]
