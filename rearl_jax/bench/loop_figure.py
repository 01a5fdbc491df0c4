"""The figure of the closed loop's cost: what a simulated second costs, and what the parts add, by size of batch."""

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, StrMethodFormatter

from rearl_jax import drawing
from rearl_jax.bench.loop_programs import BASE, NEVER, always
from rearl_jax.bench.loop_results import GOAL, Cell, LoopResults
from rearl_jax.config.bench import LoopPolicy

_COLOURS = {LoopPolicy.rank: drawing.VERMILION, LoopPolicy.raw: drawing.PURPLE, LoopPolicy.idle: drawing.GREEN}


def draw_costs(results: LoopResults) -> bytes:
    """PNG with a column per number of vehicles: CPU time of a simulated second above, stacked shares of Base below."""
    numbers = results.numbers
    width = 0.6 + 3.6 * len(numbers)
    figure, axes = drawing.panels(width, 6.2, rows=2, columns=len(numbers), generated=False)
    policy = results.policies[0]
    for column, n_vehicles in enumerate(numbers):
        cells = [cell for cell in results.cells if cell.n_vehicles == n_vehicles]
        top, bottom = axes[column], axes[len(numbers) + column]
        drawing.set_title(top, f"{n_vehicles} vehicles")
        _draw_lines(top, cells, results.policies)
        _draw_stack(bottom, cells, policy)
        bottom.set_xlabel("scenarios at a time")
        if column == 0:
            top.set_ylabel("CPU time per simulated second [us]")
            bottom.set_ylabel("CPU time by that of Base [-]")
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
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    _frame(axes, cells)


def _draw_stack(axes: Axes, cells: list[Cell], policy: LoopPolicy) -> None:
    """What Base, detection and policy cost on the same traffic; the loop whose traffic follows the orders as a mark."""
    detection = [cell.detection.median for cell in cells]
    parts = (
        ("Base", [1.0] * len(cells), drawing.GREY),
        ("+ detection", detection, drawing.BLUE),
        (f"+ policy {policy.name}, nobody asked", [cell.policy(policy).median for cell in cells], _COLOURS[policy]),
    )
    bottom = [0.0] * len(cells)
    for label, heights, colour in parts:
        axes.bar(range(len(cells)), heights, 0.6, bottom=bottom, label=label, color=colour)
        bottom = [below + height for below, height in zip(bottom, heights, strict=True)]
    ratios = [cell.ratio(always(policy)).median for cell in cells]
    axes.plot(range(len(cells)), ratios, "D", color=drawing.DARK_GREY, markersize=5, label=f"triggered, {policy.name}")
    axes.axhline(1 + GOAL, color=drawing.DARK_GREY, linewidth=0.8, linestyle="--")
    _frame(axes, cells)


def _frame(axes: Axes, cells: list[Cell]) -> None:
    """Sizes of batches along the axis, equally far apart, and a light grid."""
    axes.xaxis.set_major_locator(FixedLocator(range(len(cells))))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{cell.batch:,}" for cell in cells])
    axes.grid(axis="y", color=drawing.LIGHT_GREY, linewidth=0.8)
    axes.set_axisbelow(True)
