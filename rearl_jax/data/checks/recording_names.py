"""Check of recording names in a table: finds rows of one recording under two names, by mistake or by spelling."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from rearl_jax.data.checks.stray_rows import are_few, are_shared
from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording


def without_blanks(names: pd.Series) -> pd.Series:
    """Names of recordings without blanks around them; None for empty names."""
    plain = {name: name.strip() or None for name in names.dropna().unique()}
    return names if all(name == word for name, word in plain.items()) else pd.Series(names.map(plain))


def require_own_rows(rows: pd.DataFrame, file: str, column: str) -> None:
    """Raise BadRecordingError if a recording of few vehicles is part of another one.

    It is if its vehicles continue in the other one, or if the two names differ by case or blanks only. The rows have
    the columns `recording`, `track_id`, and `frame` or `time`.
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
    few = [code for code, number in enumerate(n_vehicles) if are_few(int(number), int(n_vehicles.max()))]
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
        if number == n_vehicles[part] and are_few(int(number), int(n_vehicles[other]))
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
