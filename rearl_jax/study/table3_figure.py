"""The figure of the threshold pairs: one error against the other, with Pareto-optimal pairs marked."""

import numpy as np
import pandas as pd

from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, VERMILION, panels, png, set_title
from rearl_jax.study.published import PARETO_PAIRS


def draw_pairs(pairs: pd.DataFrame, n_scenes: int, *, generated: bool) -> bytes:
    """PNG of all pairs of `pair_results.read_pairs`, base last: left with base and intervals, right the pairs alone."""
    pairs, base = pairs.iloc[:-1], pairs.iloc[-1:]
    best, front = pairs.loc[pairs["is_best"]], pairs.loc[pairs["is_pareto"]].sort_values("h")
    figure, (left, right) = panels(10.0, 4.8, columns=2, generated=generated)
    for axes in (left, right):
        axes.plot(pairs["h"], pairs["mape"], "o", color=BLUE, markersize=4, linestyle="", label="pairs")
        axes.set_xlabel("Hellinger distance [-]")
    for row, colour, label in ((best, VERMILION, "least sum"), (base, GREY, "base")):
        x_lengths, y_lengths = _interval_lengths(row, "h"), _interval_lengths(row, "mape")
        left.errorbar(row["h"], row["mape"], y_lengths, x_lengths, fmt="o", color=colour, capsize=2, label=label)
    left.set_ylabel("spacing error [-]")
    set_title(left, f"{len(pairs)} pairs and base; {n_scenes} tuning scenes")
    right.plot(front["h"], front["mape"], color=BLUE, linewidth=1.0, label="no other pair is closer in both")
    published = pairs.loc[[pair in PARETO_PAIRS for pair in zip(pairs["h_pct"], pairs["m_pct"], strict=True)]]
    if len(published):
        style = {"color": DARK_GREY, "mfc": "none", "markersize": 9, "linestyle": ""}
        right.plot(published["h"], published["mape"], "D", **style, label="paper's")
    right.plot(best["h"], best["mape"], "o", color=VERMILION)
    for name, x, y in zip(pairs["row"], pairs["h"], pairs["mape"], strict=True):
        text = name.replace(" %", "")
        right.annotate(text, (x, y), xytext=(4, 3), textcoords="offset points", fontsize=6, rotation=30)
    right.margins(0.12)
    right.legend(frameon=False, fontsize=FONT_SIZE)
    left.legend(frameon=False, fontsize=FONT_SIZE)
    set_title(right, "The pairs alone, named by percentiles of H / MAPE")
    return png(figure)


def _interval_lengths(row: pd.DataFrame, name: str) -> list[np.ndarray] | None:
    """Lengths of the interval below and above the mean; None without an interval."""
    value, low, high = (row[column].to_numpy(np.float64) for column in (name, f"{name}_low", f"{name}_high"))
    return [value - low, high - value] if np.isfinite(low).all() else None
