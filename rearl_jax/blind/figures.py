"""The figures of a blind study: confusion matrix, and share of named effects by strength."""

import numpy as np

from rearl_jax.blind.questions import QUESTIONS
from rearl_jax.blind.results import BlindResults
from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, panels, png, set_title


def draw_figures(results: BlindResults) -> dict[str, bytes]:
    """PNG files by name, for all figures with data."""
    figures = {"confusion": draw_confusion(results)} if len(results.confusion()) else {}
    return figures | ({"strengths": draw_strengths(results)} if results.strengths else {})


def draw_confusion(results: BlindResults) -> bytes:
    """PNG of the confusion matrix: cells show counts, colours the share of the row."""
    counts = results.confusion()
    hidden, reported = counts["hidden"].tolist(), [name for name in counts.columns if name != "hidden"]
    numbers = counts[reported].to_numpy(dtype=float)
    figure, (axes,) = panels(2.6 + 0.3 * len(reported), 2.2 + 0.24 * len(hidden), generated=True)
    axes.imshow(numbers / numbers.sum(axis=1, keepdims=True), cmap="Blues", vmin=0.0, vmax=1.3, aspect="auto")
    axes.set_xticks(np.arange(len(reported)), reported, rotation=90, fontsize=7)
    axes.set_yticks(np.arange(len(hidden)), hidden, fontsize=7)
    for row, column in zip(*np.nonzero(numbers), strict=True):
        axes.text(column, row, f"{numbers[row, column]:.0f}", ha="center", va="center", fontsize=7)
    axes.set_xlabel("reported")
    axes.set_ylabel("hidden")
    return png(figure)


def draw_strengths(results: BlindResults) -> bytes:
    """PNG of the share of data sets in which the hidden effect is named, by its strength.

    Thin lines are single effects, the thick line with intervals is all of them.
    """
    figure, (axes,) = panels(5.2, 3.7, generated=True)
    effects = dict.fromkeys(row["effect"] for row in results.strengths)
    for effect in effects:
        rows = [row for row in results.strengths if row["effect"] == effect]
        strength = np.array([row["strength"] for row in rows])
        rate = np.array([row["rate"] for row in rows])
        if effect != "all":
            axes.plot(strength, rate, color=GREY, linewidth=0.7, alpha=0.7)
            continue
        low, high = (np.array([row[name] for row in rows]) for name in ("low", "high"))
        spread = np.stack([rate - low, high - rate])
        axes.errorbar(strength, rate, spread, color=BLUE, marker="o", capsize=3, label="all effects, 95 %", zorder=3)
    goal = next(question.goal for question in QUESTIONS if question.name == "identified")
    axes.axhline(goal, color=DARK_GREY, linestyle=":", linewidth=1.0, label="goal at usual strength")
    axes.set_xscale("log", base=2)
    axes.set_xticks([0.25, 0.5, 1.0, 2.0], ["1/4", "1/2", "1", "2"])
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("strength relative to usual")
    axes.set_ylabel("share of data sets named")
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=FONT_SIZE)
    set_title(axes, "Effects of the library, one hidden at a time")
    return png(figure)
