"""The figure of a benchmark: what a vehicle step costs, by the number of vehicles."""

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, StrMethodFormatter

from rearl_jax import drawing
from rearl_jax.bench.results import BenchResults
from rearl_jax.bench.sessions import C_ALL, OURS

LABELS = {
    OURS: "rearl_jax, with collisions",
    "c": "C by hand, no collisions",
    "highway_env": "highway-env",
    "libsumo": "SUMO: IDM, LC2013",
}

_COLOURS = {OURS: drawing.BLUE, "c": drawing.DARK_GREY, "highway_env": drawing.VERMILION, "libsumo": drawing.GREEN}


def draw_costs(results: BenchResults) -> bytes:
    """PNG of the CPU time per vehicle step against vehicles per scenario; bars from least to greatest."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for program in results.programs:
        if program == C_ALL:  # the same program: its CPU time says nothing new
            continue
        items = [item for n in results.numbers if (item := results.find(program, n)) is not None]
        costs = [1e9 / item.substeps_per_cpu_s for item in items]
        spans = [[1e9 / run.substeps_per_cpu_s for run in item.measurements] for item in items]
        below = [cost - min(span) for cost, span in zip(costs, spans, strict=True)]
        above = [max(span) - cost for cost, span in zip(costs, spans, strict=True)]
        axes.errorbar(
            [item.n_vehicles for item in items],
            costs,
            yerr=[below, above],
            color=_COLOURS[program],
            label=LABELS[program],
            marker="o",
            markersize=4,
            linewidth=1.6,
            capsize=2,
        )
    axes.set(xscale="log", yscale="log")
    axes.set(xlabel="vehicles per scenario", ylabel="CPU time per vehicle step [ns]")
    axes.xaxis.set_major_locator(FixedLocator(results.numbers))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(axis="y", color=drawing.LIGHT_GREY, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(frameon=False, fontsize=drawing.FONT_SIZE, loc="outside upper center", ncols=2)
    return drawing.png(figure)
