"""The figure of the threshold pairs: one error against the other, and which pairs no other beats in both."""

from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, VERMILION, panels, png, set_title
from rearl_jax.study.pair_results import PairResults, PairRow
from rearl_jax.study.published import PARETO_PAIRS


def draw_pairs(results: PairResults, *, generated: bool) -> bytes:
    """PNG of all pairs: left beside base with intervals, right among each other."""
    figure, (left, right) = panels(10.0, 4.8, columns=2, generated=generated)
    for axes in (left, right):
        axes.plot(*_errors(results.pairs), "o", color=BLUE, markersize=4, linestyle="", label="pairs")
        axes.set_xlabel("Hellinger distance [-]")
    for row, colour, label in ((results.best, VERMILION, "least sum"), (results.base, GREY, "base")):
        (x,), (y,) = _errors([row])
        left.errorbar(
            x, y, xerr=_reach(row, "h"), yerr=_reach(row, "mape"), fmt="o", color=colour, capsize=2, label=label
        )
    left.set_ylabel("spacing error [-]")
    set_title(left, f"{len(results.pairs)} pairs and base; {results.n_scenes} tuning scenes")
    right.plot(*_errors(results.front), color=BLUE, linewidth=1.0, label="no other pair is closer in both")
    published = [row for row in results.pairs if row.pair in PARETO_PAIRS]
    if published:
        right.plot(*_errors(published), "D", color=DARK_GREY, mfc="none", markersize=9, linestyle="", label="paper's")
    right.plot(*_errors([results.best]), "o", color=VERMILION)
    for row in results.pairs:
        at = (row.means["h"], row.means["mape"])
        name = row.name.replace(" %", "")
        right.annotate(name, at, xytext=(4, 3), textcoords="offset points", fontsize=6, rotation=30)
    right.margins(0.12)
    right.legend(frameon=False, fontsize=FONT_SIZE)
    left.legend(frameon=False, fontsize=FONT_SIZE)
    set_title(right, "The pairs alone, named by percentiles of H / MAPE")
    return png(figure)


def _errors(rows: list[PairRow]) -> tuple[list[float], list[float]]:
    return [row.means["h"] for row in rows], [row.means["mape"] for row in rows]


def _reach(row: PairRow, name: str) -> list[list[float]] | None:
    """How far the interval reaches below and above the mean; None without one."""
    low, high = row.ends[name]
    return None if low is None or high is None else [[row.means[name] - low], [high - row.means[name]]]
