"""Figure of the adaptation: shares and errors by round, or the grid as a map."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from rearl_jax import drawing
from rearl_jax.baselines.critical.adaptation import Adaptation, Trial
from rearl_jax.baselines.critical.mixture import GRID_STEPS

_COLOURS = {
    "aggressive": drawing.VERMILION,
    "defensive": drawing.SKY_BLUE,
    "truck": drawing.PURPLE,
    "regular": drawing.LIGHT_GREY,
}
_MAP = "viridis_r"


def draw_adaptation(adaptation: Adaptation, spacing_error: str, *, generated: bool) -> bytes:
    """PNG of all trials.

    Args:
        adaptation: The trials.
        spacing_error: Title of the error of the mean spacing.
        generated: Whether the recordings were generated, not measured.
    """
    is_grid = len({trial.number for trial in adaptation.trials}) < len(adaptation.trials)
    draw = _draw_grid if is_grid else _draw_rounds  # all points of a grid are one round
    return draw(adaptation, spacing_error, generated)


def _draw_rounds(adaptation: Adaptation, spacing_error: str, generated: bool) -> bytes:
    """Shares of the classes as bars, and below them the two errors and the share of crashed vehicles."""
    trials = adaptation.trials
    figure, (shares, errors, crashes) = drawing.panels(6.4, 6.4, rows=3, generated=generated)
    rounds = [trial.number for trial in trials]
    bottom = np.zeros(len(trials))
    for name, colour in _COLOURS.items():
        height = np.array([getattr(trial.mixture, name) for trial in trials])
        shares.bar(rounds, height, bottom=bottom, width=0.6, color=colour, label=name)
        bottom += height
    shares.set(ylabel="share of the vehicles [-]", ylim=(0, 1))
    shares.legend(frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.12), fontsize=drawing.FONT_SIZE)
    lines = {"Hellinger distance": ("h", drawing.BLUE), spacing_error: ("mape", drawing.ORANGE)}
    for label, (name, colour) in lines.items():
        errors.plot(rounds, [getattr(t.assessment, name) for t in trials], "o-", color=colour, label=label)
    highest = max(max(t.assessment.h, t.assessment.mape) for t in trials)
    errors.set(ylabel="error [-]", ylim=(0, 1.3 * highest))  # room for the legend
    errors.legend(frameon=False, ncols=2, fontsize=drawing.FONT_SIZE)
    crashes.bar(rounds, [t.assessment.crashed_share for t in trials], width=0.6, color=drawing.GREY)
    crashes.set(ylabel="share crashed [-]", xlabel="round", xticks=rounds, xlim=(rounds[0] - 0.8, rounds[-1] + 0.8))
    drawing.set_title(shares, f"Mixtures simulated, proposer {adaptation.proposer}; the last mixture is selected")
    return drawing.png(figure)


def _draw_grid(adaptation: Adaptation, spacing_error: str, generated: bool) -> bytes:
    """A map of the sum of the two errors for every share of trucks; a ring marks the selected point."""
    scores = [trial.assessment.score for trial in adaptation.trials]
    norm = Normalize(min(scores), max(scores))
    figure, axes = drawing.panels(7.6, 5.2, rows=2, columns=3, generated=generated)
    selected = adaptation.trials[adaptation.selected]
    trucks = sorted({trial.mixture.truck for trial in adaptation.trials})
    for panel, truck in zip(axes, trucks, strict=True):
        with_trucks = [trial for trial in adaptation.trials if trial.mixture.truck == truck]
        _draw_slice(panel, with_trucks, norm, selected)
        panel.set_title(f"truck {truck:g}", fontsize=drawing.FONT_SIZE)
    for panel in axes[3:]:
        panel.set_xlabel("aggressive [-]")
    for panel in axes[::3]:
        panel.set_ylabel("defensive [-]")
    scale = figure.colorbar(ScalarMappable(norm, _MAP), ax=axes, pad=0.02, aspect=30)
    scale.set_label(f"Hellinger distance + {spacing_error} [-]; ring: smallest sum", fontsize=drawing.FONT_SIZE)
    return drawing.png(figure)


def _draw_slice(panel: Axes, trials: list[Trial], norm: Normalize, selected: Trial) -> None:
    """The grid points with one share of trucks."""
    x, y = ([getattr(trial.mixture, name) for trial in trials] for name in ("aggressive", "defensive"))
    panel.scatter(x, y, c=[t.assessment.score for t in trials], norm=norm, cmap=_MAP, marker="s", s=150)
    for trial in trials:
        is_dark = norm(trial.assessment.score) > 0.5
        text = f"{trial.assessment.score:.2f}"
        place = (trial.mixture.aggressive, trial.mixture.defensive)
        panel.annotate(text, place, ha="center", va="center", fontsize=5, color="white" if is_dark else "black")
    if selected in trials:
        panel.plot(selected.mixture.aggressive, selected.mixture.defensive, "o", mfc="none", mec="red", mew=1.6, ms=17)
    ticks = [step / GRID_STEPS for step in range(GRID_STEPS + 1)]
    panel.set(xlim=(-0.15, 1.15), ylim=(-0.15, 1.15), xticks=ticks, yticks=ticks)
