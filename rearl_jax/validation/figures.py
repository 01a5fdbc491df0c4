"""The difference of position against time, one panel per set."""

import math

import pandas as pd
from matplotlib.figure import Figure

from rearl_jax import drawing

COLOURS = {"float64": drawing.BLUE, "float32": drawing.VERMILION}

DRAWN_ZERO = 1e-17
"""Difference at which zero is drawn [m], because the axis is logarithmic."""


def error_over_time(errors: pd.DataFrame, tolerances: dict[str, float]) -> bytes:
    """A PNG: for each set the largest difference over scenes and vehicles, on a logarithmic scale.

    Args:
        errors: Columns set, precision, scope (`all` or `before_contact`), time [s], median [m], largest [m].
        tolerances: Tolerance of each precision [m].
    """
    names = list(errors["set"].drop_duplicates())
    n_columns = min(4, len(names))
    n_rows = math.ceil(len(names) / n_columns)
    figure = Figure(figsize=(3.6 * n_columns, 2.5 * n_rows + 0.9), layout="constrained")
    axes = figure.subplots(n_rows, n_columns, sharex=True, sharey=True, squeeze=False)
    for axis, name in zip(axes.flat, names, strict=False):  # the last panels may be left over
        errors_of_set = errors[errors["set"] == name]
        for precision, colour in COLOURS.items():
            part = errors_of_set[errors_of_set["precision"] == precision]
            for scope, style in (("all", ":"), ("before_contact", "-")):
                line = part[part["scope"] == scope]
                label = f"{precision}, largest" + (" before contact" if scope == "before_contact" else "")
                axis.plot(line["time"], line["largest"].clip(DRAWN_ZERO), style, color=colour, lw=1.1, label=label)
            median = part[part["scope"] == "all"]
            label = f"{precision}, median"
            axis.plot(median["time"], median["median"].clip(DRAWN_ZERO), color=colour, lw=0.7, alpha=0.45, label=label)
            axis.axhline(tolerances[precision], color=colour, lw=0.6, ls="--")
        axis.set_title(name, fontsize=drawing.FONT_SIZE)
        axis.set_yscale("log")
        axis.grid(alpha=0.25, lw=0.5)
    for axis in axes.flat[len(names) :]:
        axis.set_axis_off()
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for axis in axes[:, 0]:
        axis.set_ylabel("difference of position [m]", fontsize=8)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle("The core against highway-env, tick by tick (dashed: tolerance)", fontsize=10)
    return drawing.png(figure, dpi=130)
