"""Figures of the threshold sweep: thresholds in the distributions of base, and errors of each pair."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from rearl_jax import drawing
from rearl_jax.config import StudyFig7Task, SweepThresholdsTask
from rearl_jax.console import generated_mark
from rearl_jax.evaluation.percentiles import BaseValues

_LINE, _MARK, _PAPER = drawing.BLUE, drawing.VERMILION, drawing.DARK_GREY

_TEXT_WIDTH = 0.3
"""Width of a text as a share of the horizontal axis [-]."""

_PUBLISHED = {"color": _PAPER, "marker": "D", "markerfacecolor": "none", "markersize": 5, "linewidth": 0.8}

HEAT_MAPS = {"h": "Hellinger distance", "mape": "spacing error", "score": "sum of both"}
"""Columns of the table that are drawn, and their titles."""


def cumulative(
    base: BaseValues,
    config: SweepThresholdsTask | StudyFig7Task,
    published: tuple[Mapping[float, float], Mapping[float, float]] = ({}, {}),
    *,
    generated: bool,
) -> bytes:
    """PNG of the cumulative distributions of base with the percentiles that became thresholds (Fig. 7 of REARL).

    Args:
        base: The values.
        config: The task, with the percentiles.
        published: The paper's thresholds by percentile [%], of the Hellinger distance and of the spacing error.
        generated: Whether the recordings were generated, not measured.
    """
    figure, sweep = Figure(figsize=(8.0, 3.4), layout="constrained"), config.sweep
    title = f"Base on {len(base.scene)} threshold scenes x {config.eval.n_runs} runs{generated_mark(generated)}"
    figure.suptitle(title, fontsize=drawing.FONT_SIZE)
    panels = (("Hellinger distance [-]", base.h, sweep.h_pct), ("spacing error [-]", base.mape, sweep.m_pct))
    for axes, (label, values, percentiles), paper in zip(
        figure.subplots(1, 2, sharey=True), panels, published, strict=True
    ):
        _distribution(axes, values, percentiles, paper)
        if paper:
            shares = [percentile / 100 for percentile in paper]
            axes.plot(list(paper.values()), shares, **_PUBLISHED)
            axes.set_xlim(0, max(axes.get_xlim()[1], 1.05 * max(paper.values())))
            marks = [Line2D([], [], color=_LINE, label="ours"), Line2D([], [], **_PUBLISHED, label="paper")]
            axes.legend(handles=marks, frameon=False, fontsize=drawing.FONT_SIZE, loc="center right")
        axes.set(xlabel=label, ylim=(0, 1))
    figure.axes[0].set_ylabel("share of the values below")
    return drawing.png(figure)


def _distribution(axes: Axes, values: np.ndarray, percentiles: tuple[float, ...], paper: Mapping[float, float]) -> None:
    """Draws one cumulative distribution with its thresholds; `paper` has the paper's thresholds by percentile [%]."""
    levels = np.linspace(0, 100, 1001)
    axes.plot(np.percentile(values, levels), levels / 100, color=_LINE, linewidth=1.4)
    axes.set_xlim(0, float(np.percentile(values, 99.5)))
    for percentile in percentiles:
        threshold = float(np.percentile(values, percentile))
        axes.plot([threshold], [percentile / 100], "o", color=_MARK, markersize=4)
        # The text is placed to the right of a published threshold that it would cover.
        published = paper.get(percentile, threshold)
        is_near = threshold < published < threshold + _TEXT_WIDTH * axes.get_xlim()[1]
        axes.annotate(
            f"{percentile:g} %: {threshold:.3f}",
            (published if is_near else threshold, percentile / 100),
            xytext=(6, -3),
            textcoords="offset points",
            fontsize=7,
        )
    axes.grid(color=drawing.LIGHT_GREY, linewidth=0.6)


def heat_maps(table: pd.DataFrame, title: str) -> bytes:
    """PNG of HEAT_MAPS; rows are percentiles of the Hellinger distance, columns those of the spacing error."""
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    figure.suptitle(title, fontsize=drawing.FONT_SIZE)
    for axes, (name, label) in zip(figure.subplots(1, len(HEAT_MAPS)), HEAT_MAPS.items(), strict=True):
        grid = table.pivot(index="h_pct", columns="m_pct", values=name)
        axes.imshow(grid, cmap="cividis_r", aspect="auto")
        low, high = float(np.min(grid)), float(np.max(grid))
        for (row, column), value in np.ndenumerate(grid.to_numpy()):
            is_dark = value > (low + high) / 2
            axes.text(column, row, f"{value:.3f}", ha="center", va="center", fontsize=8, color="w" if is_dark else "k")
        axes.set_xticks(range(grid.shape[1]), [f"{value:g}" for value in grid.columns])
        axes.set_yticks(range(grid.shape[0]), [f"{value:g}" for value in grid.index])
        best = table.loc[table["is_best"]].iloc[0]
        row, column = list(grid.index).index(best["h_pct"]), list(grid.columns).index(best["m_pct"])
        axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor=_MARK, linewidth=2))
        axes.set_title(label, fontsize=drawing.FONT_SIZE)
        axes.set_xlabel("percentile of the spacing error [%]", fontsize=8)
    figure.axes[0].set_ylabel("percentile of the Hellinger distance [%]", fontsize=8)
    return drawing.png(figure)
