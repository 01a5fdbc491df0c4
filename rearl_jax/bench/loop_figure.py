"""The figure of the closed loop's cost: what a simulated second costs, and what the parts add, by size of batch."""

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator, StrMethodFormatter

from rearl_jax import drawing
from rearl_jax.bench.loop_programs import BASE, NEVER, always
from rearl_jax.bench.loop_results import GOAL, Cell, LoopResults
from rearl_jax.config.bench import LoopPolicy

_COLOURS = {LoopPolicy.rank: drawing.VERMILION, LoopPolicy.raw: drawing.PURPLE, LoopPolicy.idle: drawing.GREEN}

_BAR = 0.36
"""Width of a bar, where batches are 1 apart."""


def draw_costs(results: LoopResults) -> bytes:
    """PNG with a column per number of vehicles: CPU time of a simulated second above, what the parts add below."""
    numbers = results.numbers
    width = 0.6 + 3.6 * len(numbers)
    figure, axes = drawing.panels(width, 6.2, rows=2, columns=len(numbers), generated=False)
    policy = results.policies[0]
    for column, n_vehicles in enumerate(numbers):
        cells = [cell for cell in results.cells if cell.n_vehicles == n_vehicles]
        top, bottom = axes[column], axes[len(numbers) + column]
        drawing.set_title(top, f"{n_vehicles} vehicles")
        _draw_lines(top, cells, results.policies)
        _draw_added(bottom, cells, policy)
        bottom.set_xlabel("scenarios at a time")
        if column == 0:
            top.set_ylabel("CPU time per simulated second [us]")
            bottom.set_ylabel("added CPU time, by that of Base [%]")
            top.legend(frameon=False, fontsize=8)
            bottom.legend(frameon=False, fontsize=8)
    figure.suptitle("synthetic references, no data", fontsize=8, color=drawing.GREY)
    return drawing.png(figure)


def _draw_lines(axes: Axes, cells: list[Cell], policies: tuple[LoopPolicy, ...]) -> None:
    """Median and, as bars, least and greatest of the repetitions of each program."""
    styles = {BASE: ("Base", drawing.DARK_GREY), NEVER: ("detection, never triggered", drawing.BLUE)}
    styles |= {always(policy): (f"triggered, {policy.name}", _COLOURS[policy]) for policy in policies}
    for program, (label, colour) in styles.items():
        costs = [[1e6 * cost for cost in cell.costs(program)] for cell in cells]
        middle = [1e6 * cell.cost(program) for cell in cells]
        below = [value - min(spread) for value, spread in zip(middle, costs, strict=True)]
        above = [max(spread) - value for value, spread in zip(middle, costs, strict=True)]
        axes.errorbar(
            range(len(cells)),
            middle,
            yerr=[below, above],
            color=colour,
            label=label,
            marker="o",
            markersize=4,
            linewidth=1.4,
            capsize=2,
        )
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    _frame(axes, cells)


def _draw_added(axes: Axes, cells: list[Cell], policy: LoopPolicy) -> None:
    """What detection and policy add to Base on the same traffic; less than nothing is noise."""
    parts = (
        ("detection", [cell.detection for cell in cells], drawing.BLUE),
        (f"policy {policy.name}", [cell.policy(policy) for cell in cells], _COLOURS[policy]),
    )
    for number, (label, spreads, colour) in enumerate(parts):
        heights = [100 * spread.median for spread in spreads]
        below = [height - 100 * spread.least for height, spread in zip(heights, spreads, strict=True)]
        above = [100 * spread.greatest - height for height, spread in zip(heights, spreads, strict=True)]
        places = [place + (number - 0.5) * _BAR for place in range(len(cells))]
        axes.bar(places, heights, _BAR, yerr=[below, above], label=label, color=colour, capsize=2)
    axes.axhline(0, color=drawing.DARK_GREY, linewidth=0.8)
    axes.axhline(100 * GOAL, color=drawing.DARK_GREY, linewidth=0.8, linestyle="--", label="goal of the detection")
    _frame(axes, cells)


def _frame(axes: Axes, cells: list[Cell]) -> None:
    """Sizes of batches along the axis, equally far apart, and a light grid."""
    axes.xaxis.set_major_locator(FixedLocator(range(len(cells))))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{cell.batch:,}" for cell in cells])
    axes.grid(axis="y", color=drawing.LIGHT_GREY, linewidth=0.8)
    axes.set_axisbelow(True)
