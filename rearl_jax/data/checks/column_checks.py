"""Checks of whole columns: faults that concern all vehicles, or all vehicles of one carriageway.

The two carriageways of a recording may come from different cameras. Each is checked by itself, because a median over
both hides a fault of the one with fewer vehicles.
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
"""Beginning of the message if one carriageway has the fault and the other has not."""
_PER_CARRIAGEWAY = (lateral_checks.wrong_origin, lateral_checks.wrong_lateral)


def wrong_columns(table: pd.DataFrame, info: RecordingInfo) -> Finding | None:
    """First finding of a column with another unit, sign or origin than the schema's, overall or on one carriageway."""
    if table.empty:
        return None
    carriageways = list(_carriageways(table))
    for check in _CHECKS:
        results = [_of_part(check, table, rows, info) for rows in carriageways]
        faults = [finding for finding in results if finding is not None]
        if faults and len(faults) < len(results):
            return replace(faults[0], message=f"{ALONE}{faults[0].message}")
        # Lanes and lateral positions count from the left edge of each carriageway, so all rows together mean nothing.
        finding = None if check in _PER_CARRIAGEWAY and carriageways else check(table, info)
        finding = finding or (faults[0] if faults else None)
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
    """Finding of a check that is applied to some rows; it marks rows of the whole table."""
    part = table.iloc[rows]
    finding = check(part, info)
    if finding is None:
        return None
    marked = np.zeros(len(table), dtype=bool)
    marked[rows[finding.rows]] = True
    return replace(finding, rows=marked, message=f"direction {part['direction'].iloc[0]}: {finding.message}")
