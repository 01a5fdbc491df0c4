"""What a validation says: agreement by set and precision, the control, and every exception with its cause."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config.validation import ValidationConfig
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, Table
from rearl_jax.validation.summary import PRECISIONS, where


def document_of(
    groups: pd.DataFrame, scenes: pd.DataFrame, summary: Mapping[str, Any], config: ValidationConfig
) -> Document:
    """The document of a validation.

    Args:
        groups: The table `agreement.parquet`.
        scenes: The table `scenes.parquet`.
        summary: The figures of `summary.json`.
        config: Tolerances.
    """
    sections = [_agreement(groups, precision, summary, config) for precision in PRECISIONS]
    for precision in PRECISIONS:
        excepted = where(scenes, precision=precision, agrees=False)
        if len(excepted):
            sections.append(_exceptions(excepted, precision))
    return Document(
        title="The traffic model against highway-env",
        verdict=f"{_percent(summary['agree_share_f64'])} of {summary['scenes']:,} scenes agree with "
        f"{summary['reference']} at all ticks within {config.tolerance_f64:g} m in float64, and "
        f"{_percent(summary['agree_share_f32'])} before the first contact, within {config.tolerance_f32:g} m, in "
        "float32.",
        sections=(*sections, Section("Control", (_control(summary),))),
        command="validate",
        generated=False,
    )


def _agreement(groups: pd.DataFrame, precision: str, summary: Mapping[str, Any], config: ValidationConfig) -> Section:
    """float64 is judged over all ticks, float32 before the first contact of each scene."""
    whole = precision == "float64"
    ending, scope = ("", "at all ticks") if whole else ("_before_contact", "before the first contact")
    tolerance = config.tolerance_f64 if whole else config.tolerance_f32
    headings = (
        *("scenes", "lane\nchanges", "aborts", "crashed"),
        *("position\n[m]", "speed\n[m/s]", "heading\n[rad]", "decision\nflips"),
        *("lane changes\nalike", "crash flags\nalike", f"agree\n({tolerance:g} m)"),
    )
    rows = []
    for row in where(groups, precision=precision).to_dict("records"):
        cells = (
            *(str(row[name]) for name in ("scenes", "lane_changes", "aborts", "crashes")),
            *(f"{row[name + ending]:.1e}" for name in ("max_dx", "max_dspeed", "max_dheading")),
            str(row["flips" + ending]),
            *(_percent(row[name]) for name in ("lane_change_agreement", "crash_agreement", "agree_share")),
        )
        emphasis = Emphasis.strong if row["level"] == "all" else Emphasis.plain
        rows.append(Row(row["group"], tuple(map(Cell, cells)), emphasis))
    title = f"{precision} against {summary['reference']}, largest differences {scope}"
    note = "lane changes and crash flags: of all ticks, those after contact included"
    return Section(precision, tables=(Table(title, headings, tuple(rows)),), notes=() if whole else (note,))


def _control(summary: Mapping[str, Any]) -> str:
    if not summary["control_scenes"]:
        return "Control: NumPy has no vector functions to switch off on this machine, or validation.control_share is 0."
    return (
        f"Control, highway-env against itself with NumPy's own vector functions ({summary['control_scenes']} scenes):"
        f" {_percent(summary['control_agree_share'])} agree, largest difference {summary['control_max_dx']:.1e} m;"
        f" the core in the same scenes: {_percent(summary['control_core_agree_share'])}."
    )


def _exceptions(excepted: pd.DataFrame, precision: str) -> Section:
    headings = (
        *("cause", "from\n[s]", "first contact\n[s]", "vehicle's\nspeed [m/s]", "largest\n[m]"),
        "highway-env's\nown [m]",
    )
    rows = []
    for row in excepted.to_dict("records"):
        own = row["own_difference"]
        cells = (
            row["cause"],
            f"{row['first_time']:.2f}",
            NONE if pd.isna(row["first_contact"]) else f"{row['first_contact']:.2f}",
            f"{row['first_speed']:.3f}",
            f"{row['max_position']:.1e}",
            NONE if pd.isna(own) else f"{own:.1e}",
        )
        rows.append(Row(f"{row['set']} {row['index']}", tuple(map(Cell, cells))))
    note = "highway-env's own: what it makes of a start one unit in the last place further ahead"
    return Section(
        f"Exceptions in {precision}",
        tables=(Table(f"Scenes that differ in {precision}", headings, tuple(rows)),),
        notes=(note,),
    )


def _percent(share: float | None) -> str:
    """Never rounded up to a full 100 %."""
    if share is None:
        return NONE
    return "100 %" if share == 1 else f"{min(share, 0.9999):.2%}".replace("%", " %")
