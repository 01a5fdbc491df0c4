"""The table of the cells of a multirun in the terminal."""

import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.evaluation.estimates import BASE
from rearl_jax.evaluation.scores import REAL, REAL_VS_REAL, TITLES
from rearl_jax.evaluation.tables import HEADINGS, written

SHOWN = ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions")
"""Metrics of the table; the files have all."""

_WIDTH = 90
"""Columns the table needs beside the names of its rows."""


def print_cells(config: EvaluateTask, names: list[str], table: pd.DataFrame, *, generated: bool) -> None:
    """Prints one row per cell, then the rows it must be read against, once where they are the same in all cells.

    Args:
        config: What all cells share.
        names: Names of the cells, in the order of the jobs.
        table: `cells.parquet`.
        generated: Whether the recordings are no measurements.
    """
    shown = titled_table(f"{len(names)} cells of {config.study}", generated=generated)
    shown.add_column("", no_wrap=True)
    for metric in SHOWN:
        shown.add_column(HEADINGS[metric], justify="right", no_wrap=True)
    shown.add_column("H less base", justify="right", no_wrap=True)
    rows = _rows(names, table)
    for name, (figures, style) in rows.items():
        shown.add_row(name, *figures, style=style)
    console = standard_output(_WIDTH + max(map(len, rows)))
    console.print(shown)
    percent = f"{100 * config.eval.confidence:g} %"
    print_notes(console, [f"H less base: paired over scenes, with its {percent} bootstrap interval"])


def _rows(names: list[str], table: pd.DataFrame) -> dict[str, tuple[list[str], str]]:
    """Figures of every row of the table and how it is printed, by the name of the row."""
    values = table.astype({"cell": str, "method": str}).set_index(["cell", "method", "metric"]).sort_index()
    methods = [name for name in table["method"].unique() if name not in (BASE, *TITLES)] or [BASE]
    rows: dict[str, tuple[list[str], str]] = {}
    for cell in names:
        for method in methods:
            if (row := _row(values, cell, method)) is not None:
                rows[f"{method}: {cell}" if len(methods) > 1 else cell] = (row, "")
    for other in (BASE, REAL_VS_REAL, REAL):
        if other not in methods:
            rows |= {name: (row, "dim") for name, row in _distinct(values, names, other).items()}
    return rows


def _distinct(values: pd.DataFrame, names: list[str], row: str) -> dict[str, list[str]]:
    """A reference row, once if all cells have the same one, else for each of them."""
    title = TITLES.get(row, row)
    rows = {cell: found for cell in names if (found := _row(values, cell, row)) is not None}
    if len({tuple(found) for found in rows.values()}) == 1:
        return {title: next(iter(rows.values()))}
    return {f"{title}: {cell}": found for cell, found in rows.items()}


def _row(values: pd.DataFrame, cell: str, method: str) -> list[str] | None:
    """Figures of one row as text; None where the cell has no such row."""
    if (cell, method) not in values.index.droplevel("metric"):
        return None
    row = values.loc[(cell, method)]
    texts = [written(float(row.loc[name, "value"]), name) if name in row.index else "-" for name in SHOWN]
    return [*texts, _less_base(row)]


def _less_base(row: pd.DataFrame) -> str:
    """Difference of the Hellinger distance to base, with its interval."""
    if "h" not in row.index or pd.isna(row.loc["h", "less_base"]):
        return ""
    text = f"{row.loc['h', 'less_base']:+.3f}"
    low, high = row.loc["h", "less_base_low"], row.loc["h", "less_base_high"]
    return text if pd.isna(low) else f"{text} ({low:+.3f} to {high:+.3f})"
