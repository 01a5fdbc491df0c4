"""Document of the study of recorded traffic: verdicts, errors by calibration protocol, time gaps and known values.

A protocol says which data the parameters of a driver come from, see `rearl_jax.discovery.report.protocols`.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.discovery.report.protocols import PROTOCOLS
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Cell, Row, Table, number, percent, spoken, table_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.study.real.known import TOLERANCE
from rearl_jax.study.real.table import SPEEDS, WORSE_INCREASE

VERDICTS = ("named", "improved", "unexplained", "artefact", "nothing")
"""Verdicts of a discovery, strongest first."""


def summary_of(table: pd.DataFrame, facts: pd.DataFrame, differences: pd.DataFrame) -> dict[str, Any]:
    """Figures of summary.json; None for values that were not computed.

    - `n_sets`, `n_groups`, `n_worse`: sets, groups of drivers, groups with a protocol in which the repaired model is
      worse; `n_named` and so on: groups with each of VERDICTS.
    - `n_known`: known time gaps; `n_within`, `n_within_model_free`: those met within TOLERANCE by calibrated drivers,
      and by the time gaps measured without a model.
    - `n_cars`, `n_shorter`: cars that drove in the settings S (short) and L (long) of their adaptive cruise control,
      and those whose time gap is shorter in S.
    - `leader_difference`, with `_low` and `_high`: time gap behind ACC minus that behind a person, for the same drivers
      [s]; `leader_cars`: number of these drivers; `is_leader_equal`: whether the interval contains 0.
    """
    counts = Counter(table["verdict"].tolist())
    known = facts.dropna(subset=["known"])
    difference = known["model_free"].to_numpy(float, na_value=np.nan) - known["known"].to_numpy(float, na_value=np.nan)
    summary: dict[str, Any] = {
        "n_sets": len(set(table["set"].tolist())),
        "n_groups": len(table),
        "n_worse": sum(name != "" for name in table["worse_in"].tolist()),
        **{f"n_{word}": counts[word] for word in VERDICTS},
        "n_known": len(known),
        "n_within": sum(value is True for value in known["within"].astype(object).tolist()),
        "n_within_model_free": int((np.abs(difference) <= TOLERANCE).sum()),
    }
    long_less_short = _difference(differences, "L", "S")
    summary |= {"n_cars": None, "n_shorter": None}
    if long_less_short is not None:
        summary |= {"n_cars": int(long_less_short["cars"]), "n_shorter": int(long_less_short["longer"])}
    leader = _difference(differences, "ACC", "person")
    names = ("leader_difference", "leader_difference_low", "leader_difference_high", "leader_cars", "is_leader_equal")
    summary |= dict.fromkeys(names)
    if leader is not None:
        value, low, high = (float(leader[end]) for end in ("value", "low", "high"))
        figures = (value, low, high, int(leader["cars"]), low <= 0.0 <= high)
        summary |= dict(zip(names, figures, strict=True))
    return summary


def _difference(differences: pd.DataFrame, first: str, second: str) -> Mapping[str, Any] | None:
    """Difference between two settings for calibrated drivers, in the first set with both."""
    wanted = {"method": "calibrated", "first": first, "second": second}
    for row in differences.astype(object).to_dict("records"):
        if all(row[name] == value for name, value in wanted.items()):
            return {str(name): value for name, value in row.items()}
    return None


def document_of(
    table: pd.DataFrame, facts: pd.DataFrame, differences: pd.DataFrame, remarks: Remarks, *, generated: bool
) -> Document:
    """The document of real.parquet, facts.parquet and differences.parquet; `generated` is true if any of the data were
    generated.
    """
    summary = summary_of(table, facts, differences)
    groups = pd.DataFrame(table).assign(name=table["title"] + ", " + table["group"])
    sections = (
        _verdicts(groups),
        _errors(groups),
        *(() if facts.empty else (_score(summary, facts), _time_gaps(facts), _differences(differences))),
    )
    return Document(
        title="What the driver model lacks in real recordings",
        verdict=_verdict(summary),
        sections=sections,
        command="study real",
        generated=generated,
        data=remarks.data,
        sources=remarks.sources,
    )


def _verdict(summary: Mapping[str, Any]) -> str:
    counts = ", ".join(f"{summary[f'n_{word}']} {word}" for word in VERDICTS if summary[f"n_{word}"])
    text = f"Groups of drivers: {counts}"
    if summary["n_known"]:
        text += (
            f"; {summary['n_within']} of {summary['n_known']} known time gaps are met within {TOLERANCE:g} s by "
            "calibrated drivers"
        )
    return f"{text}."


def _verdicts(groups: pd.DataFrame) -> Section:
    columns = {"name": "", "drivers": "drivers", "base": "base model", "verdict": "verdict", "effects": "effects"}
    columns |= {"failed_tests": "failed tests"}
    columns |= {f"time_gap_{speed}": f"time gap at {speed} m/s [s]" for speed in SPEEDS} | {"worse_in": "worse in"}
    spoken_words = {"base": groups["base"].map(spoken), "effects": groups["effects"].replace("", None)}
    for column in ("failed_tests", "worse_in"):
        spoken_words[column] = groups[column].map(lambda names: ", ".join(map(spoken, names.split(","))) or None)
    explanation = (
        "Each group was calibrated and searched alone; its folder in sets/ has candidates, curves and the repaired "
        "model. Time gaps are those at equilibrium behind a leader of constant speed, medians of the calibrated "
        "drivers. Failed tests: why the model with all effects found does not explain the drivers, with figures on the "
        f"page of the set. Worse in: protocols in which the repaired model's mean gap error is more than "
        f"{percent(WORSE_INCREASE)} above that of the base model.",
    )
    return Section("Verdicts", explanation, (table_of("Verdicts", groups.assign(**spoken_words), columns),))


def _errors(groups: pd.DataFrame) -> Section:
    """Section with a table per protocol; protocols in which no group could be tested are left out."""
    tables = []
    for protocol, meaning in PROTOCOLS.items():
        tested = groups[groups[f"{protocol}_before"].notna()]
        if tested.empty:
            continue
        columns = {"name": "", f"{protocol}_drivers": "drivers", f"{protocol}_before": "before [m]"}
        columns |= {f"{protocol}_after": "after [m]", f"{protocol}_change": "change [m]", "share": "change [%]"}
        columns |= {f"{protocol}_idm": "calibrated IDM [m]", "idm_share": "after against it [%]"}
        share = {
            f"{shown}{end}": 100 * tested[f"{protocol}_{name}{end}"]
            for shown, name in (("share", "change_share"), ("idm_share", "idm_share"))
            for end in ("", "_low", "_high")
        }
        tables.append(table_of(f"{spoken(protocol)}: {meaning}", tested.assign(**share), columns))
    explanation = (
        "Root mean square error of the gap, simulated behind the measured leader; mean over the report drivers, "
        "who were used neither in the fit nor in the search.",
    )
    return Section("Gap error before and after, by protocol", explanation, tuple(tables))


def _score(summary: Mapping[str, Any], facts: pd.DataFrame) -> Section:
    """Section on known time gaps of these vehicles, and their agreement with the results."""
    rows = []
    if summary["n_known"]:
        for key, method in (("n_within", "calibrated drivers"), ("n_within_model_free", "measured without a model")):
            cell = Cell(f"{summary[key]} of {summary['n_known']}")
            rows.append(Row(f"known time gaps within {TOLERANCE:g} s, {method}", (cell,)))
    if summary["n_cars"] is not None:
        rows.append(
            Row("shorter in setting S than in L", (Cell(f"{summary['n_shorter']} of {summary['n_cars']} cars"),))
        )
    if summary["is_leader_equal"] is not None:
        low, high = (number(summary[f"leader_difference_{end}"], "+") for end in ("low", "high"))
        answer = f"{'yes' if summary['is_leader_equal'] else 'no'}, {summary['leader_cars']} persons"
        rows.append(Row("behind ACC not distinguished from behind people", (Cell(answer, f"{low} to {high} s"),)))
    if not rows:
        return Section("Facts", (f"No time gap is known of these {len(facts)} cars and settings.",))
    return Section("Facts", tables=(Table("Known facts of these vehicles", ("confirmed",), tuple(rows)),))


def _time_gaps(facts: pd.DataFrame) -> Section:
    columns = {"name": "", "tracks": "tracks", "runs": "runs", "speed": "speed [m/s]", "model_free": "measured [s]"}
    columns |= {"calibrated": "calibrated [s]", "difference": "difference [s]", "known": "known [s]"}
    spread = {
        f"{name}{end}": facts[name] + sign * facts[f"{name}_deviation"]
        for name in ("model_free", "known")
        for end, sign in (("_low", -1), ("_high", 1))
    }
    shown = facts.assign(name=facts["car"] + ", " + facts["setting"], **spread)
    explanation = (
        "Measured without a model: median of gap over speed in intervals near equilibrium, and one standard error "
        "between runs on either side. Calibrated: the chosen car-following model at the median speed of these "
        "intervals, median over a car's tracks.",
    )
    tables = tuple(
        table_of(str(title), rows.dropna(axis=1, how="all"), columns)
        for title, rows in shown.groupby("title", sort=False)
    )
    return Section("Time gaps by car and setting", explanation, tables, is_folded=True)


def _differences(differences: pd.DataFrame) -> Section:
    headings = {"name": "", "method": "method", "cars": "cars", "first_mean": "first [s]", "second_mean": "second [s]"}
    headings |= {"value": "difference [s]", "longer": "longer in the first"}
    title = differences["title"] + ": " + differences["first"] + " and " + differences["second"]
    shown = differences.assign(
        name=title,
        method=differences["method"].map(spoken),
        value_low=differences["low"],
        value_high=differences["high"],
    )
    explanation = ("Mean over the cars, or persons, that drove in both, with an interval over them.",)
    return Section("Differences between settings", explanation, (table_of("Differences", shown, headings),))
