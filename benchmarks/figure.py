"""Figure of the core's benchmark: CPU time of a vehicle step by vehicles."""

from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from benchmarks.core_results import CoreResults
from benchmarks.programs import BY_ELAPSED_TIME, OURS, TITLES
from rearl_jax import drawing

_COLOURS = {
    OURS: drawing.BLUE,
    "c": drawing.DARK_GREY,
    "highway_env": drawing.VERMILION,
    "libsumo": drawing.GREEN,
    "highjax": drawing.PURPLE,
}


def draw_costs(results: CoreResults) -> bytes:
    """PNG of the CPU time per vehicle step of all programs; bars from least to greatest of the repetitions."""
    figure, (axes,) = drawing.panels(6.2, 4.4, generated=False)
    for program in results.programs:
        if program in BY_ELAPSED_TIME:  # their CPU time says nothing
            continue
        items = [item for item in results.series if item.program == program]
        middle = [1e9 / item.substeps_per_cpu_s for item in items]
        costs = [[1e9 / run.substeps_per_cpu_s for run in item.measurements] for item in items]
        below = [value - min(values) for value, values in zip(middle, costs, strict=True)]
        above = [max(values) - value for value, values in zip(middle, costs, strict=True)]
        style = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2, "color": _COLOURS[program]}
        axes.errorbar([item.n_vehicles for item in items], middle, [below, above], label=TITLES[program], **style)
    axes.set(xscale="log", yscale="log", xlabel="vehicles per scenario", ylabel="CPU time per vehicle step [ns]")
    axes.xaxis.set_major_locator(FixedLocator(results.numbers))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(axis="y", color=drawing.LIGHT_GREY, linewidth=0.8)
    axes.legend(frameon=False, fontsize=drawing.FONT_SIZE, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return drawing.png(figure)
