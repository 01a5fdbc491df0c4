"""The figure of Table 1: a line per row, a panel per metric; our figures with intervals, and the paper's."""

from matplotlib.axes import Axes

from rearl_jax.config import StudyTable1Task
from rearl_jax.drawing import BLUE, DARK_GREY, GREY, ORANGE, VERMILION, add_grid, add_legend, panels, png, set_title
from rearl_jax.evaluation.scores import reference_of
from rearl_jax.study.row_results import Results
from rearl_jax.study.rows import Role
from rearl_jax.study.table1_tables import TITLES_OF_METRICS, paper_figure

DRAWN_METRICS = ("h_legacy", "mape", "thw", "lcr", "collisions")
"""Metrics with a panel; `mape` is that of `mape.definition`."""

_COLOURS = {Role.method: BLUE, Role.matcher: VERMILION, Role.control: ORANGE}

_LINEAR_RATE = 0.001
"""Lane-change rate below which the scale is linear [1/s]: rates span three orders of magnitude and may be 0."""


def draw_rows(config: StudyTable1Task, results: Results, *, generated: bool) -> bytes:
    """PNG of all rows."""
    metrics = [config.mape.column if name == "mape" else name for name in DRAWN_METRICS]
    n_rows = len(results.rows)
    figure, axes = panels(12.0, 1.6 + 0.3 * max(n_rows, 3), columns=len(metrics), generated=generated)
    for panel, metric in zip(axes, metrics, strict=True):
        _draw_panel(panel, results, metric)
        panel.set_ylim(n_rows - 0.5, -0.5)
        titles = [item.row.title for item in results.rows]
        panel.set_yticks(range(n_rows), titles if panel is axes[0] else [""] * n_rows)
        panel.set_xlabel(TITLES_OF_METRICS[metric])
        add_grid(panel, "y")
        if metric == "lcr":
            panel.set_xscale("symlog", linthresh=_LINEAR_RATE)
            panel.set_xlim(right=2 * panel.dataLim.x1)
        panel.set_xlim(left=0)
    kind = "generated" if generated else "recorded"
    set_title(axes[0], f"{results.n_scenes} {kind} scenes; paper: highD")
    add_legend(figure)
    return png(figure)


def _draw_panel(panel: Axes, results: Results, metric: str) -> None:
    real = results.reference.estimates.get((reference_of(metric), metric))
    if real is not None:
        panel.axvline(real.value, color=GREY, linewidth=1.2, label="recorded (real against real for H and MAPE)")
    for role, colour in _COLOURS.items():
        points = [
            (position, estimate)
            for position, item in enumerate(results.rows)
            if item.row.role is role and (estimate := item.estimate(metric)) is not None
        ]
        if not points:
            continue
        positions, values = [position for position, _ in points], [estimate.value for _, estimate in points]
        panel.plot(values, positions, "o", color=colour, markersize=4, label=f"ours: {role.name}", clip_on=False)
        for position, estimate in points:
            if estimate.low is not None and estimate.high is not None:
                panel.hlines(position, estimate.low, estimate.high, color=colour, linewidth=1.4)
    published = [
        (position, value)
        for position, item in enumerate(results.rows)
        if (value := paper_figure(item.row.paper, metric)) is not None
    ]
    if published:
        positions, values = zip(*published, strict=True)
        panel.plot(values, positions, "D", color=DARK_GREY, mfc="none", markersize=5, linestyle="", label="paper")
