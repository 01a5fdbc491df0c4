"""Section of the document on predicted lane changes of held-out drivers."""

from collections.abc import Mapping
from typing import Any

from rearl_jax.discovery.lane_changes.mobil import MobilRule
from rearl_jax.discovery.lane_changes.prediction import (
    BASE_RATE,
    CALIBRATED,
    HAZARD,
    LARGE_ADVANTAGE,
    LEAST_CHANGES,
    LEAST_IN_PART,
    ORIGINAL,
    PREDICTORS,
)
from rearl_jax.discovery.report.words import with_unit
from rearl_jax.document.document import Section
from rearl_jax.document.table import Cell, Row, Table, cell_of, number, percent, sentence

TITLE = "Lane changes of other drivers"

STRATA = {
    "all": "all",
    "left": "to the left",
    "right": "to the right",
    "no_advantage": "target lane not faster",
    "small_advantage": f"faster by less than {3.6 * LARGE_ADVANTAGE:.0f} km/h",
    "large_advantage": f"faster by {3.6 * LARGE_ADVANTAGE:.0f} km/h or more",
    "mandatory": "mandatory, towards a ramp lane reached later",
}
"""Titles of the strata, by their names in the verdict."""

_SHOWN = (ORIGINAL, CALIBRATED, HAZARD)
"""Models compared by side and urgency."""

_MEASURES = {"less_base_rate": "log loss less that of the constant rate", "balanced_accuracy": "balanced accuracy"}
"""Titles of the measures compared by side and urgency, by their names in the verdict."""


def lane_choice_section(verdict: Mapping[str, Any]) -> Section:
    """Section with scores of every model, scores by side and urgency, and MOBIL's parameters, or with the reason why
    there are none; empty if the verdict has no entry for them.
    """
    lanes = verdict.get("lane_choice")
    if not lanes or "prediction" not in lanes:
        return Section(TITLE)
    prediction = lanes["prediction"]
    if prediction is None:
        reason = (
            f"No prediction of lane changes is scored, and MOBIL is not calibrated. {LEAST_CHANGES} recorded changes "
            f"are needed, and {LEAST_IN_PART} by choice of the drivers who are fitted and of those who are held out: "
            f"there are {lanes['changes']} in all"
        )
        return Section(TITLE, (sentence(reason),))
    tables = (_model_table(prediction), *(_strata_table(prediction, name, title) for name, title in _MEASURES.items()))
    return Section(TITLE, (_summary(prediction),), (*tables, _mobil_table(prediction)), _notes(prediction))


def significantly_worse(prediction: Mapping[str, Any]) -> list[str]:
    """Names of the models whose log loss is significantly above that of the constant rate."""
    models = prediction["strata"]["all"]["models"]
    return [name for name, scores in models.items() if scores["less_base_rate"]["low"] > 0]


def _summary(prediction: Mapping[str, Any]) -> str:
    every, fitted = prediction["strata"]["all"], prediction["fitted"]
    text = (
        f"{every['changes']} changes by choice of {every['drivers']} drivers in {every['seconds'] / 60:.1f} minutes, "
        f"predicted twice a second from {fitted['changes']} changes of {fitted['drivers']} others."
    )
    worse = [PREDICTORS[name] for name in significantly_worse(prediction)]
    if worse:
        text += f" Significantly worse than the constant rate: {', '.join(worse)}."
    original, calibrated = (every["models"][name]["log_loss"]["value"] for name in (ORIGINAL, CALIBRATED))
    if calibrated >= original:
        text += " Calibrated MOBIL is not better than original MOBIL."
    if every["models"][CALIBRATED]["less_base_rate"]["high"] >= 0:
        text += " Calibrated MOBIL is not significantly better than the constant rate."
    return text


def _model_table(prediction: Mapping[str, Any]) -> Table:
    every = prediction["strata"]["all"]
    rows = []
    for name, title in PREDICTORS.items():
        scores = every["models"][name]
        less = cell_of(None if name == BASE_RATE else scores["less_base_rate"], "+")
        cells = (cell_of(scores["log_loss"]), less, cell_of(scores["balanced_accuracy"]))
        rows.append(Row(title, (*cells, Cell(f"{scores['expected']:.0f}"))))
    headings = (
        "log loss [nats/s]",
        "less that of the constant rate",
        "balanced accuracy",
        f"changes expected, {every['changes']} made",
    )
    return Table("Predictions of lane changes of drivers not used in the fit", headings, tuple(rows))


def _strata_table(prediction: Mapping[str, Any], measure: str, title: str) -> Table:
    rows = []
    for name, scores in prediction["strata"].items():
        sign = "+" if measure == "less_base_rate" else ""
        cells = (cell_of(scores["models"][model][measure], sign) for model in _SHOWN)
        rows.append(Row(STRATA[name], (Cell(str(scores["changes"])), Cell(f"{scores['seconds'] / 60:.1f}"), *cells)))
    headings = ("changes", "driver-minutes", *(PREDICTORS[name] for name in _SHOWN))
    return Table(f"{title.capitalize()}, by side and urgency", headings, tuple(rows))


def _mobil_table(prediction: Mapping[str, Any]) -> Table:
    original, rows = MobilRule(), []
    for name, estimate in prediction["mobil"].items():
        cells = (Cell(number(getattr(original, name))), cell_of(estimate))
        rows.append(Row(with_unit(name, estimate["unit"]), cells))
    return Table("Parameters of MOBIL", ("original", "calibrated"), tuple(rows))


def _notes(prediction: Mapping[str, Any]) -> tuple[str, ...]:
    every = prediction["strata"]["all"]
    notes = (
        f"of {prediction['recorded']} recorded changes {prediction['ramp']} are from or to a ramp lane, "
        f"mandatory and not scored; {prediction['fitted']['changes'] + every['changes']} are discretionary, with "
        "leaders and gaps in the recording",
        "MOBIL predicts the changes that its rule accepts, the hazard (a probability that depends on the own gain and "
        "the effects found) those whose probability is above the constant rate of the side; balanced "
        "accuracy is the mean of the correctly predicted shares of changes and of non-changes, .5 without information",
        "original MOBIL changes lanes within its delay whenever its rule allows a change, and excludes other "
        "changes; here it has the fitted drivers' rate of refused changes, because its log loss would otherwise "
        "be infinite",
        f"calibrated MOBIL refuses {percent(prediction['refused_share'])} of the recorded changes: a simulation "
        "with it makes fewer changes by this share",
        "urgency is estimated from the recording: the speed advantage of the target lane, and a ramp lane that "
        "the driver reaches later; destinations beyond the recording are unknown",
    )
    return tuple(map(sentence, notes))
