"""Document of a multirun of `rearl evaluate`: a row per cell (job), and the rows to compare it with."""

import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Emphasis, number, table_of
from rearl_jax.evaluation.estimates import BASE, LESS_BASE
from rearl_jax.evaluation.scores import REAL, REAL_VS_REAL, TITLES
from rearl_jax.evaluation.tables import HEADINGS

_METRICS = ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions")


def document_of(config: EvaluateTask, cells: pd.DataFrame, *, generated: bool) -> Document:
    """The document of the cells of a multirun.

    Args:
        config: Configuration common to all cells.
        cells: The table `cells.parquet`.
        generated: Whether any of the recordings were generated.
    """
    keys, n_cells = ["cell", "method"], cells["cell"].nunique()
    indexed = cells.astype({"cell": str, "method": str}).set_index(keys)
    order = indexed.index.drop_duplicates()
    figures = indexed.pivot(columns="metric", values="value").reindex(order)
    figures = figures.join(indexed.loc[indexed["metric"] == "h", list(LESS_BASE)]).reset_index()
    methods = [name for name in figures["method"].unique() if name not in (BASE, *TITLES)] or [BASE]
    shown = figures[figures["method"].isin(methods)]
    shown = shown.assign(title=shown["method"] + ": " + shown["cell"] if len(methods) > 1 else shown["cell"])
    references = [
        _reference(figures.loc[figures["method"] == name]) for name in (BASE, REAL_VS_REAL, REAL) if name not in methods
    ]
    rows = pd.concat([shown, *references])
    title = f"{n_cells} cells of {config.study}"
    columns = {"title": "", **{metric: HEADINGS[metric] for metric in _METRICS}, "less_base": "H less base"}
    emphasis = {name: Emphasis.subdued for part in references for name in part["title"]}
    note = f"H less base: paired over scenes, with its {100 * config.eval.confidence:g} % bootstrap interval"
    closest = shown.sort_values("h").iloc[0]
    return Document(
        title=title,
        verdict=f"Of {n_cells} cells, {closest['title']} is closest to the recorded traffic by the Hellinger distance, "
        f"{number(float(closest['h']))}.",
        sections=(Section("Cells", tables=(table_of(title, rows, columns, emphasis),), notes=(note,)),),
        command="evaluate --multirun",
        generated=generated,
    )


def _reference(rows: pd.DataFrame) -> pd.DataFrame:
    """Reference rows; a single row if it is the same in all cells."""
    titles = rows["method"].map(lambda name: TITLES.get(name, name))
    if len(rows[[metric for metric in _METRICS if metric in rows]].drop_duplicates()) == 1:
        return rows.assign(title=titles).head(1)
    return rows.assign(title=titles + ": " + rows["cell"])
