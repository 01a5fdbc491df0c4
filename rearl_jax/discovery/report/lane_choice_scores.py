"""Scores of predicted lane changes: `lane_choice.prediction` of the verdict, and a table with a row per driver.

Log loss [nats per driver-second] is the negative log-likelihood of the recorded choices (each side at each opportunity
separately) divided by the time in which drivers could have changed lanes. Balanced accuracy [-] is the mean of
sensitivity (share of changes that are predicted) and specificity (share of all other opportunities for which no change
is predicted). It is .5 for a model without information. Plain accuracy is not used because changes are rare, so that
"no driver ever changes" would score highest. A rule predicts the changes that it accepts; a probability model predicts
a change if the probability exceeds the constant rate (`BASE_RATE`), the usual threshold for rare events.

Source: Brodersen, Ong, Stephan & Buhmann, ICPR (2010) 3121 (balanced accuracy); Freeman & Moisen, Ecol. Model. 217
(2008) 48 (prevalence as the threshold).
"""

from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from rearl_jax.discovery.lane_changes.prediction import BASE_RATE, PREDICTORS, Prediction, log_loss, seconds_at_risk
from rearl_jax.discovery.resampling import Resampling

LANE_CHANGE_TABLE = "lane_changes"
"""Name of the table."""


def prediction_block(prediction: Prediction | None, resampling: Resampling) -> dict[str, Any] | None:
    """Entry `lane_choice.prediction` of the verdict; None without a prediction."""
    if prediction is None:
        return None
    every = {"all": np.ones(len(prediction.table.side), bool)} | prediction.strata()
    strata = {name: _stratum(prediction, rows, resampling) for name, rows in every.items()}
    fitted = {"drivers": prediction.n_fitted_drivers, "changes": prediction.n_fitted_changes}
    return {
        "recorded": prediction.n_recorded,
        "ramp": prediction.n_ramp,
        "fitted": fitted,
        "mobil": {name: asdict(estimate) for name, estimate in prediction.mobil.estimates.items()},
        "refused_share": float(1 - prediction.mobil.rule.accepts(prediction.table)[prediction.table.changes].mean()),
        "strata": strata,
    }


def prediction_table(prediction: Prediction) -> pd.DataFrame:
    """A row per held-out driver."""
    vehicle, first, driver = np.unique(prediction.table.vehicle, return_index=True, return_inverse=True)
    changes, side = prediction.table.changes, prediction.table.side
    seconds = _sums(driver, seconds_at_risk(prediction.table))
    table = pd.DataFrame(
        {
            "driver": vehicle,
            "recording": prediction.table.recording[first],
            "seconds": seconds,
            "opportunities": np.bincount(driver),
            "left": _sums(driver, changes & (side < 0)).astype(int),
            "right": _sums(driver, changes & (side > 0)).astype(int),
        }
    )
    for name, chance in prediction.chance.items():
        with np.errstate(invalid="ignore"):
            accuracy = _balanced(*(_sums(driver, rows) for rows in _outcomes(changes, prediction.is_predicted[name])))
        table[f"expected_{name}"] = _sums(driver, chance)
        table[f"log_loss_{name}"] = _sums(driver, log_loss(chance, changes)) / seconds
        table[f"balanced_accuracy_{name}"] = accuracy
    return table


def _stratum(prediction: Prediction, rows: Bool[np.ndarray, " rows"], resampling: Resampling) -> dict[str, Any]:
    """Scores of the given opportunities; drivers are resampled from all held-out drivers."""
    table = prediction.table.take(rows)
    vehicles = np.unique(prediction.table.vehicle)
    driver, n_drivers = np.searchsorted(vehicles, table.vehicle), len(vehicles)

    def drawn(values: np.ndarray) -> Float[np.ndarray, " figures"]:
        return resampling.drawn(_sums(driver, values, n_drivers), np.sum)

    seconds = seconds_at_risk(table)
    time, scores = drawn(seconds), {}
    constant = drawn(log_loss(prediction.chance[BASE_RATE][rows], table.changes))
    for name in PREDICTORS:
        chance = prediction.chance[name][rows]
        loss, predicted = drawn(log_loss(chance, table.changes)), prediction.is_predicted[name][rows]
        with np.errstate(invalid="ignore", divide="ignore"):
            scores[name] = {
                "log_loss": _figure(loss / time, resampling),
                "less_base_rate": _figure((loss - constant) / time, resampling),
                "balanced_accuracy": _figure(_balanced(*map(drawn, _outcomes(table.changes, predicted))), resampling),
                "expected": float(chance.sum()),
            }
    return {
        "drivers": len(np.unique(table.vehicle)),
        "seconds": float(seconds.sum()),
        "opportunities": len(table.side),
        "changes": int(table.changes.sum()),
        "models": scores,
    }


def _outcomes(changes: np.ndarray, predicted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """True for: correctly predicted changes, changes, correctly predicted non-changes, non-changes."""
    return changes & predicted, changes, ~changes & ~predicted, ~changes


def _balanced(hits: np.ndarray, changes: np.ndarray, rejections: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Balanced accuracy [-] from the counts of `_outcomes`; NaN if there were no changes or only changes."""
    return (hits / changes + rejections / others) / 2


def _sums(driver: np.ndarray, values: np.ndarray, n_drivers: int = 0) -> Float[np.ndarray, " drivers"]:
    """Sum of the values of each driver, for at least `n_drivers` drivers."""
    return np.bincount(driver, values, n_drivers).astype(float)  # the sum of an empty list is an integer


def _figure(drawn: Float[np.ndarray, " figures"], resampling: Resampling) -> dict[str, float] | None:
    """A figure with its interval, from resamples in which it is defined; None if the figure is undefined."""
    if not np.isfinite(drawn[0]):
        return None
    return resampling.figure(drawn[np.isfinite(drawn)])
