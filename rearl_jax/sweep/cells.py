"""The cells (jobs) of a multirun of `rearl evaluate`, combined into one table, one figure and a summary.

Writes into the study folder `cells.parquet` (one row per cell, row of the table and metric), `runs.parquet` (one row
per cell and scored pair), `cells.png`, `config.json` and, last of all, `summary.json`.
"""

import logging
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from rearl_jax.config import EvaluateTask
from rearl_jax.document.terminal import print_document
from rearl_jax.results import Study, cell_folder, read_summary, shared_config, without_provenance
from rearl_jax.sweep.cells_document import document_of

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Cell:
    """A finished job.

    Attributes:
        keys: Value of each swept key, as written on the command line.
        folder: Folder of its results.
        estimates: Content of `summary.parquet`.
        figures: Objects of `summary.json`, the method first.
    """

    keys: dict[str, str]
    folder: Path
    estimates: pd.DataFrame
    figures: list[dict]

    @property
    def name(self) -> str:
        """Title in tables and figures: the values of the swept keys, without their groups unless two keys differ in the
        group alone.
        """
        short = Counter(key.rpartition(".")[2] for key in self.keys)
        names = {key: last if short[last := key.rpartition(".")[2]] == 1 else key for key in self.keys}
        return ", ".join(f"{names[key]}={value}" for key, value in self.keys.items())


def collect(config: EvaluateTask, swept: list[dict[str, str]]) -> None:
    """Combines the finished cells.

    Args:
        config: Configuration common to all cells.
        swept: The swept keys and their values, cell by cell.
    """
    root = Path(config.results.root) / config.study
    cells = [cell for keys in swept if (cell := _read(root, keys)) is not None]
    if len(cells) < len(swept):
        log.warning("%d of %d cells are not finished and are left out", len(swept) - len(cells), len(swept))
    if not cells:
        return
    sources = sorted({cell.figures[0]["data_id"] for cell in cells})
    generated = any(cell.figures[0]["generated"] for cell in cells)
    keys = {key: sorted({cell.keys[key] for cell in cells}) for key in cells[0].keys}
    study = Study(
        config.results.root,
        config.study,
        {"sweep": keys, "shared": shared_config(config)},
        "evaluate --multirun",
        ", ".join(sources),
        generated=generated,
    )
    study.write_config()
    seeds = {"seeds": config.seeds}
    table = cell_table(cells)
    study.write_table("cells", table, **seeds)
    runs = [pd.read_parquet(cell.folder / "runs.parquet") for cell in cells]
    study.write_table("runs", _joined(cells, runs), **seeds)
    names = [cell.name for cell in cells]
    print_document(document_of(config, table, generated=generated))

    # Imported after the table is printed, because matplotlib is slow to import.
    from rearl_jax.sweep.cell_figure import draw_cells

    study.write_bytes("cells.png", draw_cells(config, names, table, generated=generated))
    study.write_summary(
        [{"cell": cell.name, **_columns(cell), **without_provenance(cell.figures[0])} for cell in cells]
    )


def _read(root: Path, keys: dict[str, str]) -> Cell | None:
    """The cell with these values, if its job has finished."""
    folder = cell_folder(root, keys)
    try:
        figures = read_summary(folder)
    except FileNotFoundError:
        return None
    return Cell(keys, folder, pd.read_parquet(folder / "summary.parquet"), figures)


def cell_table(cells: list[Cell]) -> pd.DataFrame:
    """One row per cell, row of its table and metric: `cell`, the swept keys, then the columns of `summary.parquet`."""
    return _joined(cells, [cell.estimates for cell in cells])


def _columns(cell: Cell) -> dict[str, str]:
    """The swept keys as columns; `method` becomes `cell_method`, because the table also has a column `method`."""
    return {"cell_method" if key == "method" else key: value for key, value in cell.keys.items()}


def _joined(cells: list[Cell], frames: list[pd.DataFrame]) -> pd.DataFrame:
    """The concatenated tables of the cells: `cell`, the swept keys, then the columns of the tables."""
    parts = []
    for cell, frame in zip(cells, frames, strict=True):
        named = {"cell": cell.name, **_columns(cell)}
        columns = {name: pd.Categorical([value] * len(frame)) for name, value in named.items()}
        parts.append(pd.concat([pd.DataFrame(columns), frame.astype({"method": str})], axis=1))
    text_columns = ["cell", "method", *_columns(cells[0])]
    whole = pd.concat([part.astype(dict.fromkeys(text_columns, str)) for part in parts])
    return whole.astype(dict.fromkeys(text_columns, "category")).reset_index(drop=True)
