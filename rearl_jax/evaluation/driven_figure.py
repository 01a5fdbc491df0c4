"""Actions of a policy that drives all vehicles, by speed, as a figure."""

import numpy as np
from jaxtyping import Float, Int

from rearl_jax import drawing
from rearl_jax.baselines.figure import ACTION_COLOURS
from rearl_jax.decision.situation import ACTION_NAMES


def draw_actions(
    counts: Int[np.ndarray, "actions bins"], edges: Float[np.ndarray, " edges"], method: str, *, generated: bool
) -> bytes:
    """PNG with the shares of the actions by the speed they were taken at, and how often that speed was driven.

    Args:
        counts: How often each action was taken, from `driven.count_actions`.
        edges: Edges of the bins of the speed [m/s].
        method: Who drives.
        generated: Whether the data are no measurements.
    """
    total = counts.sum(axis=0)
    figure, (often, shares) = drawing.panels(6.4, 4.8, rows=2, generated=generated)
    often.stairs(total / max(total.sum(), 1) / np.diff(edges), edges, color=drawing.BLUE, linewidth=1.6)
    often.set(ylabel="density [s/m]", ylim=(0, None))
    below = np.zeros(len(total))
    for name, count, colour in zip(ACTION_NAMES, counts, ACTION_COLOURS, strict=True):
        above = below + np.divide(count, total, out=np.zeros(len(total)), where=total > 0)
        shares.stairs(above, edges, baseline=below, fill=True, color=colour, label=name)
        below = above
    shares.set(xlabel="speed before the action [m/s]", ylabel="share of the actions [-]", ylim=(0, 1))
    shares.set_xlim(edges[0], edges[-1])
    shares.legend(frameon=False, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=drawing.FONT_SIZE)
    drawing.set_title(often, f"What {method} does by speed; empty: nobody was so fast or slow")
    return drawing.png(figure)
