"""The cells (jobs) of a multirun as a figure: a line per cell, a panel per metric, with marks of the references
(recorded scenes, Base).
"""

import pandas as pd
from matplotlib.axes import Axes

from rearl_jax.config import EvaluateTask
from rearl_jax.drawing import BLUE, DARK_GREY, VERMILION, add_grid, add_legend, panels, png, set_title
from rearl_jax.evaluation.estimates import BASE
from rearl_jax.evaluation.scores import TITLES, reference_of
from rearl_jax.evaluation.tables import HEADINGS

DRAWN_METRICS = ("h", "mape", "thw", "lcr", "collisions")
"""Metrics with a panel; `mape` stands for the column of that metric that `mape` of the configuration selects."""

_RECORDED = "recorded scenes (real against real for H and MAPE)"


def draw_cells(config: EvaluateTask, names: list[str], table: pd.DataFrame, *, generated: bool) -> bytes:
    """PNG of the cells' estimates with their intervals.

    Args:
        config: Configuration common to all cells.
        names: Names of the cells, drawn from top to bottom.
        table: `cells.parquet`.
        generated: Whether the recordings were generated, not measured.
    """
    metrics = [config.mape.column if name == "mape" else name for name in DRAWN_METRICS]
    height = 1.4 + 0.28 * len(names)
    figure, axes = panels(11.0, max(height, 2.4), columns=len(metrics), generated=generated)
    for panel, metric in zip(axes, metrics, strict=True):
        _marks(panel, table, names, reference_of(metric), metric, _RECORDED, "|", DARK_GREY)
        _marks(panel, table, names, BASE, metric, BASE, "D", VERMILION)
        # TITLES has the references, which are no methods.
        for method in (name for name in table["method"].unique() if name not in (BASE, *TITLES)):
            _intervals(panel, table, names, method, metric)
        panel.set_ylim(len(names) - 0.5, -0.5)
        panel.set_yticks(range(len(names)), names if panel is axes[0] else [""] * len(names))
        panel.set_xlabel(HEADINGS[metric])
        add_grid(panel, "y")
    axes[-1].set_xlim(left=0)  # the last metric, collisions, is a share
    set_title(axes[0], f"{config.study}; {config.eval.subset.name} scenes, {config.eval.n_runs} runs each")
    add_legend(figure)
    return png(figure)


def _marks(
    panel: Axes,
    table: pd.DataFrame,
    names: list[str],
    reference: str,
    metric: str,
    label: str,
    marker: str,
    colour: str,
) -> None:
    """Draws one mark per cell for a reference, a value of the column `method`."""
    estimates = _estimates_of(table, reference, metric)
    if not estimates.empty:
        positions = [names.index(cell) for cell in estimates.index]
        size = 10 if marker == "|" else 4
        panel.plot(
            estimates["value"], positions, marker, color=colour, markersize=size, mfc="none", linestyle="", label=label
        )


def _intervals(panel: Axes, table: pd.DataFrame, names: list[str], method: str, metric: str) -> None:
    """One dot per cell for a method, with its interval."""
    estimates = _estimates_of(table, method, metric)
    positions = [names.index(cell) for cell in estimates.index]
    panel.plot(estimates["value"], positions, "o", color=BLUE, markersize=4, label=method)
    has_interval = estimates["low"].notna().to_numpy()
    heights = [y for y, has in zip(positions, has_interval, strict=True) if has]
    panel.hlines(heights, estimates["low"][has_interval], estimates["high"][has_interval], color=BLUE, linewidth=1.2)


def _estimates_of(table: pd.DataFrame, method: str, metric: str) -> pd.DataFrame:
    """Estimates of one method, or reference, and metric, by cell."""
    rows = table[(table["method"] == method) & (table["metric"] == metric)].set_index("cell")
    return rows.astype({name: float for name in ("value", "low", "high")})
