"""Placeholders: numbers that mean an unknown value, such as -9999.

They are faults of their rows, and must not be taken for evidence that a column is in another unit.
"""

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.lateral_checks import is_below_first
from rearl_jax.data.checks.typed_table import MAX_LANES, RANGES
from rearl_jax.data.checks.unit_checks import ACCELERATION_P99, MIN_STEPS
from rearl_jax.data.problems import Finding
from rearl_jax.data.records import RecordingInfo

# Numbers of nines only, and the largest and smallest integers of two, four and eight bytes, which programs write for
# "no value"; NumPy converts NaN to the integer -2^63, and SUMO writes -2^30.
_INTEGERS = (2.0**15 - 1, 2.0**15, 2.0**16 - 1, 2.0**30, 2.0**31 - 1, 2.0**31, 2.0**63)
NUMBERS = np.array([*(10.0**n - 1 for n in range(3, 11)), *_INTEGERS])
FAR_FACTOR = 10.0  # a position further than this from the middle half of all, in widths of that half, is impossible
MIN_FAR = 1000.0  # m, added to that distance
NEAR = 0.7  # share of a placeholder's acceleration above which another acceleration counts as near to it
MAX_NEAR = 0.1  # largest number of rows near to a placeholder, as a share of its own rows
MIN_REPEATS = 3  # rows with the same impossible acceleration; equal noise in as many rows is no coincidence
UNIT_SHARE = 0.01  # of the rows; if more accelerations are beyond friction, `unit_checks` takes the unit for wrong
APART = 100.0  # m; a number of NUMBERS that is further than this from all positions of vehicles is a placeholder
_POSITIONS = ("position", "lateral", "x", "y")  # x and y may be filled in from the others


def is_placeholder(values: np.ndarray) -> np.ndarray:
    """Mask of the values whose magnitude is one of NUMBERS, and of -1."""
    return np.isin(np.abs(values), NUMBERS) | (values == -1.0)


def unknown_size(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of lengths and widths that are placeholders; a reader may have computed positions from them."""
    for name in ("length", "width"):
        values = table[name].to_numpy()
        bad = is_placeholder(values) & ((values < RANGES[name][0]) | (values > RANGES[name][1]))
        if bad.any():
            text = f"{name} is {values[np.argmax(bad)]:g} m, which seems to mean an unknown value"
            return Finding("out_of_range", name, bad, text, "correct the value")
    return None


def is_far(values: np.ndarray, others: np.ndarray | None = None) -> np.ndarray:
    """Mask of the positions that no vehicle of the road can have, by the middle half of all or of the others; false
    where a position is not finite.
    """
    others = values[np.isfinite(values)] if others is None else others
    if not others.size:
        return np.zeros(len(values), dtype=bool)
    low, high = np.quantile(others, (0.25, 0.75))
    reach = FAR_FACTOR * (high - low) + MIN_FAR
    return (values < low - reach) | (values > high + reach)


def misplaced(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of positions that are placeholders: values of NUMBERS away from all vehicles, and all values far away.

    Far away, any value counts: a reader may have converted a placeholder to m or to the centre of the vehicle.
    """
    for name in _POSITIONS:
        values = table[name].to_numpy()
        marked = is_placeholder(values) & (values != -1.0)
        sound = values[~marked & np.isfinite(values)]
        if not sound.size:
            continue
        bad = marked & ((values < sound.min() - APART) | (values > sound.max() + APART)) | is_far(values, sound)
        if bad.any():
            text = f"{name} is {values[np.argmax(bad)]:g} m, which seems to mean an unknown value"
            return Finding("out_of_range", name, bad, text, "correct the value")
    return None


def nowhere(rows: pd.DataFrame, x: str, y: str) -> Finding:
    """Finding of rows whose two coordinates on a map or in an image are exactly 0: no vehicle is measured there."""
    bad = ((rows[x] == 0.0) & (rows[y] == 0.0)).to_numpy()
    text = "both coordinates are 0, which seems to mean an unknown value"
    return Finding("out_of_range", "x", bad, text, "correct the place")


def unavailable_acceleration(table: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Finding | None:
    """Finding of one repeated acceleration beyond tyre friction and all others, such as ETSI's 16.1 m/s^2 for unknown.

    If the column were in another unit, accelerations beyond friction would differ from each other and form a continuous
    range with the smaller ones.
    """
    values = table["acceleration"].to_numpy()
    size = np.abs(values)
    beyond = values[size > ACCELERATION_P99]
    # In a small table a few rows are so many that they would be taken for another unit.
    least = MIN_STEPS if beyond.size <= UNIT_SHARE * len(values) else MIN_REPEATS
    if beyond.size < least:
        return None
    found, counts = np.unique(beyond, return_counts=True)
    value, n_rows = found[np.argmax(counts)], int(counts.max())
    bad = values == value
    if n_rows < least or np.count_nonzero(~bad & (size > NEAR * abs(value))) > MAX_NEAR * n_rows:
        return None
    text = f"acceleration is {value:g} m/s^2 in {n_rows} rows, which seems to mean an unknown value"
    return Finding("out_of_range", "acceleration", bad, text, "leave it empty where it is unknown")


def impossible_rows(table: pd.DataFrame) -> np.ndarray:
    """Mask of rows with an impossible value in a column whose values are mostly possible, a placeholder, or a direction
    other than 1 and 2.

    These rows are left out of the checks of units, which use medians. If most values of a column on a carriageway are
    impossible, the column is probably in another unit, and only placeholders are marked. Lanes that count from a number
    below 0 are not marked.
    """
    direction = table["direction"].to_numpy()
    bad = ~np.isin(direction, (1, 2))
    for side in (1, 2):
        here = direction == side
        for name, (low, high) in {**RANGES, "lane": (0.0, MAX_LANES - 1.0)}.items():
            values = table[name].to_numpy(dtype=np.float64, na_value=np.nan)
            outside = here & ((values < low) | (values > high))
            if outside.sum() > 0.5 * (here & np.isfinite(values)).sum():
                outside &= is_placeholder(values)
            if name == "lane" and outside.any():
                outside[here] &= ~is_below_first(values[here], table["lateral"].to_numpy()[here])
            bad |= outside
    return bad
