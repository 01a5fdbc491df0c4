"""Rows of a canonical table (one row per vehicle and frame, see `schema`) by vehicle and frame."""

import numpy as np
import pandas as pd

ABSENT = -1
"""Row number of a vehicle that has no row at a frame."""


def follows_row_before(track: np.ndarray) -> np.ndarray:
    """Mask of the rows that continue the track of the row before."""
    follows = np.zeros(len(track), dtype=bool)
    follows[1:] = track[1:] == track[:-1]
    return follows


def lane_steps(lane: np.ndarray, follows: np.ndarray) -> np.ndarray:
    """Change of the lane from the row before in rows that continue its track, else 0; 0 if a lane is unknown (NaN)."""
    steps = np.diff(lane, prepend=lane[:1])
    return np.where(follows & np.isfinite(steps), steps, 0.0)


def first_and_last_rows(track: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last row of each track; the rows of a track are together."""
    first = np.flatnonzero(~follows_row_before(track))
    return first, np.append(first[1:], len(track))[: len(first)] - 1


class VehicleRows:
    """Rows of each vehicle in a canonical table, which is sorted by track and frame."""

    def __init__(self, table: pd.DataFrame) -> None:
        frame = table["frame"].to_numpy(np.int64)
        # Ranks instead of ids, because products of ids with the number of frames might overflow.
        self._tracks, rank = np.unique(table["track_id"].to_numpy(np.int64), return_inverse=True)
        self._first = int(frame.min(initial=0))
        self._span = int(frame.max(initial=0)) - self._first + 1
        self._keys = rank * self._span + (frame - self._first)

    def rows(self, track: np.ndarray | int, frame: np.ndarray) -> np.ndarray:
        """Rows of vehicles at frames, ABSENT where there are none; a track may be one that the table does not have."""
        if not len(self._keys):
            return np.full(len(frame), ABSENT)
        rank = np.minimum(np.searchsorted(self._tracks, track), len(self._tracks) - 1)
        within = (frame >= self._first) & (frame < self._first + self._span) & (self._tracks[rank] == track)
        wanted = np.where(within, rank * self._span + (frame - self._first), ABSENT)
        place = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return np.where(self._keys[place] == wanted, place, ABSENT)

    def leaders(self, table: pd.DataFrame) -> np.ndarray:
        """Row of the stated leader at the same frame for every row of the same table, ABSENT where there is none."""
        stated = table["leader_id"].to_numpy(dtype=np.float64, na_value=np.nan)
        rows = np.full(len(table), ABSENT)
        known = np.flatnonzero(np.isfinite(stated))
        rows[known] = self.rows(stated[known].astype(np.int64), table["frame"].to_numpy(np.int64)[known])
        return rows
