"""Tables of a discovery, and the error block and summary of its verdict."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.uncertainty import known
from rearl_jax.discovery.report.errors import MEASURES, ModelErrors, with_interval
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.procedure import Search

MAIN_MEASURE = "gap_rmse"


def null_table(null: Null) -> pd.DataFrame:
    """Evidence of each candidate where nothing is missing."""
    return pd.DataFrame(
        {
            "candidate": [str(term) for term in null.mean],
            "mean": list(null.mean.values()),
            "spread": [null.spread[term] for term in null.mean],
            "replicates": null.replicates,
        }
    )


def read_null(path: Path) -> Null:
    """The null of a run that was killed."""
    table = pd.read_parquet(path)
    terms = table["candidate"].map(Term.read)
    return Null(
        dict(zip(terms, table["mean"].astype(float), strict=True)),
        dict(zip(terms, table["spread"].astype(float), strict=True)),
        int(table["replicates"].iloc[0]),
    )


def error_block(errors: Mapping[str, ModelErrors], confidence: float, draws: int, seed: int) -> dict[str, Any]:
    """`error` of the verdict: every measure before and after, and the floor, with intervals over drivers."""
    block: dict[str, Any] = {"measure": MAIN_MEASURE, "n_drivers": len(errors["before"].floor)}
    last = "after" if "after" in errors else "oracle" if "oracle" in errors else "before"
    figures = {}
    for measure in MEASURES:
        both = [errors[model].by_driver[measure] for model in ("before", last)]
        rows = with_interval(both, measure, confidence, draws, seed)
        figures[measure] = dict(zip(("before", "after", "change"), rows, strict=True))
    main = figures[MAIN_MEASURE]
    (floor,) = with_interval([errors[last].floor], MAIN_MEASURE, confidence, draws, seed)
    return block | {
        "before": main["before"],
        "after": main["after"] if last != "oracle" else None,
        "change": main["change"],
        "floor": floor,
        "oracle": main["after"] if last == "oracle" else None,
        "explained_share": _explained(*(figure["value"] for figure in (main["before"], main["after"], floor))),
        "all": figures,
    }


def _explained(before: float, after: float, floor: float) -> float | None:
    """Share of the squared error above the floor that is gone [-]; None where the error was at the floor already."""
    above = before**2 - floor**2
    return None if above <= 0.02 * before**2 else float((before**2 - after**2) / above)


def error_table(errors: Mapping[str, ModelErrors]) -> pd.DataFrame:
    """Every measure of every report driver and model."""
    parts = []
    for model, one in errors.items():
        part = pd.DataFrame({"model": model, "driver": np.arange(len(one.floor)), "floor": one.floor})
        parts.append(part.assign(**one.by_driver))
    return pd.concat(parts, ignore_index=True)


def driver_table(solver: Solver, found: Search) -> pd.DataFrame:
    """Calibrated parameters of the fitted drivers before and after, see `fit_table`."""
    parts = []
    for model, fit in (("before", found.first), ("after", found.last)):
        part = fit_table(solver, fit)
        part.insert(0, "model", model)
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def fit_table(solver: Solver, fit: Fit) -> pd.DataFrame:
    """Calibrated parameters of the drivers of a fit, with the standard deviations of their logarithms."""
    state = fit.state
    prior = solver.layout.prior
    values = prior.values(state.z, state.truck)
    deviations = known(solver, state).drivers * prior.spread
    table = pd.DataFrame({"driver": np.arange(len(state.z)), "truck": state.truck.astype(bool)})
    for k, name in enumerate(prior.names):
        table[name], table[f"{name}_log_sd"] = values[:, k], deviations[:, k]
    assert state.sums is not None
    table["one_step"] = np.sqrt(state.sums.square / np.maximum(state.sums.count, 1.0))
    return table


def candidate_table(verdict: dict[str, Any]) -> list[dict[str, Any]]:
    """Candidates as flat rows."""
    return [{**row, "variables": ",".join(row["variables"])} for row in verdict["candidates"]]


def summary(verdict: dict[str, Any]) -> dict[str, Any]:
    """The verdict in flat figures."""
    error = verdict["error"]
    return {
        "verdict": verdict["verdict"],
        "effects": [
            {
                "name": effect["name"],
                "kind": effect["kind"],
                "variables": ",".join(effect["variables"]),
                "confidence": effect["confidence"],
                **{key: number["value"] for key, number in effect["parameters"].items()},
            }
            for effect in verdict["effects"]
        ],
        "measure": error["measure"],
        **{
            f"{name}_{end}": None if error[name] is None else error[name][end]
            for name in ("before", "after", "floor", "oracle")
            for end in ("value", "low", "high")
        },
        "n_drivers": error["n_drivers"],
        "seconds": verdict["seconds"],
    }
