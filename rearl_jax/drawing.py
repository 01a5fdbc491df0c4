"""Shared parts of figures: PNG bytes, colours, panels, the mark of generated data.

Drawn without a display and without global state of matplotlib. Matplotlib is slow to import: modules that draw are
imported when figures are drawn, after the tables are printed.
"""

from io import BytesIO
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Distinguishable with any colour vision. Source: Okabe & Ito, Color Universal Design (2008).
BLUE, SKY_BLUE, GREEN = "#0072B2", "#56B4E9", "#009E73"
ORANGE, VERMILION, PURPLE, YELLOW = "#E69F00", "#D55E00", "#CC79A7", "#F0E442"
# Distinguishable by lightness.
DARK_GREY, GREY, LIGHT_GREY = "#333333", "#999999", "#E6E6E6"

SERIES_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, YELLOW)
"""Colours of several series in one panel, in their order."""

DPI = 200
"""Pixels per inch."""

FONT_SIZE = 9
"""Size of titles, labels and legends [pt]."""


def panels(
    width: float, height: float, *, rows: int = 1, columns: int = 1, generated: bool
) -> tuple[Figure, list[Axes]]:
    """A figure [inch] with its panels, rows on one horizontal scale; a figure of generated data is marked as such."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=rows > 1, squeeze=False).ravel().tolist()
    for panel in axes:
        panel.tick_params(labelsize=8)
        panel.spines[["top", "right"]].set_visible(False)
        panel.xaxis.label.set_size(FONT_SIZE)
        panel.yaxis.label.set_size(FONT_SIZE)
    if generated:
        mark = "GENERATED recordings, not measured"
        figure.suptitle(mark, color="#B00020", fontsize=FONT_SIZE, fontweight="bold")
    return figure, axes


def set_title(axes: Axes, text: str) -> None:
    """Writes the title of a panel above its left edge."""
    axes.set_title(text, loc="left", fontsize=FONT_SIZE)


def add_grid(panel: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Draws grid lines behind the data."""
    panel.grid(axis=axis, color=LIGHT_GREY, linewidth=0.6)
    panel.set_axisbelow(True)


def add_legend(figure: Figure) -> None:
    """Draws one legend below all panels; a label that several panels have appears once."""
    handles = {}
    for panel in figure.axes:
        of_panel, labels = panel.get_legend_handles_labels()
        handles |= dict(zip(labels, of_panel, strict=True))
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=FONT_SIZE
    )


def png(figure: Figure, *, dpi: int = DPI) -> bytes:
    """The figure as a PNG file; without date and version inside, so that the same figure is the same file."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()
