"""Rows that say they are of another recording and cannot be: a wrong clock, place or name of a recording in them.

Real recordings each hold many vehicles, number them anew and begin their tracks on their own.
"""

import numpy as np
import pandas as pd

_MIN_SHARE = 0.05
"""Share of the vehicles of another recording up to which the vehicles of a recording are few."""
_MAX_CHANCE = 0.05
"""Chance up to which it is no accident that two recordings, each with numbers of its own, share no vehicle number."""


def are_few(n_vehicles: int, n_others: int) -> bool:
    """True if a recording has so few vehicles, compared with another, that its rows may be strays of that one."""
    return n_vehicles <= max(1.0, _MIN_SHARE * n_others) and n_vehicles < n_others


def are_shared(track: np.ndarray, frame: np.ndarray, part: np.ndarray, other: np.ndarray) -> bool:
    """True if two parts of the rows have a vehicle at the same frame in common, as only different recordings can."""
    return bool(_keys(track[part], frame[part]).isin(_keys(track[other], frame[other])).any())


def continue_in(track: np.ndarray, frame: np.ndarray, part: np.ndarray, other: np.ndarray) -> bool:
    """True if every vehicle of a part has its next or last frame, and none of its own frames, in the other part."""
    there = _keys(track[other], frame[other])
    if _keys(track[part], frame[part]).isin(there).any():
        return False
    order = part[np.lexsort((frame[part], track[part]))]
    begins = np.append(True, track[order][1:] != track[order][:-1])
    first, last = order[begins], order[np.append(begins[1:], True)]
    before, after = _keys(track[first], frame[first] - 1), _keys(track[last], frame[last] + 1)
    return bool((before.isin(there) | after.isin(there)).all())


def fill_gaps_of(vehicles: np.ndarray, others: np.ndarray) -> bool:
    """True if fewer vehicles than those of another recording have just the numbers that are missing there.

    Args:
        vehicles: Numbers of the vehicles, each once.
        others: Those of the other recording.
    """
    if len(vehicles) >= len(others) or np.isin(vehicles, others).any():
        return False
    taken = len(others) / (max(vehicles.max(), others.max()) - min(vehicles.min(), others.min()) + 1)
    return bool((1.0 - taken) ** len(vehicles) <= _MAX_CHANCE)


def _keys(track: np.ndarray, frame: np.ndarray) -> pd.MultiIndex:
    return pd.MultiIndex.from_arrays([track, frame])
