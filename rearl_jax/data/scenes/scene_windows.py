"""Windows of one recording, which become scenes, and the vehicles picked in them.

A window is a stretch of time, cut into snapshots, one per second. Windows may share snapshots (`scenes.stride`), so
quantities of a snapshot are computed once and assigned to windows at the end. A cell is a snapshot of the vehicles of
one group: those of both carriageways together, or of one of them.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from rearl_jax.config._schema import as_plain
from rearl_jax.config.scenes import (
    Direction,
    FeaturesConfig,
    Pick,
    ScenesConfig,
    SpacingConfig,
    SpeedConfig,
    TracksConfig,
)
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.distances import Vehicles, feature_distance, mean_distance
from rearl_jax.data.vehicle_rows import follows_row_before
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

LEFT, KEEP, RIGHT, FASTER, SLOWER = range(5)
"""Identifiers of the actions. Source: highway-env 1.12.1, DiscreteMetaAction.ACTIONS_ALL."""

SPEED_CHANGE = 0.5
"""Change of speed over one second above which a vehicle counts as faster or slower [m/s]."""

UNKNOWN_LANE = -1
"""Lane of a vehicle whose lane is not known; lanes count from 0."""

_READ_CHECKED = "read the recording with rearl_jax.data.recordings, which checks it"


@runtime_checkable
class SceneKeys(Protocol):
    """Groups of a task's configuration that decide its scenes."""

    scenes: ScenesConfig
    speed: SpeedConfig
    tracks: TracksConfig
    features: FeaturesConfig
    spacing: SpacingConfig


SCENE_GROUPS = ("scenes", "speed", "tracks", "features", "spacing")
"""Names of these groups."""


def cutting_keys(keys: SceneKeys) -> dict[str, dict[str, Any]]:
    """The keys that decide which scenes are cut, by group, as the user writes them; without `scenes.boundary`."""
    plain = {group: as_plain(getattr(keys, group)) for group in SCENE_GROUPS}
    del plain["scenes"]["boundary"]
    return plain


@dataclass(frozen=True)
class WindowCount:
    """Counts of the windows of one recording.

    Attributes:
        windows: Windows examined, one per carriageway if each makes its own scenes.
        accepted: Windows with enough vehicles in every snapshot.
        duration: Length of the recording [s].
        most_vehicles: Largest number of vehicles in any snapshot.
        best_window: Largest number of vehicles that any window has in all of its snapshots.
    """

    windows: int
    accepted: int
    duration: float
    most_vehicles: int
    best_window: int


class Tracks:
    """Rows of a canonical table by track; finds the row of a track at another frame.

    Attributes:
        track_id, frame: Columns of the table.
        starts: First row of each track.
        ordinal: Number of the track of each row, from 0.
        first_frame, last_frame: Of all tracks.
        span: Number of frames from the first to the last.
        key: ordinal * span + frame - first_frame of each row, which ascends over the whole table.
    """

    def __init__(self, recording: Recording):
        table = recording.table
        if len(table) == 0:
            message, remedy = "the table has no rows", "leave it out or check its source file"
            raise InvalidInputError(Problem("no-rows", message, remedy, file=f"recording {recording.info.id}"))
        self.track_id = table["track_id"].to_numpy(np.int64)
        self.frame = table["frame"].to_numpy(np.int64)
        begins = ~follows_row_before(self.track_id)
        self.starts, self.ordinal = np.flatnonzero(begins), np.cumsum(begins) - 1
        self.first_frame, self.last_frame = int(self.frame.min()), int(self.frame.max())
        self.span = self.last_frame - self.first_frame + 1
        self.key = self.ordinal * self.span + (self.frame - self.first_frame)
        unsorted = (np.diff(self.track_id) < 0) | (np.diff(self.key) <= 0)
        if unsorted.any():
            row = int(np.flatnonzero(unsorted)[0]) + 1
            message = (
                "the table is not sorted by track_id and frame, or holds a frame twice "
                f"(track {self.track_id[row]}, frame {self.frame[row]})"
            )
            file = f"recording {recording.info.id}"
            raise InvalidInputError(Problem("unsorted", message, _READ_CHECKED, file=file, row=int(row) + 1))

    @property
    def lengths(self) -> np.ndarray:
        """Number of frames of every track."""
        return np.diff(self.starts, append=len(self.frame))

    def seniority(self, rows: np.ndarray, pick: Pick) -> np.ndarray:
        """Recorded time of each vehicle: frames since its track began, or length of the whole track [frames]."""
        if pick is Pick.total_duration:
            return self.lengths[self.ordinal[rows]]
        return self.frame[rows] - self.frame[self.starts][self.ordinal[rows]]

    def later(self, rows: np.ndarray, n_frames: int) -> tuple[np.ndarray, np.ndarray]:
        """Row of the same track `n_frames` frames later, and whether there is one; if not, the row itself."""
        target = self.frame[rows] + n_frames
        wanted = self.key[rows] + n_frames
        found = np.minimum(np.searchsorted(self.key, wanted), len(self.key) - 1)
        present = (target <= self.last_frame) & (self.key[found] == wanted)
        return np.where(present, found, rows), present


def frame_offsets(seconds: np.ndarray, frame_rate: float) -> np.ndarray:
    """Frames that lie nearest to the given times after a first frame."""
    return np.rint(seconds * frame_rate).astype(np.int64)


def windows_of(recording: Recording, keys: SceneKeys) -> tuple[dict[str, np.ndarray], WindowCount]:
    """Arrays of the accepted windows of a recording, and counts.

    Window w starts w * stride after the recording's first frame, whether or not the windows before it were accepted; it
    is accepted if every snapshot holds `scenes.min_vehicles` vehicles, short tracks included.

    Returns:
        Arrays by field name of `SceneSet`, of shape (windows,) or (windows, frames, slots).

    Source: Bi et al., Eq. 1 and the paragraph on preprocessing; the paper leaves open the grid, the pooling and the
    meaning of "longest recorded", see `ScenesConfig`.
    """
    scenes = keys.scenes
    index = Tracks(recording)
    vehicles = vehicles_of(recording)
    rate = recording.info.frame_rate
    # A window must be recorded to its end, not only to its last snapshot.
    starts = index.first_frame + _window_offsets(recording, index.span, scenes)
    frames = starts[:, None] + frame_offsets(np.arange(scenes.seconds), rate)[None, :]
    snapshots, snapshot_of = np.unique(frames, return_inverse=True)
    snapshot_of = snapshot_of.reshape(frames.shape)

    cells = Cells(index, vehicles.direction, snapshots, scenes)
    least = cells.counts[snapshot_of].min(axis=1)
    window, group = np.nonzero(least >= scenes.min_vehicles)
    count = WindowCount(
        windows=least.size,
        accepted=len(window),
        duration=index.span / rate,
        most_vehicles=int(cells.counts.max(initial=0)),
        best_window=int(least.max(initial=0)),
    )
    if not len(window):
        return {}, count
    # Distances are computed for cells of accepted windows only.
    used, cell_of = np.unique(snapshot_of[window] * cells.n_groups + group[:, None], return_inverse=True)
    cell_of = cell_of.reshape(len(window), scenes.seconds)
    by_cell = _slots(index, vehicles, *cells.rows(used), rate, keys)
    by_cell["is_long_track"] = index.lengths[index.ordinal[by_cell.pop("row")]] >= keys.tracks.min_frames
    arrays = {name: values[cell_of] for name, values in by_cell.items()}
    bad = ~np.isfinite(arrays["speed"] + arrays["x"] + arrays["y"] + arrays["position"] + arrays["length"])
    if bad.any():
        scene, frame, slot = np.argwhere(bad)[0]
        message = (
            f"speed, x, y, position or length of track {arrays['track_id'][scene, frame, slot]} is not a number in the "
            f"window from frame {starts[window[scene]]} on"
        )
        raise InvalidInputError(Problem("not-finite", message, _READ_CHECKED, file=f"recording {recording.info.id}"))
    arrays |= {
        "recording": np.full(len(window), recording.info.id),
        "window": window.astype(np.int64),
        "start_frame": starts[window],
        # Nominal, not frame / rate, so that adjacent windows stay adjacent if a frame rate is not a whole number.
        "start_time": window * scenes.stride_seconds,
        "frame_rate": np.full(len(window), float(rate)),
    }
    return arrays, count


def vehicles_of(recording: Recording) -> Vehicles:
    """Columns of a canonical table as arrays, an unknown lane as `UNKNOWN_LANE`."""
    table = recording.table
    measures = {
        name: table[name].to_numpy(np.float64, na_value=np.nan) for name in ("x", "y", "position", "length", "speed")
    }
    return Vehicles(
        direction=table["direction"].to_numpy(np.int8),
        lane=table["lane"].to_numpy(np.int8, na_value=UNKNOWN_LANE),
        **measures,
    )


def actions(lane: np.ndarray, next_lane: np.ndarray, speed: np.ndarray, next_speed: np.ndarray) -> np.ndarray:
    """Action of a vehicle within one second: LEFT, RIGHT, else FASTER, SLOWER, else KEEP.

    A lane change has priority over a change of speed. Lanes count from the left; an unknown lane is no change. For a
    vehicle that is not recorded one second later, the caller passes its present lane and speed, which gives KEEP.
    """
    known = (lane != UNKNOWN_LANE) & (next_lane != UNKNOWN_LANE)
    change = next_speed - speed
    return np.select(
        [
            known & (next_lane < lane),
            known & (next_lane > lane),
            change > SPEED_CHANGE,
            change < -SPEED_CHANGE,
        ],
        [LEFT, RIGHT, FASTER, SLOWER],
        KEEP,
    ).astype(np.int8)


class Cells:
    """Vehicles of every snapshot and group, the longest recorded first, ties by track id.

    Attributes:
        n_groups: Groups per snapshot.
        counts: Number of vehicles, `[snapshots, groups]`.
    """

    def __init__(self, index: Tracks, direction: np.ndarray, snapshots: np.ndarray, scenes: ScenesConfig):
        snapshot_at = np.full(index.span, -1, dtype=np.int64)
        snapshot_at[snapshots - index.first_frame] = np.arange(len(snapshots))
        snapshot = snapshot_at[index.frame - index.first_frame]
        rows = np.flatnonzero(snapshot >= 0)
        group = np.zeros(len(rows), dtype=np.int64)
        self.n_groups = 1
        if scenes.direction is Direction.per_direction:
            present, ordinal = np.unique(direction, return_inverse=True)
            group, self.n_groups = ordinal[rows], len(present)
        cell = snapshot[rows] * self.n_groups + group
        order = np.lexsort((index.track_id[rows], -index.seniority(rows, scenes.pick), cell))
        self._rows = rows[order]
        counts = np.bincount(cell, minlength=len(snapshots) * self.n_groups)
        self._starts = np.cumsum(counts) - counts
        self.counts = counts.reshape(len(snapshots), self.n_groups)

    def rows(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Table rows of the vehicles of some cells, padded to the largest number of vehicles, and a mask of the
        entries that are vehicles.
        """
        counts = self.counts.reshape(-1)[cells]
        place = np.arange(counts.max(initial=0))
        present = place[None, :] < counts[:, None]
        index = np.where(present, self._starts[cells][:, None] + place[None, :], 0)
        return self._rows[index], present


def _window_offsets(recording: Recording, span: int, scenes: ScenesConfig) -> np.ndarray:
    """First frames, counted from the recording's first, of the full windows that fit into `span`."""
    rate, stride = recording.info.frame_rate, scenes.stride_seconds
    if stride * rate < 1:
        message = f"must be at least a frame of recording {recording.info.id}, {1 / rate:g} s"
        raise out_of_range("scenes.stride", message, stride)
    offsets = frame_offsets(np.arange(int(span / rate / stride) + 1) * stride, rate)
    return offsets[offsets + round(scenes.seconds * rate) <= span]


def _slots(
    index: Tracks, vehicles: Vehicles, rows: np.ndarray, present: np.ndarray, rate: float, keys: SceneKeys
) -> dict[str, np.ndarray]:
    """Quantities of the picked vehicles, the first `slots` columns of `rows`; arrays (cells, slots).

    `rows` and `present` are those of `Cells.rows`, `rate` is the frame rate [1/s].
    """
    n_slots, metric = keys.scenes.slots, keys.spacing.metric
    picked = rows[:, :n_slots]
    x, y = vehicles.x[picked], vehicles.y[picked]
    all_present = np.ones(picked.shape, dtype=bool)
    later, has_next = index.later(picked, round(rate))
    lane, next_lane = vehicles.lane[picked], vehicles.lane[later]
    speed = vehicles.speed[picked]
    return {
        "row": picked,
        "track_id": index.track_id[picked],
        "x": x,
        "y": y,
        "position": vehicles.position[picked],
        "lane": lane,
        "direction": vehicles.direction[picked],
        "length": vehicles.length[picked],
        "speed": speed,
        "action": actions(lane, next_lane, speed, vehicles.speed[later]),
        "next_lane": np.where(has_next, next_lane, UNKNOWN_LANE).astype(np.int8),
        "has_next": has_next,
        "spacing": mean_distance(x, y, all_present, n_slots, metric),
        "feature_distance": feature_distance(vehicles, rows, present, n_slots, keys.features.d, metric),
    }
