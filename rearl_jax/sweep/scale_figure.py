"""Figure of `rearl sweep scale`: cost of a rollout by the number simulated at a time, memory by the rollouts done."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from rearl_jax.drawing import BLUE, FONT_SIZE, GREY, ORANGE, add_grid, panels, png, set_title
from rearl_jax.sweep.scale_results import ScaleResults


def draw_scale(results: ScaleResults) -> bytes:
    """PNG with two panels: time per rollout against batch size, both logarithmic, and memory over the rollouts."""
    figure, (cost, memory) = panels(9.0, 3.6, columns=2, generated=results.generated)
    _costs(cost, results)
    _memory(memory, results.stream.table(), results.n_rollouts)
    for panel in (cost, memory):
        add_grid(panel)
        panel.legend(frameon=False, fontsize=FONT_SIZE)
    return png(figure)


def _costs(panel: Axes, results: ScaleResults) -> None:
    batch_sizes = [cost.n_rollouts for cost in results.costs]
    for name, label, colour in (("simulate", "simulation", BLUE), ("score", "scoring", ORANGE)):
        for clock, text, style in (("s", "elapsed", "o--"), ("cpu_s", "CPU", "o-")):
            times = [1000 * getattr(cost, f"{name}_{clock}") for cost in results.costs]
            panel.plot(
                batch_sizes, times, style, color=colour, markersize=4, linewidth=1.4, label=f"{label}, {text} time"
            )
    panel.set(xscale="log", yscale="log", xlabel="rollouts at a time", ylabel="time per rollout [ms]")
    set_title(panel, f"{results.config.method.name}, rollouts of {results.seconds} s")


def _memory(panel: Axes, table: pd.DataFrame, n_rollouts: int) -> None:
    """Draws the progress of a stream of `n_rollouts`, a row per part."""
    series = (("peak_mib", "largest so far", GREY), ("resident_mib", "at the end of a part", BLUE))
    for number, (_, session) in enumerate(table.groupby("session")):
        for name, label, colour in series:
            shown_label = label if number == 0 else None
            style = {"color": colour, "linewidth": 1.4, "label": shown_label}
            # The last point is on the right edge and would be cut there.
            panel.plot(session["rollouts"], session[name], ".-", clip_on=False, zorder=3, **style)
    panel.set_xlim(0, n_rollouts)
    panel.xaxis.set_major_locator(MaxNLocator(4))
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    # The axis starts at zero, so that slopes are not exaggerated, and leaves room for the legend.
    panel.set_ylim(0, 1.3 * panel.get_ylim()[1])
    panel.set(xlabel="rollouts on disk", ylabel="resident memory [MiB]")
    n_sessions = len(set(table["session"]))
    set_title(panel, "memory of the stream" + (f", {n_sessions} sessions" if n_sessions > 1 else ""))
