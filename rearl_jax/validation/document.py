"""Document of a validation: agreement by set and precision, the control, and every exception with its cause."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config.validation import ValidationConfig
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import NONE, Emphasis, table_of
from rearl_jax.validation.summary import PRECISIONS, rows_with

_SHARES = ("lane_change_agreement", "crash_agreement", "agree_share")

_EXCEPTION = {
    "scene": "scene",
    "cause": "cause",
    "first_time": "first differs\n[s]",
    "first_contact": "first contact\n[s]",
    "first_speed": "vehicle's\nspeed [m/s]",
    "max_position": "largest\ndifference [m]",
    "own_difference": "highway-env's\nown [m]",
}


def document_of(
    groups: pd.DataFrame, scenes: pd.DataFrame, summary: Mapping[str, Any], config: ValidationConfig
) -> Document:
    """The document of a validation, from agreement.parquet, scenes.parquet and summary.json."""
    sections = [_agreement(groups, precision, summary, config) for precision in PRECISIONS]
    note = (
        "highway-env's own: difference between two runs of highway-env whose initial positions differ by one rounding "
        "unit"
    )
    for precision in PRECISIONS:
        excepted = rows_with(scenes, precision=precision, agrees=False)
        if len(excepted):
            named = excepted.assign(scene=excepted["set"] + " " + excepted["index"].astype(str))
            table = table_of(f"Scenes that differ in {precision}", named, _EXCEPTION)
            sections.append(Section(f"Exceptions in {precision}", tables=(table,), notes=(note,)))
    return Document(
        title="The traffic model compared with highway-env",
        verdict=f"{_percent(summary['agree_share_f64'])} of {summary['scenes']:,} scenes agree with "
        f"{summary['reference']} at all ticks within {config.tolerance_f64:g} m in float64, and "
        f"{_percent(summary['agree_share_f32'])} before the first contact, within {config.tolerance_f32:g} m, in "
        "float32.",
        sections=(*sections, Section("Control", (_control(summary),))),
        command="validate",
        generated=False,
    )


def _agreement(groups: pd.DataFrame, precision: str, summary: Mapping[str, Any], config: ValidationConfig) -> Section:
    """Section on the agreement of one precision: float64 over all ticks, float32 before the first contact of each
    scene.
    """
    is_double = precision == "float64"
    ending, scope = ("", "at all ticks") if is_double else ("_before_contact", "before the first contact")
    columns = {
        "group": "set",
        "scenes": "scenes",
        "lane_changes": "lane\nchanges",
        "aborts": "aborts",
        "crashes": "crashed",
        f"max_dx{ending}": "position\n[m]",
        f"max_dspeed{ending}": "speed\n[m/s]",
        f"max_dheading{ending}": "heading\n[rad]",
        f"flips{ending}": "decision\nflips",
        "lane_change_agreement": "lane changes\nalike",
        "crash_agreement": "crash flags\nalike",
        "agree_share": f"agree\n({config.tolerance_f64 if is_double else config.tolerance_f32:g} m)",
    }
    rows = rows_with(groups, precision=precision)
    rows = rows.assign(**{name: rows[name].map(_percent) for name in _SHARES})
    title = f"{precision} against {summary['reference']}, largest differences {scope}"
    note = "lane changes and crash flags: of all ticks, those after contact included"
    table = table_of(title, rows, columns, {"all": Emphasis.strong})
    return Section(precision, tables=(table,), notes=() if is_double else (note,))


def _control(summary: Mapping[str, Any]) -> str:
    if not summary["control_scenes"]:
        return "Control: NumPy has no vector functions to switch off on this machine, or validation.control_share is 0."
    return (
        f"Control, highway-env against itself with NumPy's own vector functions ({summary['control_scenes']} scenes):"
        f" {_percent(summary['control_agree_share'])} agree, largest difference {summary['control_max_dx']:.1e} m;"
        f" the core in the same scenes: {_percent(summary['control_core_agree_share'])}."
    )


def _percent(share: float | None) -> str:
    """Text of a share [-], never rounded up to a full 100 %."""
    if share is None or pd.isna(share):
        return NONE
    return "100 %" if share == 1 else f"{min(share, 0.9999):.2%}".replace("%", " %")
