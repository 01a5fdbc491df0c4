"""The table of the threshold pairs in the terminal."""

from collections.abc import Mapping

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
    base_means: dict[str, float],
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
        thresholds = (f"{row[name]:.4f}" for name in ("threshold_h", "threshold_m"))
        cells = (f"{row['h_pct']:g} %", f"{row['m_pct']:g} %", *thresholds, *_figures(row))
        style = "bold" if number == choice.best else None
        shown.add_row(*cells, f"{100 * row['win_share']:.0f} %", style=style)
    shown.add_row("base", "", "", "", *_figures(base_means), "", style="dim")
    console.print(shown)
    if base_means["h"] + base_means["mape"] < choice.score.min():
        print_notes(console, ["no pair is closer to the recorded scenes than base"])
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


def _figures(row: Mapping[str, float]) -> tuple[str, ...]:
    """Means of a pair or of base as text."""
    errors = (f"{value:.4f}" for value in (row["h"], row["mape"], row["h"] + row["mape"]))
    return (*errors, f"{row['thw']:.2f}", f"{row['lcr']:.4f}", f"{row['collisions']:.3f}")
