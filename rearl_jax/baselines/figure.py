"""The learning curve as a figure."""

import pandas as pd

from rearl_jax import drawing
from rearl_jax.decision.situation import ACTION_NAMES

ACTION_COLOURS = (drawing.ORANGE, drawing.LIGHT_GREY, drawing.PURPLE, drawing.GREEN, drawing.SKY_BLUE)
"""Colours of the actions, in the order of `MetaAction`."""


def draw_curve(curve: pd.DataFrame) -> bytes:
    """PNG with four panels over the vehicle-seconds: return, crashes, mean speed, shares of the actions."""
    figure, axes = drawing.panels(6.4, 7.6, rows=4, generated=False)
    steps = curve["car_steps"] / 1e6
    lines = [("return", "return [-]", drawing.BLUE), ("crashed", "vehicles that crash [-]", drawing.VERMILION)]
    lines += [("speed", "mean speed [m/s]", drawing.BLUE)]
    for panel, (name, label, colour) in zip(axes, lines, strict=False):  # the fourth panel is drawn below
        panel.plot(steps, curve[name], ".-", color=colour, linewidth=1.4)
        panel.set(ylabel=label)
        panel.grid(color=drawing.LIGHT_GREY, linewidth=0.6)
    for panel in axes[:2]:
        panel.set_ylim(0, None)
    shares = [curve[name] for name in ACTION_NAMES]
    axes[3].stackplot(steps, shares, labels=ACTION_NAMES, colors=ACTION_COLOURS)
    axes[3].set(ylabel="share of the actions [-]", xlabel="vehicle-seconds [million]", ylim=(0, 1))
    axes[3].legend(frameon=False, fontsize=drawing.FONT_SIZE, ncols=5, loc="upper center", bbox_to_anchor=(0.5, 1.3))
    drawing.set_title(axes[0], "PPO during training; actions are drawn")
    return drawing.png(figure)
