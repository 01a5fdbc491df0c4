"""The document of a discovery: missing effects, error before and after, evidence and confidence."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from rearl_jax.config import DiscoverTask
from rearl_jax.core.effects import EFFECTS
from rearl_jax.discovery.report.base_section import base_section
from rearl_jax.discovery.report.candidate_results import RESULTS
from rearl_jax.discovery.report.error_block import IDM
from rearl_jax.discovery.report.failed_tests import failed_test_words
from rearl_jax.discovery.report.groups_section import groups_section
from rearl_jax.discovery.report.lane_choice_section import lane_choice_section
from rearl_jax.discovery.report.population import population_section
from rearl_jax.discovery.report.protocols import PROTOCOLS
from rearl_jax.discovery.report.variation import variation_section
from rearl_jax.discovery.report.words import (
    described,
    error_words,
    is_claimed,
    is_lane_choice,
    lane_choice_words,
    response_words,
    share_words,
    verdict_words,
    with_unit,
)
from rearl_jax.discovery.search.variables import title_of
from rearl_jax.discovery.thresholds import THRESHOLDS, meanings
from rearl_jax.document.document import DataSource, Document, Section
from rearl_jax.document.table import NONE, Cell, Row, Table, cell_of, number, percent, sentence, spoken

MOST_CANDIDATES, MOST_VARIABLES = 12, 5
"""Largest number of rows of their tables; candidates.parquet and maps.parquet contain all."""

MOST_PARAMETERS = 5
"""Largest number of parameters of an effect that are listed; effects with more are curves, which the maps show."""

_MEASURES = {
    "gap_rmse": "closed-loop gap error [m]",
    "speed_rmse": "closed-loop speed error [m/s]",
    "one_step": "error in predicting the next position [m]",
    "energy_score": "energy score of noisy simulations [m]",
}
"""Titles of the displayed measures, by their names in the verdict."""

_PROTOCOL_MEASURES = {
    "gap_rmse": "gap error [m]",
    "gap_nrmse": "gap error as a share of the gap [-]",
    "speed_rmse": "speed error [m/s]",
}
"""Titles of the measures that are stated for every protocol (source of the simulated driver's parameters)."""

CAPTIONS = {
    "maps": "Acceleration residual as a function of possible influences, with drivers' own means and parameters "
    "projected out; bands from resampling drivers. Red: calibrated model. Blue: with the added effects. Dotted: "
    "added acceleration. A curve that is flat within its band shows no remaining dependence.",
    "planes": "Acceleration residual as a function of two variables. Grey: too few time steps.",
    "evidence": "Evidence of the candidates. Grey: range if no effect is missing, up to the threshold. A "
    "candidate is accepted if it gains on the fitted and on other drivers.",
    "closed_loop": "Gap error of each report driver, simulated behind the measured leader, before and after effects "
    "were added, and the error from the drivers' own noise alone.",
    "innovations": "Innovations: prediction errors of the observer, white and normal for a correct model.",
    "example": "One report driver: gap measured and simulated with the parameters of the best one-step "
    "prediction; below, the acceleration residual.",
    "parameters": "Parameters of each fitted driver (squares: trucks), lines: medians. Effects missing from a model "
    "shift parameters from their true values.",
}


def document_of(
    config: DiscoverTask,
    verdict: Mapping[str, Any],
    maps: pd.DataFrame | None = None,
    sources: tuple[DataSource, ...] = (),
) -> Document:
    """The document of a discovery, from the content of verdict.json and of maps.parquet; without the latter, remaining
    dependences of the residual are left out. `sources` are the data sets with their licences.
    """
    data, candidates = verdict["data"], verdict["candidates"]
    following = [row for row in candidates if not is_lane_choice(row)]
    lanes = [row for row in candidates if is_lane_choice(row)]
    how_following = (
        f"Fitted to {data['drivers']['fitted']} drivers and checked on {data['drivers']['checked']} others; errors "
        f"are those of {data['drivers']['reported']} more, who were used for neither. A candidate is accepted if "
        "it gains on the fitted drivers and on those on whom it was checked."
    )
    how_lanes = (
        "Drivers change to lanes in which they accelerate more. A candidate is accepted if it explains further "
        "changes, also of drivers that it was not fitted to."
    )
    if lanes:
        how_lanes = f"{sentence(lane_choice_words(verdict['lane_choice']))} {how_lanes}"
    sections = (
        groups_section(verdict),
        _error_section(verdict["error"]),
        base_section(verdict),
        _effect_section(verdict),
        _failed_section(verdict.get("failed_tests", ())),
        _protocol_section(verdict["error"]),
        _section("Candidates", how_following, _candidate_table("Candidates of car following", following, verdict)),
        _section("Lane choice", how_lanes, _candidate_table("Candidates of lane choice", lanes, verdict)),
        lane_choice_section(verdict),
        Section("Notes on data and model", notes=tuple(map(sentence, data["notes"]))),
        population_section(verdict),
        variation_section(verdict),
        _unexplained_section(verdict, maps),
        _section(
            "Effects that these data could not show",
            "Weaker effects than these are not excluded.",
            _unseen_table(verdict["unseen"]),
            is_folded=True,
        ),
        _definition_section(data["car_following"], config.discover.confidence),
        _section(
            "Thresholds of the decision",
            "Every number that decides what is claimed.",
            _threshold_table(verdict.get("thresholds", {})),
            is_folded=True,
        ),
    )
    return Document(
        title="Effects missing from the traffic model",
        verdict=sentence(verdict_words(verdict)),
        sections=tuple(part for part in sections if part.paragraphs or part.tables or part.notes),
        command="discover",
        generated=data["generated"],
        data=f"{data['recordings']} recordings, {data['driver_seconds'] / 60:.0f} driver-minutes of "
        f"{sum(data['drivers'].values())} drivers who follow a leader, one time step every {data['step']:.2g} s, "
        f"positions with {data['position_noise']:.2f} m of noise.",
        sources=sources,
        captions=CAPTIONS,
    )


def _section(title: str, words: str, table: Table, *, is_folded: bool = False) -> Section:
    """A section of one table; empty if the table has no rows."""
    return Section(title, (words,), (table,), is_folded=is_folded) if table.rows else Section(title)


def _error_section(error: Mapping[str, Any]) -> Section:
    columns = ("before", "after", "change")
    rows = [
        Row(title, tuple(cell_of(error["all"][name][key], "+" if key == "change" else "") for key in columns))
        for name, title in _MEASURES.items()
    ]
    noise, times = error["noise_alone"], error["response_time"]
    rows.append(Row("gap error by the drivers' own noise alone [m]", (Cell(""), cell_of(noise), Cell(""))))
    if any(times.values()):
        cells = (cell_of(times[model], "+") for model in ("before", "after"))
        rows.append(Row("response time beyond the model's [s]", (*cells, Cell(""))))
    words = sentence(error_words(error)) + share_words(error) + response_words(error)
    table = Table("Errors on drivers not used in the fit", _headings(error), tuple(rows))
    return Section("Error before and after", (words,), (table, _protocol_table(error)))


def _headings(error: Mapping[str, Any]) -> tuple[str, str, str]:
    return "before", "after" if error["oracle"] is None else "with the given effect", "change"


def _protocol_table(error: Mapping[str, Any]) -> Table:
    """Table of the mean gap error by protocol."""
    tested = {name: errors for name, errors in error["protocols"].items() if errors is not None}
    means = {name: errors["gap_rmse"]["mean"] for name, errors in tested.items()}
    has_idm = any(mean.get(IDM, mean["before"]) != mean["before"] for mean in means.values())
    rows = []
    for name, mean in means.items():
        cells = [Cell(str(tested[name]["n_drivers"])), *_error_cells(mean)]
        if has_idm:
            cells += [cell_of(mean[IDM]), _share_cell(mean[f"{IDM}_share"])]
        rows.append(Row(spoken(name), tuple(cells)))
    before, after, _ = _headings(error)
    headings = ["drivers", "population [m]", f"{before} [m]", f"{after} [m]", "change"]
    if has_idm:
        headings += ["calibrated IDM [m]", f"{after} against it"]
    title = "Mean closed-loop gap error, by source of the driver's parameters"
    return Table(title, tuple(headings), tuple(rows))


def _protocol_section(error: Mapping[str, Any]) -> Section:
    """Section of every measure under every protocol."""
    tables, notes, title = [], [], "Errors by source of a driver's parameters"
    for name, errors in error["protocols"].items():
        notes.append(f"{spoken(name)}: {PROTOCOLS[name]}")
        if errors is None:
            notes[-1] += "; no driver could be tested"
            continue
        if errors["left_out"]:
            notes[-1] += f"; {errors['left_out']} drivers were recorded too briefly and are left out"
        rows = [
            Row(f"{statistic} {label}", _error_cells(figures))
            for measure, label in _PROTOCOL_MEASURES.items()
            for statistic, figures in errors[measure].items()
        ]
        tables.append(Table(spoken(name).capitalize(), ("population", *_headings(error)), tuple(rows)))
    how = (
        "All errors are of simulations behind the measured leader. Protocols differ in the source of the driver's "
        "parameters. Population: error of the model before, on the same drives, with parameters of the population."
    )
    return Section(title, (how,), tuple(tables), tuple(map(sentence, notes)), is_folded=True)


def _error_cells(figures: Mapping[str, Any]) -> tuple[Cell, ...]:
    """Errors with the population's parameters, before and after, and the change as a share."""
    errors = (cell_of(figures[name]) for name in ("population", "before", "after"))
    return (*errors, _share_cell(figures["change_share"]))


def _share_cell(value: Mapping[str, Any]) -> Cell:
    share, low, high = (100 * value[name] for name in ("value", "low", "high"))
    return Cell(f"{share:+.1f} %", f"{low:+.1f} to {high:+.1f}")


def _effect_section(verdict: Mapping[str, Any]) -> Section:
    """Section of faults that the columns show, effects with parameters and equations, and equally good candidates."""
    effects, notes = verdict["effects"], []
    for effect in effects:
        if effect["name"] in EFFECTS:
            notes.append(f"{described(effect)}: {EFFECTS[effect['name']].equation}")
    for row in verdict["candidates"]:
        if row["ambiguous"]:
            notes.append(f"{described(row)} explains the data equally well; to distinguish: {row['told_apart_by']}")
    rows = tuple(row for effect in effects for row in _effect_rows(effect))
    tables = (Table("Effects and their parameters", ("parameter", "value", "confidence"), rows),) if rows else ()
    findings = tuple(f"The columns themselves show: {finding}." for finding in verdict["data"]["findings"])
    return Section("Findings", findings, tables, tuple(map(sentence, notes)))


def _effect_rows(effect: Mapping[str, Any]) -> list[Row]:
    cells = [(Cell(with_unit(name, value["unit"])), cell_of(value)) for name, value in effect["parameters"].items()]
    if not 0 < len(cells) <= MOST_PARAMETERS:
        cells = [(Cell(f"a curve through {len(cells)} values" if cells else NONE), Cell(NONE))]
    return [Row(described(effect), (*pair, Cell(f"{effect['confidence']:.2f}"))) for pair in cells]


def _candidate_table(title: str, rows: Sequence[Mapping[str, Any]], verdict: Mapping[str, Any]) -> Table:
    shown = []
    for row in rows[:MOST_CANDIDATES]:
        figures = (NONE if row[name] is None else f"{row[name]:.1f}" for name in ("z_score", "gain", "check"))
        shown.append(Row(described(row), (*map(Cell, figures), Cell(_result(row, verdict)))))
    if len(rows) > len(shown):
        title += f" (the first {MOST_CANDIDATES} of {len(rows)}; candidates.parquet has all)"
    return Table(title, ("z-score [σ]", "gain [nats]", "on others [nats]", "result"), tuple(shown))


def _result(row: Mapping[str, Any], verdict: Mapping[str, Any]) -> str:
    if row["ambiguous"]:
        return "not distinguished"
    return "named" if is_claimed(row, verdict) else RESULTS.get(row.get("result", ""), "")


def _failed_section(failed_tests: Sequence[Mapping[str, Any]]) -> Section:
    words = "With the effects found, the remaining errors are more than noise, or an effect is in doubt."
    notes = tuple(sentence(failed_test_words(failed)) for failed in failed_tests)
    return Section("Tests that the final model fails", (words,) if notes else (), notes=notes)


def _unexplained_section(verdict: Mapping[str, Any], maps: pd.DataFrame | None) -> Section:
    """Section on the remaining errors of the final model: measures of its innovations, and sparse regression over all
    variables.
    """
    sentences, tables, adequacy = [], [], verdict["adequacy"]
    if adequacy is not None:
        name = spoken(adequacy["remaining"]["name"]).replace(".", " on ")
        sentences.append(
            f"Innovations one time step apart correlate by {adequacy['autocorrelation']:+.3f}, by "
            f"{adequacy['autocorrelation_by_noise']:+.3f} with noise alone; their excess kurtosis is "
            f"{adequacy['kurtosis']:+.2f} (0 or less for a right model); the strongest candidate left is {name} at "
            f"{adequacy['remaining']['z_score']:.1f} σ."
        )
    if maps is not None:
        variables = maps.drop_duplicates(["model", "variable"]).sort_values(["selected", "gain"], ascending=False)
        by_model = dict(list(variables.groupby("model")))
        before, final = by_model["before"], by_model.get("after", by_model["before"])
        text = f"Without any list of effects, sparse regression over curves of every variable {_depends_on(before)}."
        if "after" in by_model:
            text += f" After the repair it {_depends_on(final)}."
        best = final.loc[final["share"].idxmax()]
        sentences += [
            text,
            f"Any single variable still predicts at most {percent(max(best['share'], 0.0))} of the remaining "
            f"acceleration residual, on other drivers ({title_of(best['variable'])}).",
        ]
        rows = tuple(_variable_row(row) for row in before.head(MOST_VARIABLES).to_dict("records"))
        headings = ("selected", "share", "shape of the residual")
        tables = [Table("Acceleration residual of the calibrated model, by variable", headings, rows)]
    return Section("What the model leaves unexplained", tuple(sentences), tuple(tables), is_folded=True)


def _depends_on(variables: pd.DataFrame) -> str:
    stable = variables.loc[variables["selected"] >= THRESHOLDS.stable_share, "variable"]
    return f"finds a dependence on {', '.join(map(title_of, stable))}" if len(stable) else "finds nothing"


def _variable_row(row: Mapping[Any, Any]) -> Row:
    words = row["shape"] + ("; predicts better as a change of the time gap" if row["acts_on"] == "time_gap" else "")
    cells = (f"{100 * row['selected']:.0f} %", percent(max(row["share"], 0.0)), words)
    return Row(title_of(row["variable"]), tuple(map(Cell, cells)))


def _unseen_table(effects: Sequence[Mapping[str, Any]]) -> Table:
    rows = tuple(
        Row(spoken(row["name"]), (Cell(with_unit(row["parameter"], row["unit"])), Cell(number(row["strength"]))))
        for row in effects
    )
    return Table("Weakest detectable effects", ("parameter", "least value"), rows)


def _definition_section(car_following: str, confidence: float) -> Section:
    how = (
        f"Every fitted driver was calibrated with the car-following model {car_following}. Its prediction errors "
        "were compared with those that each candidate would cause, and with those of simulations in which no effect "
        "is missing. Candidates that exceed chance were fitted, and had to gain on the check drivers too."
    )
    definitions = (
        "Closed-loop gap error: the driver, with the parameters that fit its gap best, is simulated behind the "
        "measured leader; root mean square over time steps, then over drivers.",
        f"Intervals: {100 * confidence:g} %. Of errors, gains and time gaps: from resampling drivers. Of parameters of "
        "effects: normal, from the curvature of the likelihood or the scatter of its slopes between drivers, widened "
        f"by a factor of {THRESHOLDS.interval_stretch:g} for car following. Of MOBIL's parameters: posterior.",
        "Confidence: stated probability that the effect is present, provided that the true effect is among the "
        "candidates.",
        "Z-score: evidence above its mean if no effect is missing, in standard deviations of that evidence; for lane "
        "choice, the slope of the likelihood in standard deviations between drivers.",
        "Gain: rise of the log-likelihood of the fitted drivers, less the complexity penalty; on others: rise for the "
        "check drivers, for whom only the parameters of each driver were fitted.",
        "Selected: share of random halves of the drivers in which sparse regression selects the variable; from "
        f"{100 * THRESHOLDS.stable_share:.0f} % on it counts as influential.",
        "Share: explained share of the variance of the acceleration residual, on drivers that the curve was not "
        "fitted to.",
    )
    return Section("Method and definitions", (how,), notes=definitions, is_folded=True)


def _threshold_table(thresholds: Mapping[str, float]) -> Table:
    texts = meanings()
    rows = (Row(spoken(name), (Cell(f"{value:g}"), Cell(texts.get(name, "")))) for name, value in thresholds.items())
    return Table("Thresholds", ("value", "meaning"), tuple(rows))
