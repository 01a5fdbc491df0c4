"""What a multirun of `rearl evaluate` says: a row per cell, and the rows it must be read against."""

from collections.abc import Iterator

import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, Table
from rearl_jax.evaluation.estimates import BASE
from rearl_jax.evaluation.scores import REAL, REAL_VS_REAL, TITLES
from rearl_jax.evaluation.tables import HEADINGS, written

_SHOWN = ("h", "mape_a", "mape_b", "mape_c", "thw", "lcr", "collisions")


def document_of(config: EvaluateTask, cells: pd.DataFrame, *, generated: bool) -> Document:
    """The document of the cells of a multirun.

    Args:
        config: What all cells share.
        cells: The table `cells.parquet`.
        generated: Whether any of the recordings were generated.
    """
    names = list(dict.fromkeys(cells["cell"]))
    headings = (*(HEADINGS[metric] for metric in _SHOWN), "H less base")
    rows = tuple(_rows(names, cells))
    title = f"{len(names)} cells of {config.study}"
    note = f"H less base: paired over scenes, with its {100 * config.eval.confidence:g} % bootstrap interval"
    least = min(
        (row for row in rows if row.emphasis is Emphasis.plain), key=lambda row: row.cells[0].value.replace(NONE, "~")
    )
    return Document(
        title=title,
        verdict=f"Of {len(names)} cells, {least.title} is closest to the recorded traffic by the Hellinger distance, "
        f"{least.cells[0].value}.",
        sections=(Section("Cells", tables=(Table(title, headings, rows),), notes=(note,)),),
        command="evaluate --multirun",
        generated=generated,
    )


def _rows(names: list[str], table: pd.DataFrame) -> Iterator[Row]:
    """A row per cell and method, then the reference rows."""
    values = {
        key: part.set_index("metric") for key, part in table.groupby(["cell", "method"], sort=False, observed=True)
    }
    methods = [name for name in table["method"].unique() if name not in (BASE, *TITLES)] or [BASE]
    for cell in names:
        for method in methods:
            if (cell, method) in values:
                title = f"{method}: {cell}" if len(methods) > 1 else cell
                yield Row(title, _cells(values[cell, method]))
    for other in (BASE, REAL_VS_REAL, REAL):
        if other not in methods:
            yield from _references(values, names, other)


def _references(values: dict, names: list[str], row: str) -> Iterator[Row]:
    """A reference row, once if all cells have the same one, else for each of them."""
    title = TITLES.get(row, row)
    of_cells = {cell: _cells(values[cell, row]) for cell in names if (cell, row) in values}
    if len(set(of_cells.values())) == 1:
        of_cells = {"": next(iter(of_cells.values()))}
    for cell, cells in of_cells.items():
        yield Row(f"{title}: {cell}" if cell else title, cells, Emphasis.subdued)


def _cells(figures: pd.DataFrame) -> tuple[Cell, ...]:
    """Figures of one row, and the difference of its Hellinger distance to base."""
    texts = (written(float(figures.loc[name, "value"]), name) if name in figures.index else NONE for name in _SHOWN)
    return (*map(Cell, texts), _less_base(figures))


def _less_base(figures: pd.DataFrame) -> Cell:
    if "h" not in figures.index or pd.isna(figures.loc["h", "less_base"]):
        return Cell("")
    low, high = figures.loc["h", "less_base_low"], figures.loc["h", "less_base_high"]
    return Cell(f"{figures.loc['h', 'less_base']:+.3f}", "" if pd.isna(low) else f"{low:+.3f} to {high:+.3f}")
