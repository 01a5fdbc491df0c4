"""Detection of stray rows: a wrong time, place or name assigns them to another recording than their own.

Separate recordings each hold many vehicles and number them independently, and no track continues from one to another.
Below, `track` and `frame` are columns of a table, `part` and `other` row numbers in it.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.data.problems import bad_recording
from rearl_jax.data.vehicle_rows import first_and_last_rows

_MIN_SHARE = 0.05
"""Largest number of vehicles that count as few, as a share of the vehicles of the other recording [-]."""
_MAX_CHANCE = 0.05
"""Probability of two independently numbered recordings to share no number, below which this is no coincidence [-]."""


def are_few(n_vehicles: int, n_others: int) -> bool:
    """True if a recording has so few vehicles, compared with another, that its rows may be stray rows of that one."""
    return n_vehicles <= max(1.0, _MIN_SHARE * n_others) and n_vehicles < n_others


def require_own_runs(run: np.ndarray, track: np.ndarray, file: Path, column: str) -> None:
    """Raise BadRecordingError for a run of few vehicles, whose rows seem to be those of the largest one.

    Rows without a run are passed over; `column` is that of the runs.
    """
    vehicles = pd.DataFrame({"run": run, "track": track}).dropna().groupby("run")["track"].unique()
    if len(vehicles) < 2:
        return
    largest = vehicles.map(len).idxmax()
    others = vehicles.pop(largest)
    for name, own in vehicles.items():
        if are_few(len(own), len(others)) or fill_gaps_of(own, others):
            first, of_others = (f"{value:g}" if isinstance(value, float) else value for value in (name, largest))
            text = f"run {first} has {len(own)} vehicles, such as {own[0]:g}, and run {of_others} {len(others)}"
            remedy, row = "give their rows the run of the others, or remove them", int(np.argmax(run == name)) + 1
            raise bad_recording("recording-contradicts", text, remedy, file, column=column, row=row)


def are_shared(track: np.ndarray, frame: np.ndarray, part: np.ndarray, other: np.ndarray) -> bool:
    """True if two parts of the rows have a vehicle and frame in common, which happens in different recordings only."""
    return bool(_keys(track[part], frame[part]).isin(_keys(track[other], frame[other])).any())


def continue_in(track: np.ndarray, frame: np.ndarray, part: np.ndarray, other: np.ndarray) -> bool:
    """True if the other part has the frame before or after those of every vehicle of a part, and none of its frames."""
    there = _keys(track[other], frame[other])
    if _keys(track[part], frame[part]).isin(there).any():
        return False
    order = part[np.lexsort((frame[part], track[part]))]
    first, last = (order[rows] for rows in first_and_last_rows(track[order]))
    before, after = _keys(track[first], frame[first] - 1), _keys(track[last], frame[last] + 1)
    return bool((before.isin(there) | after.isin(there)).all())


def fill_gaps_of(vehicles: np.ndarray, others: np.ndarray) -> bool:
    """True if a recording has fewer vehicles, each given once, than another one, and the numbers missing there."""
    if len(vehicles) >= len(others) or np.isin(vehicles, others).any():
        return False
    taken = len(others) / (max(vehicles.max(), others.max()) - min(vehicles.min(), others.min()) + 1)
    return bool((1.0 - taken) ** len(vehicles) <= _MAX_CHANCE)


def _keys(track: np.ndarray, frame: np.ndarray) -> pd.MultiIndex:
    return pd.MultiIndex.from_arrays([track, frame])
