"""Speed profiles of tracks, by which a recording is recognised as a copy of an earlier one.

A profile is the speed of a track over some seconds; it does not depend on clock, origin, ids and frame rate. Vehicles
of two recordings are the same if their profiles are equal at times with a constant offset. All profiles of a few tracks
are compared with a few profiles of every track of earlier recordings.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from rearl_jax.data.vehicle_rows import first_and_last_rows

_LENGTH = 6.0  # s, of a profile
_SPACING = 0.5  # s, between the speeds of a profile
_EVERY = 3.0  # s, between the stored profiles of a track; a stretch in both recordings of twice this length is found
_STEP = 0.1  # s, between the profiles that are compared with stored ones
_MIN_CHANGE = 0.5  # m/s, of the speed within a profile; steady vehicles are all alike
_CLOSE = 0.06  # m/s, more than a speed changes by rounding to one decimal and by another frame rate
_N_COMPARED = 32  # tracks of a recording that are compared
_MAX_COMPARED = 30_000  # profiles of a recording that are compared
_MAX_KEPT = 200_000  # profiles of a recording that are stored
_NEIGHBOURS = 4  # most similar stored profiles of each
_MIN_SHARE = 0.8  # of the tracks in the time that both recordings cover, for one to be a copy
_MIN_TRACKS = 2


@dataclass(frozen=True)
class Copy:
    """An earlier recording that has the vehicles of another one.

    Attributes:
        recording: Number of the earlier recording, in the order in which recordings were added.
        share: Share of the compared vehicles that are in both recordings [-].
        offset: Times of the earlier recording minus those of the other one [s].
    """

    recording: int
    share: float
    offset: float

    TOLERANCE: ClassVar[float] = 0.15
    """Largest deviation of a vehicle's time offset from that of the recording [s]."""


class Profiles:
    """The speed profiles of one recording.

    Attributes:
        track: Number of the track of each stored profile, counted from 0.
        time: Start of each profile [s].
        speeds: Speeds of each profile [m/s], one profile per row.
    """

    def __init__(self, table: pd.DataFrame) -> None:
        starts, last = first_and_last_rows(table["track_id"].to_numpy())
        time, self._speed = table["time"].to_numpy(np.float64), table["speed"].to_numpy(np.float64)
        self._begin, self._end = time[starts], time[last]
        # Tracks one after the other on a common time axis, so that one interpolation serves all.
        self._shift = np.concatenate([[0.0], np.cumsum(self._end - self._begin + 1.0)[:-1]]) - self._begin
        self._axis = time + np.repeat(self._shift, last - starts + 1)
        n_kept = np.sum(np.maximum(self._end - self._begin - _LENGTH, 0.0)) / _EVERY
        self.every = _EVERY * max(1.0, np.ceil(n_kept / _MAX_KEPT))
        self.track, self.time, self.speeds = self._at(np.arange(len(starts)), self.every)

    def compared(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Track, start and speeds of the profiles of a few tracks at all times."""
        tracks = np.unique(self.track)
        chosen = tracks[np.unique(np.linspace(0, len(tracks) - 1, min(len(tracks), _N_COMPARED)).astype(int))]
        n_each = np.cumsum(np.maximum(self._end - self._begin - _LENGTH, 0.0)[chosen] / _STEP)
        return self._at(chosen[: max(_MIN_TRACKS, int(np.searchsorted(n_each, _MAX_COMPARED)))], _STEP)

    def _at(self, tracks: np.ndarray, every: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Track, start and speeds of profiles that begin `every` seconds, without those of nearly constant speed."""
        begin, span = self._begin[tracks], self._end[tracks] - self._begin[tracks] - _LENGTH
        n_profiles = np.where(span >= 0.0, np.floor(np.maximum(span, 0.0) / every + 1e-9) + 1, 0).astype(np.int64)
        which = np.repeat(np.arange(len(tracks)), n_profiles)
        within = np.arange(len(which)) - np.repeat(np.cumsum(n_profiles) - n_profiles, n_profiles)
        track, time = tracks[which], begin[which] + every * within
        after_start = np.arange(0.0, _LENGTH + 0.5 * _SPACING, _SPACING)
        at = (time + self._shift[track])[:, None] + after_start
        speeds = np.interp(at, self._axis, self._speed).astype(np.float32)
        changes = np.ptp(speeds, axis=1) >= _MIN_CHANGE
        return track[changes], time[changes], speeds[changes]


class SpeedProfiles:
    """The profiles of the recordings added so far."""

    def __init__(self) -> None:
        self._recordings: list[Profiles] = []
        # Each tree holds the profiles of consecutive recordings from `first` on. Small trees are merged into larger
        # ones, so that each of n profiles is sorted log n times instead of once per recording.
        self._trees: list[tuple[int, KDTree]] = []

    def add(self, profiles: Profiles) -> None:
        """Stores the profiles of a recording."""
        self._recordings.append(profiles)
        if not len(profiles.track):
            return
        first, speeds = len(self._recordings) - 1, profiles.speeds
        while self._trees and self._trees[-1][1].n <= 2 * len(speeds):
            first, tree = self._trees.pop()
            speeds = np.concatenate([tree.data.astype(np.float32), speeds])
        self._trees.append((first, KDTree(speeds, balanced_tree=False, compact_nodes=False)))

    def copy_of(self, profiles: Profiles) -> Copy | None:
        """The earlier recording that shares the largest share of vehicles; None if none shares enough."""
        if not self._trees or not len(profiles.track):
            return None
        track, time, speeds = profiles.compared()
        copies = []
        for number, own, other in self._matches(speeds):
            earlier = self._recordings[number]
            copies.append(_compared(profiles, earlier, (track, time), own, other, number))
        return max((copy for copy in copies if copy is not None), key=lambda copy: copy.share, default=None)

    def _matches(self, speeds: np.ndarray) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """For each recording with similar profiles: its number, rows of `speeds`, and indices of its profiles."""
        found = []
        for place, (first, tree) in enumerate(self._trees):
            stop = self._trees[place + 1][0] if place + 1 < len(self._trees) else len(self._recordings)
            distance, nearest = tree.query(speeds, k=_NEIGHBOURS, p=np.inf, distance_upper_bound=_CLOSE)
            own, column = np.nonzero(np.isfinite(distance))
            other = np.asarray(nearest)[own, column]
            sizes = [len(recording.track) for recording in self._recordings[first:stop]]
            starts = np.concatenate([[0], np.cumsum(sizes)])
            which = np.searchsorted(starts, other, side="right") - 1
            found += [
                (first + int(number), own[which == number], other[which == number] - starts[number])
                for number in np.unique(which)
            ]
        return found


def _compared(
    profiles: Profiles,
    earlier: Profiles,
    compared: tuple[np.ndarray, np.ndarray],
    own: np.ndarray,
    other: np.ndarray,
    number: int,
) -> Copy | None:
    """The earlier recording as a copy, if most tracks of the smaller recording are in the other at one time offset.

    Args:
        profiles: Those of the new recording.
        earlier: Those of the earlier recording.
        compared: Track and start [s] of the compared profiles of the new recording.
        own: Of each pair of similar profiles, the index in `compared`.
        other: Of each pair, the index in `earlier`.
        number: Number of the earlier recording.
    """
    track, time = compared
    offsets = earlier.time[other] - time[own]
    order = np.argsort(offsets)
    n_near = np.searchsorted(offsets[order], offsets[order] + Copy.TOLERANCE) - np.arange(len(order))
    best = int(np.argmax(n_near))
    offset = float(np.median(offsets[order][best : best + n_near[best]]))
    same = np.abs(offsets - offset) <= Copy.TOLERANCE
    n_same = min(len(np.unique(track[own[same]])), len(np.unique(earlier.track[other[same]])))
    if n_same < _MIN_TRACKS:
        return None
    low, high = earlier.time.min() - offset, earlier.time.max() - offset
    # Only tracks whose speed changes for so long that a stored profile must be among theirs.
    _, counts = np.unique(track[(time >= low) & (time <= high)], return_counts=True)
    n_compared = max(int(np.sum(counts * _STEP >= earlier.every)), n_same)
    here, there = profiles.time + offset, earlier.time
    n_own = len(np.unique(profiles.track[(here >= there.min()) & (here <= there.max())]))
    n_earlier = len(np.unique(earlier.track[(there >= here.min()) & (there <= here.max())]))
    # If this recording has more tracks, only a part of them can be in the earlier one.
    size_ratio = max(1.0, n_own / max(n_earlier, 1))
    share = min(1.0, n_same / n_compared * size_ratio)
    return Copy(number, share, offset) if share >= _MIN_SHARE else None
