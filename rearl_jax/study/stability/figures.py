"""Figures of the study of stability: amplification by frequency, and flow by density."""

from collections.abc import Mapping
from itertools import cycle

import pandas as pd
from matplotlib.axes import Axes

from rearl_jax.drawing import FONT_SIZE, SERIES_COLOURS, add_grid, panels, png, set_title


def draw_figures(tables: Mapping[str, pd.DataFrame], *, generated: bool) -> dict[str, bytes]:
    """PNG files by name."""
    drawn = {
        "amplification": _amplification(tables["amplification"], generated),
        "fundamental_diagram": _fundamental_diagram(tables["flow"], generated),
    }
    return {name: content for name, content in drawn.items() if content is not None}


def _amplification(table: pd.DataFrame, generated: bool) -> bytes | None:
    speeds = sorted(set(table["speed"].tolist()))
    if not speeds:
        return None
    figure, axes = panels(3.2 * len(speeds) + 0.8, 3.4, columns=len(speeds), generated=generated)
    for panel, speed in zip(axes, speeds, strict=True):
        models = table[table["speed"] == speed].groupby("model", sort=False)
        for (name, rows), colour in zip(models, cycle(SERIES_COLOURS), strict=False):
            panel.plot(rows["frequency"], rows["analysis"], color=colour, linewidth=1.2, label=str(name))
            panel.plot(rows["frequency"], rows["simulated"], "o", color=colour, markersize=3)
        panel.axhline(1.0, color="black", linewidth=0.6)
        panel.set_xscale("log")
        _finish(panel, f"at {speed:g} m/s", "frequency [Hz]", "amplification [-]")
    axes[0].legend(frameon=False, fontsize=FONT_SIZE - 2)
    return png(figure)


def _fundamental_diagram(table: pd.DataFrame, generated: bool) -> bytes | None:
    if table.empty:
        return None
    figure, (panel,) = panels(6.4, 4.0, generated=generated)
    for (name, rows), colour in zip(table.groupby("model", sort=False), cycle(SERIES_COLOURS), strict=False):
        for start, fill in (("even", colour), ("jam", "none")):
            part = rows[rows["start"] == start]
            label = str(name) if start == "even" else None
            panel.plot(part["density"], part["flow"], "o-", color=colour, mfc=fill, markersize=4, lw=0.8, label=label)
    panel.legend(frameon=False, fontsize=FONT_SIZE - 1)
    _finish(panel, "one lane", "density [vehicles/km]", "flow [vehicles/h]")
    return png(figure)


def _finish(panel: Axes, title: str, x: str, y: str) -> None:
    panel.set(xlabel=x, ylabel=y)
    add_grid(panel)
    set_title(panel, title)
