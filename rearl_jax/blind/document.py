"""The document of a blind study: rates and goals, outcomes by set, confusion matrix."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.blind.details import SET_TITLES
from rearl_jax.blind.judging import OUTCOMES
from rearl_jax.blind.questions import QUESTIONS
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import percent, table_of

STRATA = "strata"
TABLES = ("scores", "sets", STRATA, "confusion", "parameters", "calibration", "cases")
"""Tables of a study that its document shows."""

CAPTIONS = {
    "confusion": "Number of data sets by hidden effect (rows) and first reported effect (columns); colours show "
    "the share of the row. Effects named by another correct name are on the diagonal.",
    "strengths": "Share of data sets with one hidden effect in which it is named. Blue: all effects together; grey: "
    "each effect.",
}

_SCORES = {"title": "", "n_hits": "hits", "n_cases": "of", "rate": "rate [%]", "goal": "goal", "is_met": "reached"}
_STRATA = {
    "stratum": "",
    "n_effects": "effects",
    "named": "named [%]",
    "n": "data sets",
    "false": "with a false effect [%]",
    "n_controls": "controls",
    "claimed": "with an effect or improvement [%]",
    "n_intervals": "intervals",
    "covered": "that contain the truth [%]",
    "n_changed": "changed models",
    "n_rose": "error rose",
}
_PRIORS = {"name": "", "low": "low", "high": "high", "unit": "unit", "scale": "uniform in", "meaning": "meaning"}
_CLAIMS = {"stated_as": "", "n_claims": "effects", "stated": "mean stated [%]", "true": "correct [%]"}
_PARAMETERS = {
    "effect": "",
    "parameter": "parameter",
    "n": "data sets",
    "truth": "mean truth",
    "bias": "bias",
    "rms_error": "rms error",
    "n_intervals": "intervals",
    "coverage": "share that contain the truth",
}
_CASES = ("variant", "set", "verdict", "named", "outcome", "confidence", "before", "after", "floor", "seconds")


def document_of(
    summary: Mapping[str, Any], tables: Mapping[str, pd.DataFrame], protocol: Mapping[str, Any]
) -> Document:
    """The document of a blind study, from summary.json, protocol.json and TABLES by name, as in the Parquet files."""
    sets = tables["sets"]
    counts = {f"n_{outcome}": outcome for outcome in OUTCOMES if sets[f"n_{outcome}"].to_numpy().any()}
    outcomes = {"set": "", "n": "data sets", **counts, "n_false": "with a false effect", "rate": "share [%]"}
    reported = tables["confusion"].melt("hidden", var_name="reported", value_name="n", ignore_index=False)
    reported = reported.query("n > 0").sort_index(kind="stable")
    explanation = (
        "With a false effect: data sets with at least one wrongly reported effect. Their outcome may be any, because a "
        "correct effect may be reported as well. A fitted curve over a variable counts as an effect.",
    )
    parts = (
        (Section("Rates", notes=tuple(_notes(summary, tables, protocol))), _rates(tables["scores"]), _SCORES),
        (Section("Outcomes by set", explanation), _rates(sets.replace({"set": SET_TITLES})), outcomes),
        (Section("Broad priors, by stratum"), _strata(tables), _STRATA),
        (Section("Broad priors", is_folded=True), _priors(summary), _PRIORS),
        (
            Section("Reported effects by hidden effect"),
            reported,
            {"hidden": "", "reported": "reported", "n": "data sets"},
        ),
        (Section("Reported effects by their stated confidence"), _claims(tables["calibration"]), _CLAIMS),
        (
            Section("Parameters that the generator and the library share", is_folded=True),
            tables["parameters"],
            _PARAMETERS,
        ),
        (Section("Data sets", is_folded=True), tables["cases"], _CASES),
    )
    return Document(
        title="Blind study of discovery",
        verdict=f"Discovery was right about {summary['n_right']} of {summary['n_cases']} data sets whose hidden "
        "effects it was not told.",
        sections=(
            *(
                replace(section, tables=(table_of(section.title, frame, columns),))
                for section, frame, columns in parts
                if len(frame)
            ),
            _sealing(protocol),
        ),
        command="discover blind",
        generated=True,
        data=f"{summary['n_cases']} generated data sets, master seed {protocol['master_seed']}.",
        captions=CAPTIONS,
    )


def _rates(frame: pd.DataFrame, name: str = "rate") -> pd.DataFrame:
    """The table with a share and its exact 95 % interval in percent, named as `table_of` expects."""
    percents = 100 * frame[[name, "low", "high"]]
    return frame.assign(**{name: percents[name], f"{name}_low": percents["low"], f"{name}_high": percents["high"]})


def _strata(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    strata = tables.get(STRATA, pd.DataFrame())
    for name in ("named", "false", "claimed", "covered") if len(strata) else ():
        names = [name, f"{name}_low", f"{name}_high"]
        strata = strata.assign(**{key: 100 * strata[key].astype(float) for key in names})
    return strata


def _priors(summary: Mapping[str, Any]) -> pd.DataFrame:
    rows = pd.DataFrame(summary.get("priors", []))
    return rows.assign(scale=np.where(rows["is_log"], "logarithm", "value")) if len(rows) else rows


def _claims(calibration: pd.DataFrame) -> pd.DataFrame:
    if calibration.empty:
        return calibration
    ends = zip(calibration["from"], calibration["to"], strict=True)
    names = [f"{percent(low)} to {percent(high)}" for low, high in ends]
    return _rates(calibration, "true").assign(stated_as=names, stated=100 * calibration["stated"])


def _notes(
    summary: Mapping[str, Any], tables: Mapping[str, pd.DataFrame], protocol: Mapping[str, Any]
) -> Iterator[str]:
    yield (
        f"Code {protocol['code_hash']}, then master seed {protocol['master_seed']} "
        f"({_origin(protocol)}), then truth sealed as {protocol['truth_sha256'][:16]}."
    )
    if summary["n_drawn"] > summary["n_cases"]:
        yield f"{summary['n_cases']} of {summary['n_drawn']} data sets, the first in the study's random order."
    if summary["oracle_share"] is not None:
        yield (
            f"Repaired models achieve {percent(summary['oracle_share'])} of the largest possible reduction of the "
            f"squared error, that of the oracle, in {summary['n_oracles']} data sets."
        )
    if counts := summary.get("redraws"):
        listed = ", ".join(f"{reason.replace('_', ' ')} {n}" for reason, n in counts.items() if n)
        yield (
            f"Broad priors {protocol['priors_hash']}; draws that were rejected before the truth was sealed: "
            f"{sum(counts.values())}{f' ({listed})' if listed else ''}."
        )
    parameters = tables["parameters"]
    if len(parameters) and (n_intervals := int(parameters["n_intervals"].to_numpy().sum())):
        n_covered = (parameters["coverage"].astype(float) * parameters["n_intervals"]).sum()
        yield f"Intervals of parameters that contain the truth: {n_covered:.0f} of {n_intervals}."
    if summary["median_seconds"] is not None:
        yield f"Median time of a verdict: {summary['median_seconds']:.1f} s."
    if not_counted := [question.title for question in QUESTIONS if question.needs not in ("", *tables["cases"])]:
        yield (
            "Not counted again but kept as first counted, as cases.parquet has no ends of intervals: "
            f"{'; '.join(not_counted)}."
        )


def _sealing(protocol: Mapping[str, Any]) -> Section:
    explanation = (
        f"First the hash of all sources was stored. Then the master seed was {_origin(protocol)}. Then the truth was "
        "written to one file, and the hash of this file to the protocol. Only then did discovery receive the first "
        "data set. Names and contents of the folders that it received do not reveal the truth. The file with the "
        "truth was opened once, after the last verdict.",
        f"Code {protocol['code_hash']}, master seed {protocol['master_seed']}, truth {protocol['truth_sha256']}.",
    )
    return Section("How it was kept blind", explanation, is_folded=True)


def _origin(protocol: Mapping[str, Any]) -> str:
    return "drawn" if protocol["seed_drawn"] else "given"
