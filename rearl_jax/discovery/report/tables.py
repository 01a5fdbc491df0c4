"""Tables of a discovery, and the flat summary of its verdict."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.report.errors import MEASURES, ModelErrors
from rearl_jax.discovery.report.protocols import IN_SAMPLE, PROTOCOL_MEASURES, PROTOCOLS, ProtocolErrors
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.outcome import Search


def null_table(null: Null) -> pd.DataFrame:
    """Table of the null distribution: each candidate's evidence if no effect is missing."""
    return pd.DataFrame(
        {
            "candidate": [str(term) for term in null.mean],
            "mean": list(null.mean.values()),
            "spread": [null.spread[term] for term in null.mean],
            "replicates": null.replicates,
        }
    )


def read_null(path: Path) -> Null:
    """The null distribution stored by an interrupted run."""
    table = pd.read_parquet(path)
    terms = table["candidate"].map(Term.read)
    return Null(
        dict(zip(terms, table["mean"].astype(float), strict=True)),
        dict(zip(terms, table["spread"].astype(float), strict=True)),
        int(table["replicates"].iloc[0]),
    )


def error_table(errors: Mapping[str, ModelErrors]) -> pd.DataFrame:
    """Every measure of every report driver (not used to find the models), by model and by protocol (source of the
    driver's parameters).
    """
    tables = []
    for model, model_errors in errors.items():
        for protocol, protocol_errors in model_errors.protocols.items():
            if protocol_errors is None:
                continue
            table = pd.DataFrame({"model": model, "protocol": protocol, "driver": protocol_errors.driver})
            if protocol == IN_SAMPLE:
                table = table.assign(floor=model_errors.floor, **model_errors.by_driver)
            of_population = {f"population_{name}": values for name, values in protocol_errors.population.items()}
            tables.append(table.assign(**protocol_errors.by_driver, **of_population))
    return pd.concat(tables, ignore_index=True)


def read_errors(table: pd.DataFrame, error: Mapping[str, Any]) -> dict[str, ModelErrors]:
    """Errors from their table, made by `error_table`, and the entry `error` of the verdict; without response times."""
    return {str(model): _read_model(rows, error) for model, rows in table.groupby("model", sort=False)}


def _read_model(rows: pd.DataFrame, error: Mapping[str, Any]) -> ModelErrors:
    protocols: dict[str, ProtocolErrors | None] = dict.fromkeys(PROTOCOLS)
    for name, part in rows.groupby("protocol", sort=False):
        of_model, of_population = (
            {measure: part[f"{prefix}{measure}"].to_numpy(float) for measure in PROTOCOL_MEASURES}
            for prefix in ("", "population_")
        )
        left_out = error["protocols"][name]["left_out"]
        protocols[str(name)] = ProtocolErrors(part["driver"].to_numpy(), of_model, of_population, left_out)
    in_sample = rows.loc[rows["protocol"] == IN_SAMPLE, ["floor", *MEASURES]].astype(float)
    by_driver = {name: np.asarray(in_sample[name]) for name in MEASURES}
    return ModelErrors(by_driver, np.asarray(in_sample["floor"]), protocols, None)


def driver_table(solver: Solver, search: Search) -> pd.DataFrame:
    """Calibrated parameters of the fitted drivers before and after effects were added, see `fit_table`."""
    parts = []
    for model, fit in (("before", search.first), ("after", search.last)):
        part = fit_table(solver, fit)
        part.insert(0, "model", model)
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def fit_table(solver: Solver, fit: Fit) -> pd.DataFrame:
    """Calibrated parameters of the drivers of a fit, with the standard deviations of their logarithms."""
    state = fit.state
    prior = solver.layout.prior
    values = prior.values(state.z, state.truck)
    deviations = np.sqrt(state.own_variance) * prior.spread
    table = pd.DataFrame({"driver": np.arange(len(state.z)), "truck": state.truck.astype(bool)})
    for k, name in enumerate(prior.names):
        table[name], table[f"{name}_log_sd"] = values[:, k], deviations[:, k]
    assert state.sums is not None
    table["one_step"] = np.sqrt(state.sums.square / np.maximum(state.sums.count, 1.0))
    return table


def candidate_table(verdict: dict[str, Any]) -> pd.DataFrame:
    """Candidates of the verdict as flat rows."""
    return pd.DataFrame([row | {"variables": ",".join(row["variables"])} for row in verdict["candidates"]])


def summary(verdict: dict[str, Any]) -> dict[str, Any]:
    """The verdict as flat key-value pairs."""
    error = verdict["error"]
    return {
        "verdict": verdict["verdict"],
        "car_following": verdict["data"]["car_following"],
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
