"""Checks of whole columns: what is wrong for all vehicles, or for all of one carriageway.

The two carriageways of a recording may come from different cameras, and the median over both hides the smaller one.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.data.checks import lateral_checks, unit_checks
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo

_MIN_VEHICLES = 2  # on a carriageway that is checked by itself; a single vehicle is checked by `motion_checks`

Check = Callable[[pd.DataFrame, RecordingInfo], Finding | None]

_CHECKS: tuple[Check, ...] = (
    unit_checks.wrong_time,
    unit_checks.wrong_speed_or_position,
    unit_checks.wrong_ground,
    unit_checks.wrong_size,
    lateral_checks.wrong_axis,
    lateral_checks.wrong_lateral,
    lateral_checks.wrong_origin,
    lateral_checks.wrong_across,
    unit_checks.wrong_acceleration,
)
ALONE = "only in "
"""Beginning of what is said of one carriageway where the other is sound."""
_OF_CARRIAGEWAYS = (lateral_checks.wrong_origin, lateral_checks.wrong_lateral)


def wrong_columns(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """The first sign that a column has another unit, sign or origin than the schema's, for all or on a carriageway."""
    if table.empty:
        return None
    carriageways = list(_carriageways(table))
    for check in _CHECKS:
        found = [_of_part(check, table, rows, info) for rows in carriageways]
        of_some = [finding for finding in found if finding is not None]
        if of_some and len(of_some) < len(found):
            return replace(of_some[0], message=f"{ALONE}{of_some[0].message}")
        # Each carriageway has lanes and a left edge of its own.
        finding = None if check in _OF_CARRIAGEWAYS and carriageways else check(table, info)
        finding = finding or (of_some[0] if of_some else None)
        if finding is not None:
            return finding
    return None


def _carriageways(table: pd.DataFrame) -> Iterator[np.ndarray]:
    """Rows of each carriageway with enough vehicles, if there are several."""
    direction = table["direction"].to_numpy()
    sides = np.unique(direction)
    for side in sides if len(sides) > 1 else ():
        rows = np.flatnonzero(direction == side)
        if table["track_id"].iloc[rows].nunique() >= _MIN_VEHICLES:
            yield rows


def _of_part(check: Check, table: pd.DataFrame, rows: np.ndarray, info: RecordingInfo) -> Finding | None:
    """The finding of a check in some rows, as rows of the whole table."""
    part = table.iloc[rows]
    finding = check(part, info)
    if finding is None:
        return None
    marked = np.zeros(len(table), dtype=bool)
    marked[rows[finding.rows]] = True
    return replace(finding, rows=marked, message=f"direction {part['direction'].iloc[0]}: {finding.message}")
