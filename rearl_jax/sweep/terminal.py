"""The table of the threshold pairs in the terminal."""

import pandas as pd

from rearl_jax.config import SweepThresholdsTask
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.evaluation.percentiles import BaseValues
from rearl_jax.sweep.pairs import Choice, Pair

_WIDTH = 114
"""Columns the table needs."""


def print_pairs(
    config: SweepThresholdsTask,
    pairs: list[Pair],
    table: pd.DataFrame,
    choice: Choice,
    base: BaseValues,
    note: str,
) -> None:
    """Prints one row per pair and what the choice is worth."""
    console = standard_output(_WIDTH)
    definition = config.mape.definition.name
    shown = titled_table(f"Threshold pairs on the tuning scenes{note}")
    for heading in ("H pct", "MAPE pct", "H >", f"MAPE {definition} >", "H", f"MAPE {definition}", "sum"):
        shown.add_column(heading, justify="right")
    for heading in ("THW, s", "LCR", "crashed", "best in"):
        shown.add_column(heading, justify="right")
    for number, row in enumerate(table.to_dict("records")):
        cells = (
            f"{row['h_pct']:g} %",
            f"{row['m_pct']:g} %",
            *(f"{row[name]:.4f}" for name in ("threshold_h", "threshold_m", "h", "mape", "score")),
            *(f"{row['thw']:.2f}", f"{row['lcr']:.4f}", f"{row['collisions']:.3f}", f"{100 * row['win_share']:.0f} %"),
        )
        shown.add_row(*cells, style="bold" if number == choice.best else None)
    console.print(shown)
    percent = f"{100 * config.eval.confidence:g} %"
    verdict = "can" if choice.is_distinguishable else "cannot"
    notes = (
        f"thresholds: percentiles of base on {len(base.scene)} scenes, {len(base.h)} Hellinger distances and"
        f" {len(base.mape)} spacing errors",
        f"best: {pairs[choice.best].name}, ahead of {pairs[choice.runner_up].name} by {choice.lead:.4f}"
        f" ({percent} bootstrap over scenes {choice.lead_low:.4f} to {choice.lead_high:.4f}):"
        f" these scenes {verdict} tell the two apart",
        "best in: share of the resamples of the scenes in which the pair has the least sum",
    )
    print_notes(console, notes)
