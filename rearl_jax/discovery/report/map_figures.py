"""Figures of the residual's dependences on one variable (maps) and on two (planes), before and after effects were
added.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rearl_jax.discovery.search.atlas import Atlas
from rearl_jax.discovery.search.maps import Curve
from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, VERMILION, panels, png, set_title

MOST_MAPS = 6
"""Largest number of maps that is drawn."""

LEAST_REACH = 0.3
"""Smallest half height of a map [m/s^2], so that small dependences look small."""

COLUMNS = 3
"""Maps per row."""


def draw_maps(atlases: Mapping[str, Atlas], added: Mapping[str, np.ndarray], *, generated: bool) -> bytes:
    """PNG of the maps with the largest gains: before, after if effects were added, and the added acceleration at the
    knots of the variables that it depends on.
    """
    best = shown_maps(atlases)
    n_rows = -(-len(best) // COLUMNS)
    figure, axes = _grid(2.2 * n_rows + 0.7, n_rows, COLUMNS, generated=generated)
    reach = max(LEAST_REACH, *(np.abs(curve.value).max() for curve in best)) * 1.15
    for panel, curve in zip(axes, best, strict=False):  # the last row may have more panels than maps
        _draw(panel, curve, VERMILION, "before")
        name = curve.basis.variable.name
        if "after" in atlases and name in atlases["after"].curves:
            _draw(panel, atlases["after"].curves[name], BLUE, "after")
        if name in added:
            panel.plot(curve.basis.knots, added[name], ":", color=DARK_GREY, linewidth=1.6, label="added effects")
        panel.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
        panel.set_ylim(-reach, reach)
        unit = curve.basis.variable.unit.replace("^2", "²")
        share = next(selection.frequency for selection in atlases["before"].selected if selection.variable == name)
        panel.set_title(f"selected in {100 * share:.0f} % of the halves", loc="left", fontsize=7, color=DARK_GREY)
        panel.set_xlabel(f"{curve.basis.variable.title} [{unit}]", fontsize=8)
    for panel in axes[len(best) :]:
        panel.set_visible(False)
    for panel in axes[::COLUMNS]:
        panel.set_ylabel("acceleration residual [m/s²]", fontsize=8)
    lines = [line for panel in axes for line in panel.get_lines() if not str(line.get_label()).startswith("_")]
    handles = {str(line.get_label()): line for line in lines}
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=FONT_SIZE
    )
    return png(figure)


def shown_maps(atlases: Mapping[str, Atlas]) -> list[Curve]:
    """The maps with the largest gains on held-out drivers before any effect was added; first those of variables that
    sparse regression selects in at least half of the halves of the drivers.
    """
    atlas = atlases["before"]
    often_selected = [selection.variable for selection in atlas.selected if selection.frequency >= 0.5]

    def place(curve: Curve) -> tuple[bool, float]:
        return curve.basis.variable.name not in often_selected, -curve.gain

    return sorted(atlas.curves.values(), key=place)[:MOST_MAPS]


def _draw(panel: Axes, curve: Curve, colour: str, label: str) -> None:
    knots = curve.basis.knots
    panel.fill_between(knots, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    panel.plot(knots, curve.value, "o-", color=colour, markersize=2.5, linewidth=1.3, label=label)


def draw_planes(atlases: Mapping[str, Atlas], *, generated: bool) -> bytes:
    """PNG of the planes: before in the upper row, after in the lower row."""
    pairs = list(atlases["before"].planes)
    figure, axes = _grid(2.9 * len(atlases), len(atlases), len(pairs), generated=generated)
    planes = [(model, atlas.planes[pair]) for model, atlas in atlases.items() for pair in pairs]
    sizes = [np.nanmax(np.abs(plane.value)) for _, plane in planes if np.isfinite(plane.value).any()]
    reach = max([LEAST_REACH, *sizes])
    mesh = None
    for panel, (model, plane) in zip(axes, planes, strict=True):
        panel.set_facecolor("#EEEEEE")
        mesh = panel.pcolormesh(
            plane.across_edges, plane.up_edges, plane.value, cmap="RdBu_r", vmin=-reach, vmax=reach, rasterized=True
        )
        panel.set(xlabel=f"{plane.across.title} [{plane.across.unit}]", ylabel=f"{plane.up.title} [{plane.up.unit}]")
        set_title(panel, model)
    if mesh is not None:
        figure.colorbar(mesh, ax=axes, pad=0.02, aspect=30).set_label(
            "acceleration residual [m/s²]", fontsize=FONT_SIZE
        )
    return png(figure)


def _grid(height: float, rows: int, columns: int, *, generated: bool) -> tuple[Figure, list[Axes]]:
    """A figure with panels on separate horizontal scales; height in inches."""
    figure, (whole_area,) = panels(7.2, height, generated=generated)
    whole_area.remove()
    axes = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for panel in axes:
        panel.tick_params(labelsize=8)
        panel.spines[["top", "right"]].set_visible(False)
        panel.xaxis.label.set_size(8)
        panel.yaxis.label.set_size(8)
    return figure, axes
