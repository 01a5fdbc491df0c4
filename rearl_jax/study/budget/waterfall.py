"""The waterfall of the budget: a panel per main error, from Base down to the row with all components."""

import pandas as pd
from matplotlib.axes import Axes

from rearl_jax.drawing import BLUE, DARK_GREY, GREY, VERMILION, add_grid, panels, png, set_title
from rearl_jax.study.budget.components import TITLES
from rearl_jax.study.budget.document import MAIN_ERRORS
from rearl_jax.study.budget.figures import COLUMNS
from rearl_jax.study.budget.tables import FIRST, LAST, OF_REAL

_HALF_BAR = 0.36
"""Half the thickness of a bar."""


def draw_waterfall(table: pd.DataFrame, mape: str, *, generated: bool) -> bytes:
    """PNG of shares of the main errors in budget.parquet; `mape` is the deciding spacing error, `MapeConfig.column`."""
    errors = [name.format(mape=mape) for name in MAIN_ERRORS]
    drawn = [error for error in errors if error in set(table["error"])] or list(dict.fromkeys(table["error"]))[:1]
    shares = table[table["part"].isin(list(TITLES))]
    # In the stated order, from an error that all components can reduce.
    parts = max((rows["part"].tolist() for _, rows in shares.groupby("error", sort=False)), key=len, default=[])
    names = [FIRST, *parts, LAST]
    figure, axes = panels(
        3.2 + 3.0 * max(len(drawn), 1), 1.4 + 0.4 * len(names), columns=max(len(drawn), 1), generated=generated
    )
    for panel, error in zip(axes, drawn, strict=False):  # one empty panel if no error is drawn
        _draw_panel(panel, table[table["error"] == error].set_index("part"), parts)
        titles = ["Base", *(TITLES[name] for name in parts), "all components"]
        panel.set_yticks(range(len(names)), titles if panel is axes[0] else [""] * len(names))
        panel.set_ylim(len(names) - 0.5, -0.5)
        add_grid(panel, "x")
        set_title(panel, COLUMNS[error].title)
    return png(figure)


def _draw_panel(panel: Axes, shares: pd.DataFrame, parts: list[str]) -> None:
    """Bars from the error of the first row to that of the last."""
    level = stated = float(shares.loc[FIRST, "value"])
    rows = {name: row for row, name in enumerate(parts, 1)}
    # Components without a share belong to the first row of this error.
    begin = max((row for name, row in rows.items() if name not in shares.index), default=0)
    panel.barh(begin, level, 2 * _HALF_BAR, color=GREY)
    for name, row in rows.items():
        if name not in shares.index:
            continue
        share = shares.loc[name]
        value = float(share["value"])
        panel.barh(row, -value, 2 * _HALF_BAR, left=level, color=BLUE if value >= 0 else VERMILION)
        if not pd.isna(share["low"]):
            low, high = (level - float(share[end]) for end in ("high", "low"))
            panel.hlines(row, low, high, color=DARK_GREY, linewidth=1.0)
        level, stated = level - value, stated - float(share["stated"])
        panel.plot(stated, row, "x", color=DARK_GREY, markersize=4)
    panel.barh(len(parts) + 1, float(shares.loc[LAST, "value"]), 2 * _HALF_BAR, color=DARK_GREY)
    if OF_REAL in shares.index:
        panel.axvline(float(shares.loc[OF_REAL, "value"]), color=GREY, linewidth=1.2)
    panel.set_xlim(left=0.0)
