"""The figure of the errors second by second: one row of panels per method, one column per metric, Hellinger distance
left and spacing error right.
"""

from matplotlib.axes import Axes

from rearl_jax.drawing import BLUE, DARK_GREY, GREY, add_legend, panels, png, set_title
from rearl_jax.evaluation.estimates import BASE
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.study.error_series import Band, ErrorSeries


def draw_series(series: list[ErrorSeries], metrics: tuple[str, str], *, generated: bool) -> bytes:
    """PNG of all methods, each compared with base and real against real (recorded scenes against each other)."""
    by_name = {item.name: item for item in series}
    base, real = by_name[BASE], by_name[REAL_VS_REAL]
    rows = [item for item in series if item is not real]
    figure, axes = panels(8.0, 0.8 + 1.35 * len(rows), rows=len(rows), columns=len(metrics), generated=generated)
    for column, metric in enumerate(metrics):
        column_axes = axes[column :: len(metrics)]
        top = max(_top(item.errors[metric]) for item in series)
        for panel, item in zip(column_axes, rows, strict=True):
            _draw_band(panel, real.errors[metric], GREY, real.title)
            if item is not base:
                line = base.errors[metric]
                panel.plot(line.second, line.mean, "--", color=DARK_GREY, linewidth=1.0, label=base.title)
            _draw_band(panel, item.errors[metric], BLUE, "this method")
            panel.set_ylim(0, 1.05 * top if top > 0 else None)
            panel.set_ylabel(HEADINGS[metric])
            if column == 0:
                set_title(panel, item.title)
        column_axes[-1].set_xlabel("time [s]")
    add_legend(figure)
    return png(figure)


def _top(errors: Band) -> float:
    """Upper limit of an axis: the top of the band, but at most twice the largest mean, so that a wide band does not
    flatten the lines; 0 without any second.
    """
    return float(min(errors.high.max(initial=0.0), 2 * errors.mean.max(initial=0.0)))


def _draw_band(panel: Axes, errors: Band, colour: str, label: str) -> None:
    if not len(errors.second):
        return
    panel.fill_between(errors.second, errors.low, errors.high, color=colour, alpha=0.2, linewidth=0)
    panel.plot(errors.second, errors.mean, color=colour, linewidth=1.5, label=label)
