"""Tables of the budget: the rows of the stated order, and the shares of the components in every error."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.evaluation.estimates import means_with_intervals
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.evaluation.scores import TITLES as REFERENCE_TITLES
from rearl_jax.metrics import METRICS
from rearl_jax.study.budget.components import TITLES, row_name, title_of_row
from rearl_jax.study.budget.figures import COLUMNS, ColumnBudget, errors_of, scene_figures

FIRST, LAST, OF_REAL, WHOLE, REST = "first", "last", "real", "whole", "rest"
"""Parts of an error besides the components: its value in the first row, in the last one and in real against real (other
recorded scenes in place of simulated ones); the reduction from the first to the last; the last less real against real.
"""

BUDGET_COLUMNS = ("error", "heading", "part", "title", "value", "low", "high", "stated", "least", "most", "leads")
STEP_COLUMNS = ("row", "title", "figure", "value", "low", "high")


def budget_table(budgets: Mapping[str, ColumnBudget], eval: EvaluationConfig) -> pd.DataFrame:
    """One row per error and part, with BUDGET_COLUMNS, `n_scenes` and `n_orders`; missing figures are null.

    `value` of a component is its share: the mean reduction by it over all admissible orders, positive towards
    the recording; `stated`, `least` and `most` are its reductions in the stated order and its extremes over all orders,
    `leads` the share of the orders in which it has the largest reduction.
    """
    records = [record for name, budget in budgets.items() for record in _records(name, budget, eval)]
    table = pd.DataFrame(records)
    numbers = ["value", "low", "high", "stated", "least", "most", "leads"]
    return table.reindex(columns=[*BUDGET_COLUMNS, "n_scenes", "n_orders"]).astype(dict.fromkeys(numbers, "Float64"))


def _records(name: str, budget: ColumnBudget, eval: EvaluationConfig) -> list[dict[str, Any]]:
    shares, errors = budget.shares, budget.errors
    is_known = np.isfinite(shares.whole)
    sign = -1.0 if budget.column.form == "up" else 1.0
    missing = np.full(len(is_known), np.nan)
    ends = {FIRST: errors[budget.first], LAST: errors[budget.last], OF_REAL: errors.get(REAL_VS_REAL, missing)}
    values = {part: np.where(is_known, sign * error, np.nan) for part, error in ends.items()}
    values |= {WHOLE: shares.whole, REST: np.where(is_known, budget.rest(), np.nan)}
    values |= dict(zip(shares.components, shares.by_component, strict=True))
    figures = dict(zip(values, means_with_intervals(list(values.values()), eval), strict=True))
    titles = {FIRST: title_of_row(budget.column.first), LAST: "all components", OF_REAL: REFERENCE_TITLES[REAL_VS_REAL]}
    titles |= {WHOLE: "total reduction", REST: "rest less real against real"} | dict(TITLES)
    common = {"error": name, "heading": budget.column.title, "n_scenes": int(is_known.sum())}
    common |= {"n_orders": len(shares.by_order)}
    of_orders = {
        "stated": shares.stated,
        "least": shares.by_order.min(axis=0),
        "most": shares.by_order.max(axis=0),
        "leads": shares.leading_share,
    }
    records = []
    for part, (value, low, high) in figures.items():
        if np.isfinite(value):
            records.append(common | {"part": part, "title": titles[part], "value": value, "low": low, "high": high})
            if part in shares.components:
                index = shares.components.index(part)
                records[-1] |= {key: float(column[index]) for key, column in of_orders.items()}
    return records


def step_table(rows: pd.DataFrame, components: Sequence[str], eval: EvaluationConfig) -> pd.DataFrame:
    """One line per row of the stated order (or reference row) and figure, with STEP_COLUMNS: every metric,
    `position_error` [m], `overlap_share` [-], and the errors `thw_error` [s] and `lcr_error`.

    Args:
        rows: Figures of all rows, scene by scene.
        components: The components, in the stated order.
        eval: Resamples, confidence and seed of the intervals.
    """
    names = [row_name(frozenset(components[:size])) for size in range(len(components) + 1)]
    titles = dict(zip(names, ["base", *(f"+ {TITLES[name]}" for name in components)], strict=True))
    titles |= {name: title for name, title in REFERENCE_TITLES.items() if name in set(rows["row"])}
    keys, values = [], []
    for figure in (*METRICS, "position_error", "overlap_share", "thw_error", "lcr_error"):
        is_error = figure in ("thw_error", "lcr_error")
        of_rows = errors_of(rows, COLUMNS[figure]) if is_error else scene_figures(rows, figure)
        for name, of_scenes in of_rows.items():
            if name in titles and np.isfinite(of_scenes).any():
                keys.append((name, figure))
                values.append(of_scenes)
    records = [
        {"row": name, "title": titles[name], "figure": figure, "value": value, "low": low, "high": high}
        for (name, figure), (value, low, high) in zip(keys, means_with_intervals(values, eval), strict=True)
    ]
    order = {name: number for number, name in enumerate(titles)}
    table = pd.DataFrame(records).sort_values("row", key=lambda column: column.map(order), kind="stable")
    return table.reset_index(drop=True).astype(dict.fromkeys(("value", "low", "high"), "Float64"))


def summary_of(table: pd.DataFrame, components: Sequence[str], n_scenes: int, n_orders: int) -> dict[str, Any]:
    """Flat figures: `components`, `n_scenes`, `n_orders`; of every error `ERROR_first`, `ERROR_last`, `ERROR_real`,
    `ERROR_whole`, `ERROR_rest` and `ERROR_COMPONENT` (its share), each with `_low` and `_high`; `ERROR_leader` and
    `ERROR_leads` (the component with the largest share, and the share of orders in which its reduction is the largest).
    """
    summary: dict[str, Any] = {"components": "+".join(components), "n_scenes": n_scenes, "n_orders": n_orders}
    for record in table.astype(object).to_dict("records"):
        for ending in ("", "_low", "_high"):
            value = record[ending.removeprefix("_") or "value"]
            summary[f"{record['error']}_{record['part']}{ending}"] = None if pd.isna(value) else float(value)
    for error, rows in table.dropna(subset=["leads"]).groupby("error", sort=False):
        leader = rows.loc[rows["value"].astype(float).idxmax()]
        summary |= {f"{error}_leader": leader["part"], f"{error}_leads": float(leader["leads"])}
    return summary
