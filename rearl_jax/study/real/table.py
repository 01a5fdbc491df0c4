"""Rows of one table: verdicts on groups of drivers, and errors by calibration protocol before and after the repair."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from rearl_jax.discovery.report.groups_section import with_numbers
from rearl_jax.discovery.report.protocols import PROTOCOLS

WORSE_INCREASE = 0.01
"""Relative increase of the mean gap error above which the repaired model counts as worse [-]."""

FIGURES = ("before", "after", "change", "change_share", "idm", "idm_share")
"""Mean gap error over drivers before and after the repair [m], its change [m] and its relative change [-], the error of
IDM calibrated to the same drivers [m], and the relative difference of the error after from that of IDM [-].
"""

SPEEDS = ("10", "20")
"""Speeds at which equilibrium time gaps are stated [m/s]."""

ROW_COLUMNS = ("set", "title", "group", "drivers", "base", "verdict", "effects", "failed_tests", "worse_in")


def rows_of(name: str, title: str, group: str, verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for each group of a discovery, or the one row of a discovery without groups.

    Args:
        name: Name of the set.
        title: Name of the set in tables.
        group: Name of the drivers of a discovery without groups.
        verdict: As in verdict.json.
    """
    default_base = verdict["data"]["car_following"]
    if "groups" in verdict:
        return [_row(name, title, row["value"], row, row["drivers"], default_base) for row in verdict["groups"]]
    return [_row(name, title, group, verdict, verdict["data"]["drivers"], default_base)]


def _row(
    name: str, title: str, group: str, verdict: Mapping[str, Any], drivers: Mapping[str, int], default_base: str
) -> dict[str, Any]:
    base = verdict["base"]
    protocols = verdict["error"]["protocols"]
    gaps = {protocol: None if errors is None else errors["gap_rmse"]["mean"] for protocol, errors in protocols.items()}
    time_gaps = verdict.get("equilibrium_time_gap") or (base or {}).get("equilibrium_time_gap") or {}
    row: dict[str, Any] = {
        "set": name,
        "title": title,
        "group": group,
        "drivers": sum(drivers.values()),
        "base": default_base if base is None else base["chosen"],
        "verdict": verdict["verdict"],
        "effects": "; ".join(map(with_numbers, verdict["effects"])),
        "failed_tests": ",".join(dict.fromkeys(failed["test"] for failed in verdict["failed_tests"])),
        "worse_in": ",".join(
            protocol
            for protocol in PROTOCOLS
            if (errors := gaps[protocol]) and errors["change_share"]["value"] > WORSE_INCREASE
        ),
    }
    for protocol in PROTOCOLS:
        errors = protocols[protocol]
        row[f"{protocol}_drivers"] = None if errors is None else errors["n_drivers"]
        for figure in FIGURES:
            row |= _figure(f"{protocol}_{figure}", (gaps[protocol] or {}).get(figure))
    for speed in SPEEDS:
        row |= _figure(f"time_gap_{speed}", time_gaps.get(speed))
    return row


def _figure(name: str, value: Mapping[str, float] | None) -> dict[str, float | None]:
    ends = {"": "value", "_low": "low", "_high": "high"}
    return {f"{name}{suffix}": None if value is None else value[end] for suffix, end in ends.items()}


def real_table(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The rows of all sets; missing figures are null, never NaN."""
    table = pd.DataFrame(list(rows))
    whole = ["drivers", *(f"{protocol}_drivers" for protocol in PROTOCOLS)]
    numbers = [name for name in table.columns if name not in (*ROW_COLUMNS, *whole)]
    return table.astype(dict.fromkeys(whole, "Int64") | dict.fromkeys(numbers, "Float64"))
