"""Figures of the budget: errors of the rows scene by scene, shares, and the rest less real against real."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.config.budget import START
from rearl_jax.evaluation.scores import REAL, REAL_VS_REAL
from rearl_jax.evaluation.scores import TITLES as REFERENCE_TITLES
from rearl_jax.study.budget.components import Row, orders, row_name, row_of
from rearl_jax.study.budget.shares import Errors, Shares, shares_of


@dataclass(frozen=True)
class Column:
    """An error of the budget.

    Attributes:
        title: Heading, with the unit.
        source: Metric it is taken from.
        form: `as it is`, `less real` (distance from the figure of the recorded scene) or `up` (higher is better).
        first: Components of the first row: rows without them do not have the error.
    """

    title: str
    source: str
    form: str = "as it is"
    first: Row = frozenset()

    def reduced_by(self, components: Sequence[str]) -> tuple[str, ...]:
        """Components that can reduce the error: those beyond its first row; none if that row does not occur."""
        return tuple(name for name in components if name not in self.first) if self.first <= set(components) else ()


COLUMNS: Mapping[str, Column] = {
    "h": Column("H", "h"),
    "mape_a": Column("MAPE A", "mape_a"),
    "mape_b": Column("MAPE B", "mape_b"),
    "mape_c": Column("MAPE C", "mape_c"),
    "thw_error": Column("THW error [s]", "thw", "less real"),
    "lcr_error": Column("LCR error [1/s]", "lcr", "less real"),
    "realism": Column("realism", "realism", "up"),
    "position_error": Column("position error [m]", "position_error", first=frozenset({START})),
    "energy_score": Column("energy score [m]", "energy_score"),
    "frechet": Column("Frechet distance [m]", "frechet"),
    "ttc_likelihood": Column("TTC likelihood", "ttc_likelihood", "up"),
    "thw_likelihood": Column("THW likelihood", "thw_likelihood", "up"),
    "collisions": Column("crashed", "collisions"),
}
"""Errors of the budget by name."""

DIGITS: Mapping[str, int] = {"thw_error": 2, "lcr_error": 4, "position_error": 1, "energy_score": 1, "frechet": 1}
"""Digits after the decimal point of errors whose digits are not those of their metric."""


def scene_figures(table: pd.DataFrame, figure: str) -> dict[str, np.ndarray]:
    """A figure of every row of the table, scene by scene; arguments as in `errors_of`."""
    wide = table.pivot(index="scene_id", columns="row", values=figure).astype(np.float64)
    return {str(name): values.to_numpy(np.float64) for name, values in wide.items()}


def errors_of(table: pd.DataFrame, column: Column) -> dict[str, np.ndarray]:
    """Error of every row of the table (rows of the budget and reference rows), scene by scene; less is better.

    Args:
        table: One line per row and scene: `row`, `scene_id`, every metric.
        column: The error.
    """
    figures = scene_figures(table, column.source)
    if column.form == "less real":
        real = figures.get(REAL, np.nan)
        return {name: np.abs(values - real) for name, values in figures.items()}
    if column.form == "up":
        return {name: -values for name, values in figures.items()}
    return figures


@dataclass(frozen=True)
class ColumnBudget:
    """The budget of one error.

    Attributes:
        column: The error.
        errors: Error of every row and reference row, scene by scene.
        shares: Shares of the components.
        last: Name of the row with all components.
    """

    column: Column
    errors: Mapping[str, np.ndarray]
    shares: Shares
    last: str

    @property
    def first(self) -> str:
        """Name of the row from which the error is reduced."""
        return row_name(self.column.first)

    def rest(self) -> np.ndarray:
        """Error of the last row less that of real against real, scene by scene; NaN if recordings have none."""
        of_real = self.errors.get(REAL_VS_REAL)
        return np.full(len(self.shares.whole), np.nan) if of_real is None else self.errors[self.last] - of_real


def budgets(table: pd.DataFrame, components: Sequence[str]) -> dict[str, ColumnBudget]:
    """The budget of every error that has a figure in some scene in all of its rows."""
    result = {}
    for name, column in COLUMNS.items():
        if not column.reduced_by(components) or column.source not in table:
            continue
        errors = errors_of(table, column)
        rows: Errors = {row_of(row): values for row, values in errors.items() if row not in REFERENCE_TITLES}
        shares = shares_of(rows, _after(orders(components), column.first), column.first)
        if np.isfinite(shares.whole).any():
            result[name] = ColumnBudget(column, errors, shares, row_name(frozenset(components)))
    return result


def _after(all_orders: Sequence[tuple[str, ...]], first: Row) -> list[tuple[str, ...]]:
    """Orders that begin with the components of a row, without these; the stated order first."""
    return [order[len(first) :] for order in all_orders if set(order[: len(first)]) == first]
