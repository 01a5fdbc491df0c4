"""Detection of stray rows: a wrong time, place or name assigns them to another recording than their own.

Separate recordings each hold many vehicles and number them independently, and no track continues from one to another.
Below, `track` and `frame` are columns of a table, `part` and `other` row numbers in it.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.vehicle_rows import first_and_last_rows

_MIN_SHARE = 0.05
"""Largest number of vehicles that count as few, as a share of the vehicles of the other recording [-]."""
_MAX_CHANCE = 0.05
"""Probability of two independently numbered recordings to share no number, below which this is no coincidence [-]."""


def are_few(n_vehicles: int, n_others: int) -> bool:
    """True if a recording has so few vehicles, compared with another, that its rows may be stray rows of that one."""
    return n_vehicles <= max(1.0, _MIN_SHARE * n_others) and n_vehicles < n_others


def require_own_runs(
    run: np.ndarray, track: np.ndarray, file: Path, column: str, time: np.ndarray | None = None
) -> None:
    """Raise BadRecordingError for a run of few vehicles or rows, which seem to be those of the largest one.

    Rows without a run are passed over; `column` is that of the runs, `time` that of each row, if known.
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
    if time is not None:
        rows = pd.DataFrame({"recording": run, "track_id": track, "time": time}).dropna().convert_dtypes()
        require_own_rows(rows, str(file), column)


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
    """True if a recording has fewer vehicles than another one, and numbers missing there; each vehicle occurs once."""
    if len(vehicles) >= len(others) or np.isin(vehicles, others).any():
        return False
    taken = len(others) / (max(vehicles.max(), others.max()) - min(vehicles.min(), others.min()) + 1)
    return bool((1.0 - taken) ** len(vehicles) <= _MAX_CHANCE)


def _keys(track: np.ndarray, frame: np.ndarray) -> pd.MultiIndex:
    return pd.MultiIndex.from_arrays([track, frame])


def without_blanks(names: pd.Series) -> pd.Series:
    """Names of recordings without blanks around them; None for empty names."""
    plain = {name: name.strip() or None for name in names.dropna().unique()}
    return names if all(name == word for name, word in plain.items()) else pd.Series(names.map(plain))


def require_own_rows(rows: pd.DataFrame, file: str, column: str) -> None:
    """Raise BadRecordingError if a recording of few vehicles or rows is part of another one.

    It is if its vehicles continue in the other one, or if the two names differ by case or blanks only. The rows have
    the columns `recording`, `track_id`, and `frame` or `time`; the error counts them from 1.
    """
    code, values = pd.factorize(rows["recording"])
    names = [str(name) for name in values]
    frame = _frames(rows)
    if len(names) < 2 or frame is None:
        return
    track = pd.factorize(rows["track_id"])[0]
    known = (code >= 0) & (track >= 0)
    table = pd.DataFrame({"recording": code[known], "track": track[known], "frame": frame[known]})
    pairs = np.unique(np.stack([code[known], track[known]]), axis=1)
    n_vehicles = np.bincount(pairs[0], minlength=len(names))
    suspects = [*_same_but_for_case(names, n_vehicles), *_continued(table, n_vehicles)]
    for few, many in suspects:
        part, other = np.flatnonzero(code == few), np.flatnonzero(code == many)
        # False for a recording that was divided in two in time, which is allowed.
        is_simultaneous = np.isin(frame[part], frame[other]).any()
        if is_simultaneous and not are_shared(track, frame, part, other):
            first = rows["track_id"].iloc[part[0]]
            first = f"{first:g}" if isinstance(first, float) else first
            text = f"{len(part)} rows of vehicle {first}"
            text += f" and {n_vehicles[few] - 1} others" if n_vehicles[few] > 1 else ""
            text += f" are of recording {names[few]!r}, and those beside them of {names[many]!r}"
            remedy = "give all rows of a recording one name"
            row = int(part[0]) + 1
            raise bad_recording("recording-contradicts", text, remedy, file, column=column, row=row)


def _same_but_for_case(names: Sequence[str], n_vehicles: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of recordings whose names differ by case or blanks only; the one with fewer vehicles comes first."""
    plain = pd.Series([" ".join(name.casefold().split()) for name in names])
    groups = [sorted(same, key=lambda code: n_vehicles[code]) for same in plain.groupby(plain).groups.values()]
    return [(few, same[-1]) for same in groups for few in same[:-1]]


def _continued(table: pd.DataFrame, n_vehicles: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of recordings: one of few vehicles, and one that has the frame before or after those of each of them."""
    n_rows = np.bincount(table["recording"], minlength=len(n_vehicles))
    few = [
        code
        for code, number in enumerate(n_vehicles)
        if are_few(int(number), int(n_vehicles.max())) or are_few(int(n_rows[code]), int(n_rows.max()))
    ]
    ends = table[table["recording"].isin(few)].groupby(["recording", "track"])["frame"].agg(["min", "max"])
    ends = ends.reset_index()
    matches = []
    for end, step in (("min", -1), ("max", 1)):
        adjacent = ends.assign(frame=ends[end] + step)[["recording", "track", "frame"]]
        same = adjacent.merge(table, on=["track", "frame"], suffixes=("", "_other"))
        matches.append(same[same["recording"] != same["recording_other"]])
    continued = pd.concat(matches)[["recording", "recording_other", "track"]].to_numpy()
    pairs, counts = np.unique(np.unique(continued, axis=0)[:, :2], axis=0, return_counts=True)
    return [
        (int(part), int(other))
        for (part, other), number in zip(pairs, counts, strict=True)
        if number == n_vehicles[part]
        and (are_few(int(number), int(n_vehicles[other])) or are_few(int(n_rows[part]), int(n_rows[other])))
    ]


def _frames(rows: pd.DataFrame) -> np.ndarray | None:
    """Frame of each row, or its time as a number of frame intervals; None without either."""
    name = next((name for name in ("frame", "time") if name in rows), None)
    if name is None:
        return None
    values = numbers_of(pd.Series(rows[name]))
    if not np.isfinite(values).all():
        return 2 * pd.factorize(rows[name])[0]  # even numbers, so that none counts as the frame after another
    steps = np.diff(np.unique(values))
    return np.rint((values - values.min()) / np.median(steps)).astype(np.int64) if steps.size else np.zeros(len(rows))
