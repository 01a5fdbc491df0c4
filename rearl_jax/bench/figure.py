"""The figure of a benchmark: what a vehicle step costs, by vehicles, by scenarios at a time and by cores."""

from collections.abc import Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, StrMethodFormatter

from rearl_jax import drawing
from rearl_jax.bench.results import BenchResults, Series
from rearl_jax.bench.sessions import BY_ELAPSED_TIME, OURS

LABELS = {
    OURS: "rearl_jax, with collisions",
    "c": "C by hand, no collisions",
    "highway_env": "highway-env",
    "libsumo": "SUMO: IDM, LC2013",
    "highjax": "HighJax",
}

_COLOURS = {
    OURS: drawing.BLUE,
    "c": drawing.DARK_GREY,
    "highway_env": drawing.VERMILION,
    "libsumo": drawing.GREEN,
    "highjax": drawing.PURPLE,
}


def draw_costs(results: BenchResults) -> bytes:
    """PNG of the CPU time per vehicle step by vehicles and by scenarios at a time, and of the speed by cores; bars from
    least to greatest.
    """
    panels = [_by_vehicles] + [_by_chunk] * bool(results.by_chunk) + [_by_threads] * bool(results.by_threads)
    figure, axes = drawing.panels(1.2 + 4.6 * len(panels), 4.4, columns=len(panels), generated=False)
    for draw, each in zip(panels, axes, strict=True):
        draw(each, results)
        each.grid(axis="y", color=drawing.LIGHT_GREY, linewidth=0.8)
        each.set_axisbelow(True)
        each.legend(frameon=False, fontsize=drawing.FONT_SIZE, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return drawing.png(figure)


def _by_vehicles(axes: Axes, results: BenchResults) -> None:
    """All programs on one core, and the least time that memory and arithmetic need."""
    for program in results.programs:
        if program in BY_ELAPSED_TIME:  # their CPU time says nothing
            continue
        items = [item for n in results.numbers if (item := results.find(program, n)) is not None]
        _draw_costs(axes, [item.n_vehicles for item in items], items, _COLOURS[program], LABELS[program])
    known = [(n, limit) for n in results.numbers if (limit := results.limit_ns(n)) is not None]
    for number, (label, style) in enumerate((("state through memory", ":"), ("arithmetic at peak", "--"))):
        if known:
            heights = [limit[number] for _, limit in known]
            axes.plot([n for n, _ in known], heights, style, color=drawing.GREY, linewidth=1.2, label=label)
    axes.set(yscale="log", xlabel="vehicles per scenario", ylabel="CPU time per vehicle step [ns]")
    axes.yaxis.set_minor_formatter(NullFormatter())
    _mark(axes, results.numbers)


def _by_chunk(axes: Axes, results: BenchResults) -> None:
    """Ours on one core."""
    sizes = [int(item.facts["chunk"]) for item in results.by_chunk]
    _draw_costs(axes, sizes, results.by_chunk, drawing.BLUE, f"{results.by_chunk[0].n_vehicles} vehicles, one core")
    axes.set(xlabel="scenarios at a time", ylabel="CPU time per vehicle step [ns]")
    axes.set_ylim(bottom=0)
    _mark(axes, sizes)


def _by_threads(axes: Axes, results: BenchResults) -> None:
    """Ours on several cores, beside as many times the speed on the first number of them."""
    threads = [int(item.facts["threads"]) for item in results.by_threads]
    speeds = [[run.substeps_per_s / 1e6 for run in item.measurements] for item in results.by_threads]
    middle = [item.substeps_per_s / 1e6 for item in results.by_threads]
    _draw(axes, threads, middle, speeds, drawing.BLUE, f"{results.by_threads[0].n_vehicles} vehicles")
    ideal = [middle[0] * number / threads[0] for number in threads]
    axes.plot(threads, ideal, ":", color=drawing.GREY, linewidth=1.2, label="in proportion")
    axes.set(xlabel="cores", ylabel="million vehicle steps per second")
    axes.set_ylim(bottom=0)
    _mark(axes, threads)


def _draw_costs(axes: Axes, at: Sequence[int], items: Iterable[Series], colour: str, label: str) -> None:
    items = list(items)
    costs = [[1e9 / run.substeps_per_cpu_s for run in item.measurements] for item in items]
    _draw(axes, at, [1e9 / item.substeps_per_cpu_s for item in items], costs, colour, label)


def _draw(
    axes: Axes, at: Sequence[int], middle: list[float], spread: list[list[float]], colour: str, label: str
) -> None:
    below = [value - min(values) for value, values in zip(middle, spread, strict=True)]
    above = [max(values) - value for value, values in zip(middle, spread, strict=True)]
    style = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2}
    axes.errorbar(at, middle, yerr=[below, above], color=colour, label=label, **style)


def _mark(axes: Axes, values: Sequence[int]) -> None:
    """A logarithmic axis with what was measured on it."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(list(values)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
