"""The figure of the inference times: a line per program, a colour per batch size, a logarithmic axis."""

from itertools import cycle

import pandas as pd

from rearl_jax.drawing import DARK_GREY, SERIES_COLOURS, add_grid, add_legend, panels, png, set_title
from rearl_jax.study.table4_tables import MODEL, PAPER, TITLES
from rearl_jax.timing.decision_steps import PAPER_MS


def draw_timings(table: pd.DataFrame, n_steps: int) -> bytes:
    """PNG of all programs of the long table, and the paper's figures."""
    programs = [name for name in TITLES if name == MODEL or name in set(table["row"])]
    batches = sorted(table["batch"].unique())
    figure, (axes,) = panels(7.2, 1.4 + 0.4 * len(programs), generated=False)
    for batch, colour in zip(batches, cycle(SERIES_COLOURS), strict=False):
        of_batch = table.loc[table["batch"] == batch]
        middle, low, high = (of_batch[name].to_numpy(float) for name in ("ours", "low", "high"))
        axes.errorbar(
            middle,
            [programs.index(program) for program in of_batch["row"]],
            xerr=[middle - low, high - middle],
            fmt="o",
            color=colour,
            markersize=5,
            capsize=2,
            label=f"ours, {batch:,} at a time",
        )
    published = [(PAPER_MS[name], programs.index(program)) for program, name in PAPER.items() if program in programs]
    axes.plot(*zip(*published, strict=True), "D", color=DARK_GREY, mfc="none", linestyle="", label="paper")
    axes.set_xscale("log")
    axes.set_xlabel("elapsed time [ms]")
    axes.set_yticks(range(len(programs)), [TITLES[name] for name in programs])
    axes.set_ylim(len(programs) - 0.5, -0.5)
    add_grid(axes)
    add_legend(figure)
    set_title(axes, f"{n_steps} consecutive decision steps; synthetic references, no data")
    return png(figure)
