"""Errors second by second: mean and band of every second, from `frames.parquet` of evaluations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from rearl_jax.evaluation.estimates import BASE
from rearl_jax.evaluation.scores import REAL_VS_REAL, TITLES
from rearl_jax.study.row_results import Evaluated, Results

BAND = (0.1, 0.9)
"""Quantiles over rollouts and scenes at the ends of a band [-]; as in the figures of an evaluation."""


@dataclass(frozen=True)
class Band:
    """An error second by second, over the rollouts and scenes that have it; seconds without any are left out.

    Attributes:
        second: Time [s].
        mean: Mean.
        low: Lower end of the band.
        high: Upper end of the band.
        n_values: Number of rollouts and scenes.
    """

    second: Int[np.ndarray, " seconds"]
    mean: Float[np.ndarray, " seconds"]
    low: Float[np.ndarray, " seconds"]
    high: Float[np.ndarray, " seconds"]
    n_values: Int[np.ndarray, " seconds"]


@dataclass(frozen=True)
class ErrorSeries:
    """Errors of one row, second by second.

    Attributes:
        name: Row of the table, or `real_vs_real`.
        title: Title in tables and figures.
        errors: Bands by name of the error.
    """

    name: str
    title: str
    errors: dict[str, Band]


def error_series(results: Results, metrics: Sequence[str]) -> list[ErrorSeries]:
    """All rows, then real against real; base is included even if it is not a row of the table."""
    series = [_series(item, item.method, item.row.name, item.row.title, metrics) for item in results.rows]
    reference = results.reference
    if all(item.name != BASE for item in series):
        series.insert(0, _series(reference, BASE, BASE, BASE, metrics))
    return [*series, _series(reference, REAL_VS_REAL, REAL_VS_REAL, TITLES[REAL_VS_REAL], metrics)]


def _series(item: Evaluated, method: str, name: str, title: str, metrics: Sequence[str]) -> ErrorSeries:
    frames = pd.read_parquet(item.folder / "frames.parquet", columns=["method", "frame", *metrics])
    is_method = frames["method"].to_numpy(str) == method
    second = frames["frame"].to_numpy(int)[is_method]
    values = {metric: frames[metric].to_numpy(np.float64, na_value=np.nan)[is_method] for metric in metrics}
    return ErrorSeries(name, title, {metric: band(second, errors) for metric, errors in values.items()})


def band(second: Int[np.ndarray, " values"], values: Float[np.ndarray, " values"]) -> Band:
    """Mean and band of every second; NaN is ignored."""
    known = np.isfinite(values)
    seconds = np.unique(second[known])
    groups = [values[known & (second == group_second)] for group_second in seconds]
    low, high = (np.array([np.quantile(group, share) for group in groups]) for share in BAND)
    means, counts = np.array([group.mean() for group in groups]), np.array([len(group) for group in groups], int)
    return Band(seconds, means, low, high, counts)
