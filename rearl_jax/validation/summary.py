"""Figures per set, per size and overall from rows per scene; the flat summary, and the requirements of a run.

Keys of summary.json, overall and with the prefix `n2_`, `n10_`, `n30_`, `n60_` for one size of scene:

| key | meaning |
|---|---|
| scenes, lane_changes, aborts, crashes | scenes; lane changes, changes broken off, crashed vehicles in highway-env |
| agree_share_f64 | share of scenes that agree at all ticks: positions (tolerance_f64), lanes, crash flags |
| agree_share_f32 | the same with tolerance_f32 before the first contact of a scene |
| max_dx_f64, max_dspeed_f64, max_dheading_f64 | largest difference of a position [m], speed [m/s], heading [rad] |
| lane_change_agreement_f64 | share of the lane changes of either run that both make, on the same tick |
| crash_agreement_f64 | share of scenes with equal crash flags at every tick |
| flips_f64 | vehicles whose target lanes differ at any tick |
| ..._before_contact_f64 | the same before the first contact of a scene |
| ..._f32 | the same for float32 |

Only overall: `control_scenes`, `control_agree_share`, `control_max_dx` (highway-env with NumPy's vector functions
against without, judged like float64), `control_core_agree_share` (the core in the same scenes), `exceptions_f64` and
`exceptions_f32` (scenes that disagree, by cause, in float32 before the first contact), `unexplained`, and `reference`.
"""

import numpy as np
import pandas as pd

from rearl_jax.config.validation import ValidationConfig
from rearl_jax.problems import Problem
from rearl_jax.validation.causes import Cause
from rearl_jax.validation.scenarios import SIZES

PRECISIONS = {"float64": "f64", "float32": "f32"}
"""Floating types and the endings of their keys."""

CONTROL = "control"
"""Value in the column of the precision for runs of highway-env in place of the core."""


def rows_with(table: pd.DataFrame, **values: str | int | bool) -> pd.DataFrame:
    """The rows that hold some values, by column."""
    kept = np.ones(len(table), bool)
    for name, value in values.items():
        kept &= table[name].to_numpy() == value
    return table.loc[kept]


def figures(scenes: pd.DataFrame) -> dict[str, float | int | None]:
    """The figures of some scenes in one precision, from rows of `comparison.rows` with the column `agrees`; None if a
    share has nothing to count.
    """
    either = _total(scenes, "lane_changes_either")
    return {
        "scenes": len(scenes),
        **{events: _total(scenes, events) for events in ("lane_changes", "aborts", "crashes")},
        "agree_share": _mean(scenes, "agrees"),
        **{
            f"max_{short}{scope}": _largest(scenes, f"max_{name}{scope}")
            for scope in ("", "_before_contact")
            for short, name in (("dx", "position"), ("dspeed", "speed"), ("dheading", "heading"))
        },
        "lane_change_agreement": _total(scenes, "lane_changes_alike") / either if either else None,
        "crash_agreement": _mean(scenes, "crash_flags_equal"),
        "flips": _total(scenes, "flips"),
        "flips_before_contact": _total(scenes, "flips_before_contact"),
    }


EVENTS = ("scenes", "lane_changes", "aborts", "crashes")
"""Figures that belong to the scenes, not to a precision."""


def groups(scenes: pd.DataFrame) -> pd.DataFrame:
    """Figures per set, per size and overall, one row for each and each precision."""
    rows = []
    for precision in PRECISIONS:
        of_precision = rows_with(scenes, precision=precision)
        parts = [("set", name, part) for name, part in of_precision.groupby("set", sort=False, observed=True)]
        parts += [("size", f"N = {size}", rows_with(of_precision, size=size)) for size in SIZES]
        parts += [("all", "all", of_precision)]
        rows += [
            {"level": level, "group": str(name), "precision": precision, **figures(part)}
            for level, name, part in parts
            if len(part)
        ]
    return pd.DataFrame(rows)


def summarise(scenes: pd.DataFrame, reference: str) -> dict:
    """The flat summary; its keys are in the docstring of this module."""
    summary: dict = {"reference": reference, **_flat(scenes, "")}
    for size in SIZES:
        if len(part := rows_with(scenes, size=size)):
            summary |= _flat(part, f"n{size}_")
    control, core = rows_with(scenes, precision=CONTROL), rows_with(scenes, precision="float64")
    core_in_control_scenes = core.loc[np.isin(core["scenario"].to_numpy(), control["scenario"].to_numpy())]
    summary |= {
        "control_scenes": len(control),
        "control_agree_share": _mean(control, "agrees"),
        "control_max_dx": _largest(control, "max_position"),
        "control_core_agree_share": _mean(core_in_control_scenes, "agrees"),
    }
    for precision, ending in PRECISIONS.items():
        causes = list(rows_with(scenes, precision=precision, agrees=False)["cause"])
        summary[f"exceptions_{ending}"] = {cause.value: causes.count(cause.value) for cause in Cause}
    summary["unexplained"] = sum(
        summary[f"exceptions_{ending}"][Cause.unexplained.value] for ending in PRECISIONS.values()
    )
    return summary


def shortfalls(summary: dict, config: ValidationConfig) -> list[Problem]:
    """Requirements that the run has not met; empty if all are met."""
    unmet = []
    for events in ("lane_changes", "aborts", "crashes"):
        least = round(getattr(config, f"least_{events}") * config.share)
        if (n_events := summary[events]) < least:
            message = f"only {n_events} {events.replace('_', ' ')} occurred, which is too few (least {least})"
            remedy = f"raise validation.scenes.*, or lower validation.least_{events}"
            unmet.append(Problem("events-too-few", message, remedy, value=n_events))
    double, single = summary["agree_share_f64"], summary["agree_share_f32"]
    if double < config.least_agree_share:
        message = f"{double:.2%} of the scenes agree in float64 within {config.tolerance_f64:g} m, less than "
        message += f"validation.least_agree_share = {config.least_agree_share:.2%}"
        unmet.append(Problem("float64-differs", message, value=f"{double:.2%}"))
    if single < 1:
        message = (
            f"{single:.2%} of the scenes agree in float32 within {config.tolerance_f32:g} m before the first contact"
        )
        unmet.append(Problem("float32-differs", message, value=f"{single:.2%}"))
    if n_scenes := summary["unexplained"]:
        message = f"{n_scenes} scenes differ without an explanation; see cause in scenes.parquet"
        unmet.append(Problem("unexplained", message, value=n_scenes))
    return unmet


def _flat(scenes: pd.DataFrame, prefix: str) -> dict:
    flat: dict = {}
    for precision, ending in PRECISIONS.items():
        for name, value in figures(rows_with(scenes, precision=precision)).items():
            flat[prefix + (name if name in EVENTS else f"{name}_{ending}")] = value
    return flat


def _total(scenes: pd.DataFrame, name: str) -> int:
    return int(scenes[name].to_numpy().sum())


def _mean(scenes: pd.DataFrame, name: str) -> float | None:
    return float(scenes[name].to_numpy().mean()) if len(scenes) else None


def _largest(scenes: pd.DataFrame, name: str) -> float | None:
    return float(scenes[name].to_numpy().max()) if len(scenes) else None
