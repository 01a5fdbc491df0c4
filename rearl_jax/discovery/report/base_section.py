"""Section of the document that compares car-following models.

Models are calibrated to the fitted drivers and compared on the check drivers, to whom nothing but their own parameters
is fitted.
"""

from collections.abc import Mapping
from typing import Any

from rearl_jax.discovery.report.protocols import PROTOCOLS
from rearl_jax.discovery.report.words import base_words, described, with_interval
from rearl_jax.document.document import Section
from rearl_jax.document.table import Cell, Row, Table, cell_of, percent, sentence, spoken


def base_section(verdict: Mapping[str, Any]) -> Section:
    """Section with a row per model, its evidence and mean gap errors; empty if no models were compared."""
    base, title = verdict.get("base"), "Car-following models compared"
    if base is None:
        return Section(title)
    shown = [name for name in PROTOCOLS if any(row["protocols"][name] for row in base["compared"])]
    headings = ("gain [nats]", "most likely in", *(f"{spoken(name)} [m]" for name in shown), "result")
    rows = []
    for row in base["compared"]:
        tested = (row["protocols"][name] for name in shown)
        errors = (cell_of(errors and errors["gap_rmse"]["mean"]) for errors in tested)
        gain = cell_of(None if row["name"] == base["driver"] else row["gain"], "+")
        result = "chosen" if row["name"] == base["chosen"] else "rejected by simulations" if row["is_vetoed"] else ""
        rows.append(Row(spoken(row["name"]), (gain, Cell(percent(row["best_share"])), *errors, Cell(result))))
    drivers = base["drivers"]
    how = (
        f"Each was calibrated to {drivers['fitted']} of the fitted drivers and evaluated on {drivers['checked']} "
        f"check drivers, who are others. Gain: log-likelihood above that of {spoken(base['driver'])}, with every "
        "driver's own parameters integrated out, which penalises additional parameters. Most likely in: share of "
        "resamples of drivers. Errors: mean closed-loop gap errors of the check drivers, by source of the parameters; "
        "models that are significantly less likely than the best were not simulated."
    )
    notes = [note for note in (_earlier_model(base), _time_gaps(base), *_dependences(verdict)) if note]
    outcome = base_words(base) or f"no model is significantly better than {spoken(base['driver'])}, which is kept"
    return Section(
        title, (f"{sentence(outcome)} {how}",), (Table(title, headings, tuple(rows)),), tuple(map(sentence, notes))
    )


def _earlier_model(base: Mapping[str, Any]) -> str:
    """Sentence on the model that was chosen before any effect was found; empty if it is still the chosen one."""
    if base.get("before") is None:
        return ""
    return (
        f"the search started with {spoken(base['before'])} and was repeated with {spoken(base['chosen'])}, under which "
        "the effects found are significantly more likely, or have names that they did not have before"
    )


def _time_gaps(base: Mapping[str, Any]) -> str:
    """Sentence on the equilibrium time gaps of the chosen model."""
    time_gaps = [
        f"{with_interval(figure, '.2f', ' s')} at {speed} m/s"
        for speed, figure in base["equilibrium_time_gap"].items()
        if figure is not None
    ]
    return f"time gap at equilibrium under {spoken(base['chosen'])}: {', '.join(time_gaps)}" if time_gaps else ""


def _dependences(verdict: Mapping[str, Any]) -> list[str]:
    """Sentences on effects that are found with the chosen model but not with all others."""
    return [
        f"{described(effect)} holds with {spoken(verdict['base']['chosen'])} but not with "
        f"{' and '.join(map(spoken, effect['depends_on_base']))}: it depends on the car-following model"
        for effect in verdict["effects"]
        if effect.get("depends_on_base")
    ]
