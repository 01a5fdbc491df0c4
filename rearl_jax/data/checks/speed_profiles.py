"""Speed profiles of tracks: vehicles of two recordings with the same ones, at times a constant apart, are the same.

A profile is a few seconds of a track's speed, whatever its clock, origin, ids and frame rate. A recording is compared
by the profiles of a few of its tracks at all times with those of all tracks of earlier recordings, a few per track.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from rearl_jax.data.checks.typed_table import follows_row_before

_LENGTH = 6.0  # s, of a profile
_SPACING = 0.5  # s, between the speeds of a profile
_EVERY = 3.0  # s, between the profiles of a track that are kept; profiles in a common stretch of twice that are found
_STEP = 0.1  # s, between those that are compared with them
_MIN_CHANGE = 0.5  # m/s, of the speed within a profile; steady vehicles are all alike
_CLOSE = 0.06  # m/s, more than rounding to one decimal and another frame rate change
_N_COMPARED = 32  # tracks of a recording
_MAX_COMPARED = 30_000  # profiles of a recording
_MAX_KEPT = 200_000  # profiles of a recording
_NEIGHBOURS = 4  # similar profiles that are looked at
_MIN_SHARE = 0.8  # of the tracks that are in the common stretch of both recordings
_MIN_TRACKS = 2


@dataclass(frozen=True)
class Copy:
    """An earlier recording that has the vehicles of another one.

    Attributes:
        recording: Its number, in the order in which they were added.
        share: Share of the compared vehicles that are in both [-].
        offset: Its times less those of the other one [s].
    """

    recording: int
    share: float
    offset: float

    TOLERANCE: ClassVar[float] = 0.15
    """Deviation of the times of a vehicle from that offset [s]."""


class Profiles:
    """The speed profiles of one recording.

    Attributes:
        track: Number of the track of each kept profile, counted from 0.
        time: Its begin [s].
        speeds: Its speeds [m/s], one row each.
    """

    def __init__(self, table: pd.DataFrame) -> None:
        first = ~follows_row_before(table["track_id"].to_numpy())
        starts = np.flatnonzero(first)
        time, self._speed = table["time"].to_numpy(np.float64), table["speed"].to_numpy(np.float64)
        last = np.append(starts[1:], len(time)) - 1
        self._begin, self._end = time[starts], time[last]
        # One axis for all tracks, one after the other, so that one interpolation serves all.
        self._shift = np.concatenate([[0.0], np.cumsum(self._end - self._begin + 1.0)[:-1]]) - self._begin
        self._axis = time + np.repeat(self._shift, last - starts + 1)
        n_kept = np.sum(np.maximum(self._end - self._begin - _LENGTH, 0.0)) / _EVERY
        self.every = _EVERY * max(1.0, np.ceil(n_kept / _MAX_KEPT))
        self.track, self.time, self.speeds = self._at(np.arange(len(starts)), self.every)

    def compared(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Track, begin and speeds of the profiles of a few tracks at all times."""
        tracks = np.unique(self.track)
        chosen = tracks[np.unique(np.linspace(0, len(tracks) - 1, min(len(tracks), _N_COMPARED)).astype(int))]
        n_each = np.cumsum(np.maximum(self._end - self._begin - _LENGTH, 0.0)[chosen] / _STEP)
        return self._at(chosen[: max(_MIN_TRACKS, int(np.searchsorted(n_each, _MAX_COMPARED)))], _STEP)

    def _at(self, tracks: np.ndarray, every: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Track, begin and speeds of the profiles of the tracks in which the speed changes."""
        begin, span = self._begin[tracks], self._end[tracks] - self._begin[tracks] - _LENGTH
        number = np.where(span >= 0.0, np.floor(np.maximum(span, 0.0) / every + 1e-9) + 1, 0).astype(np.int64)
        which = np.repeat(np.arange(len(tracks)), number)
        within = np.arange(len(which)) - np.repeat(np.cumsum(number) - number, number)
        track, time = tracks[which], begin[which] + every * within
        places = np.arange(0.0, _LENGTH + 0.5 * _SPACING, _SPACING)
        speeds = np.interp((time + self._shift[track])[:, None] + places, self._axis, self._speed).astype(np.float32)
        changes = np.ptp(speeds, axis=1) >= _MIN_CHANGE
        return track[changes], time[changes], speeds[changes]


class SpeedProfiles:
    """The profiles of the recordings added so far."""

    def __init__(self) -> None:
        self._recordings: list[Profiles] = []
        # Trees of neighbouring recordings, from `first` on, the earlier the larger: a profile is sorted in log n times.
        self._trees: list[tuple[int, KDTree]] = []

    def add(self, profiles: Profiles) -> None:
        """Remembers the profiles of a recording."""
        self._recordings.append(profiles)
        if not len(profiles.track):
            return
        first, speeds = len(self._recordings) - 1, profiles.speeds
        while self._trees and self._trees[-1][1].n <= 2 * len(speeds):
            first, tree = self._trees.pop()
            speeds = np.concatenate([tree.data.astype(np.float32), speeds])
        self._trees.append((first, KDTree(speeds, balanced_tree=False, compact_nodes=False)))

    def copy_of(self, profiles: Profiles) -> Copy | None:
        """The earlier recording with most of the same vehicles; None if none has most of them."""
        if not self._trees or not len(profiles.track):
            return None
        track, time, speeds = profiles.compared()
        copies = []
        for number, own, other in self._matches(speeds):
            earlier = self._recordings[number]
            copies.append(_compared(profiles, earlier, (track, time), own, other, number))
        return max((copy for copy in copies if copy is not None), key=lambda copy: copy.share, default=None)

    def _matches(self, speeds: np.ndarray) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Recording, rows of `speeds`, and similar profiles of the recording by their place in it."""
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
    """The earlier recording as a copy, if most tracks of the smaller one are in the other at the usual offset."""
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
    # Tracks with a changing speed for so long that one of the kept profiles is among theirs.
    _, counts = np.unique(track[(time >= low) & (time <= high)], return_counts=True)
    n_compared = max(int(np.sum(counts * _STEP >= earlier.every)), n_same)
    here, there = profiles.time + offset, earlier.time
    n_own = len(np.unique(profiles.track[(here >= there.min()) & (here <= there.max())]))
    n_earlier = len(np.unique(earlier.track[(there >= here.min()) & (there <= here.max())]))
    whole = max(1.0, n_own / max(n_earlier, 1))  # times more tracks of this recording than of the earlier one
    share = min(1.0, n_same / n_compared * whole)
    return Copy(number, share, offset) if share >= _MIN_SHARE else None
