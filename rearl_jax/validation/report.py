"""The tables in the terminal."""

import pandas as pd
from rich.markup import escape
from rich.table import Table

from rearl_jax.config.validation import ValidationConfig
from rearl_jax.console import standard_output, titled_table
from rearl_jax.validation.summary import PRECISIONS, where

_WIDTH = 130
"""Width [characters] at which no column is cut off."""


def print_report(groups: pd.DataFrame, scenes: pd.DataFrame, summary: dict, config: ValidationConfig) -> None:
    """Prints one table per precision, the control, and every exception with its cause."""
    console = standard_output(_WIDTH)
    for precision in PRECISIONS:
        console.print(_agreement_table(where(groups, precision=precision), precision, summary, config))
    console.print(_control_text(summary))
    for precision in PRECISIONS:
        excepted = where(scenes, precision=precision, agrees=False)
        if len(excepted):
            console.print(_exception_table(excepted, precision))


def _agreement_table(groups: pd.DataFrame, precision: str, summary: dict, config: ValidationConfig) -> Table:
    """float64 is judged over all ticks, float32 before the first contact of each scene."""
    whole = precision == "float64"
    ending, scope = ("", "at all ticks") if whole else ("_before_contact", "before the first contact")
    tolerance = config.tolerance_f64 if whole else config.tolerance_f32
    table = titled_table(f"{precision} against {summary['reference']}, largest differences {scope}")
    table.add_column("set")
    for heading in ("scenes", "lane\nchanges", "aborts", "crashed"):
        table.add_column(heading, justify="right")
    for heading in ("position\n[m]", "speed\n[m/s]", "heading\n[rad]", "decision\nflips"):
        table.add_column(escape(heading), justify="right")
    for heading in ("lane changes\nalike", "crash flags\nalike", f"agree\n({tolerance:g} m)"):
        table.add_column(heading, justify="right")
    level = None
    for row in groups.to_dict("records"):
        if level is not None and row["level"] != level:
            table.add_section()
        level = row["level"]
        table.add_row(
            row["group"],
            *(str(row[name]) for name in ("scenes", "lane_changes", "aborts", "crashes")),
            *(f"{row[name + ending]:.1e}" for name in ("max_dx", "max_dspeed", "max_dheading")),
            str(row["flips" + ending]),
            *(_percent(row[name]) for name in ("lane_change_agreement", "crash_agreement", "agree_share")),
        )
    if not whole:
        table.caption = "lane changes and crash flags: of all ticks, those after contact included"
    return table


def _control_text(summary: dict) -> str:
    if not summary["control_scenes"]:
        return "Control: NumPy has no vector functions to switch off on this machine, or validation.control_share is 0."
    return (
        f"Control, highway-env against itself with NumPy's own vector functions ({summary['control_scenes']} scenes):"
        f" {_percent(summary['control_agree_share'])} agree, largest difference {summary['control_max_dx']:.1e} m;"
        f" the core in the same scenes: {_percent(summary['control_core_agree_share'])}."
    )


def _exception_table(excepted: pd.DataFrame, precision: str) -> Table:
    table = titled_table(f"Scenes that differ in {precision}")
    for heading in ("scene", "cause"):
        table.add_column(heading)
    for heading in (
        "from\n[s]",
        "first contact\n[s]",
        "vehicle's\nspeed [m/s]",
        "largest\n[m]",
        "highway-env's\nown [m]",
    ):
        table.add_column(escape(heading), justify="right")
    for row in excepted.to_dict("records"):
        own = row["own_difference"]
        table.add_row(
            f"{row['set']} {row['index']}",
            row["cause"],
            f"{row['first_time']:.2f}",
            "-" if pd.isna(row["first_contact"]) else f"{row['first_contact']:.2f}",
            f"{row['first_speed']:.3f}",
            f"{row['max_position']:.1e}",
            "-" if pd.isna(own) else f"{own:.1e}",
        )
    table.caption = "highway-env's own: what it makes of a start one unit in the last place further ahead"
    return table


def _percent(share: float | None) -> str:
    """Never rounded up to a full 100 %."""
    if share is None:
        return "-"
    return "100 %" if share == 1 else f"{min(share, 0.9999):.2%}".replace("%", " %")
