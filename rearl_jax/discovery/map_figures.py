"""Figures of what the residual depends on, before and after the repair."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from rearl_jax.discovery.atlas import Atlas
from rearl_jax.discovery.maps import Curve, ranked
from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, VERMILION, panels, png, set_title

SHOWN = 6
"""Maps that are drawn."""

LEAST_REACH = 0.3
"""Half height of the smallest map [m/s^2]: what is smaller shall look small."""

_ADDED = ":"


def draw_maps(atlases: Mapping[str, Atlas], added: Mapping[str, np.ndarray], *, generated: bool) -> bytes:
    """PNG of the maps that carry furthest: before, after, and what was added.

    Args:
        atlases: `before`, and `after` where something was added.
        added: Acceleration that was added, at the knots of each variable.
        generated: Whether the data are no measurements.
    """
    best = shown_maps(atlases)
    figure, axes = panels(7.2, 2.2 * -(-len(best) // 3) + 0.7, rows=-(-len(best) // 3), columns=3, generated=generated)
    reach = max(LEAST_REACH, *(np.abs(curve.value).max() for curve in best)) * 1.15
    for panel, curve in zip(axes, best, strict=False):
        panel.tick_params(labelbottom=True)
        panel.sharex(panel)
        _draw(panel, curve, VERMILION, "before")
        name = curve.basis.variable.name
        if "after" in atlases and name in atlases["after"].curves:
            _draw(panel, atlases["after"].curves[name], BLUE, "after")
        if name in added:
            panel.plot(curve.basis.knots, added[name], _ADDED, color=DARK_GREY, linewidth=1.6, label="what was added")
        panel.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
        panel.set_ylim(-reach, reach)
        unit = curve.basis.variable.unit
        panel.set_xlabel(f"{curve.basis.variable.title} [{unit}]", fontsize=8)
    for panel in axes[len(best) :]:
        panel.set_visible(False)
    for panel in axes[::3]:
        panel.set_ylabel("acceleration left [m/s²]", fontsize=8)
    handles = {str(line.get_label()): line for line in axes[0].get_lines() if not str(line.get_label()).startswith("_")}
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=FONT_SIZE
    )
    return png(figure)


def shown_maps(atlases: Mapping[str, Atlas]) -> list[Curve]:
    """The maps that carried furthest before anything was added, those that the finder selected first."""
    atlas = atlases["before"]
    stable = [one.variable for one in atlas.selected if one.frequency >= 0.5]
    order = sorted(ranked(atlas.curves), key=lambda one: one.basis.variable.name not in stable)
    return order[:SHOWN]


def _draw(panel: Axes, curve: Curve, colour: str, label: str) -> None:
    knots = curve.basis.knots
    panel.fill_between(knots, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    panel.plot(knots, curve.value, "o-", color=colour, markersize=2.5, linewidth=1.3, label=label)


def draw_planes(atlases: Mapping[str, Atlas], *, generated: bool) -> bytes:
    """PNG of the maps over two variables: before above, after below."""
    pairs = list(atlases["before"].planes)
    figure, axes = panels(7.2, 2.9 * len(atlases), rows=len(atlases), columns=len(pairs), generated=generated)
    planes = [(model, atlas.planes[pair]) for model, atlas in atlases.items() for pair in pairs]
    reach = max(LEAST_REACH, *(np.nanmax(np.abs(plane.value)) for _, plane in planes if np.isfinite(plane.value).any()))
    mesh = None
    for panel, (model, plane) in zip(axes, planes, strict=True):
        panel.set_facecolor("#EEEEEE")
        mesh = panel.pcolormesh(
            plane.across_edges, plane.up_edges, plane.value, cmap="RdBu_r", vmin=-reach, vmax=reach, rasterized=True
        )
        panel.tick_params(labelbottom=True)
        panel.set(xlabel=f"{plane.across.title} [{plane.across.unit}]", ylabel=f"{plane.up.title} [{plane.up.unit}]")
        set_title(panel, model)
    if mesh is not None:
        figure.colorbar(mesh, ax=axes, pad=0.02, aspect=30).set_label("acceleration left [m/s²]", fontsize=FONT_SIZE)
    return png(figure)
