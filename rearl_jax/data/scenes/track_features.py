"""Feature curves of the tracks of a recording, speed v, position x and distance d, which clustering compares.

Recorded speeds are kept; the rescaled ones follow with `scale_speed` once all recordings have been read.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float32, Int, Int8, Shaped

from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.distances import feature_distance
from rearl_jax.data.scenes.scene_set import SceneSet, scale_speed
from rearl_jax.data.scenes.scene_windows import Cells, SceneKeys, Tracks, vehicles_of

FEATURES = ("speed", "position", "distance")
"""The feature vector of a track's point. Source: Bi et al., F(P_i(t)) = (v, x, d)."""


@dataclass(frozen=True)
class TrackSet:
    """Feature curves of the long tracks of one recording or several, in the order of the recordings.

    Axes: tracks, points (evenly spaced in time from the track's first to its last frame).

    Attributes:
        recording: Recording of the track.
        track_id: Vehicle, unique and rising in its recording.
        n_frames: Length of the track in frames of its recording.
        direction: Carriageway, 1 or 2.
        speed: Recorded speed [m/s].
        position: Centre along its driving direction [m].
        distance: Distance d of the feature vector [m].
        n_short: Tracks left out because they are shorter than `tracks.min_frames`.
        n_alone: Tracks left out because no other vehicle is recorded in any of their frames.
    """

    recording: Shaped[np.ndarray, " tracks"]
    track_id: Int[np.ndarray, " tracks"]
    n_frames: Int[np.ndarray, " tracks"]
    direction: Int8[np.ndarray, " tracks"]
    speed: Float32[np.ndarray, "tracks points"]
    position: Float32[np.ndarray, "tracks points"]
    distance: Float32[np.ndarray, "tracks points"]
    n_short: int
    n_alone: int

    def __len__(self) -> int:
        return len(self.track_id)

    def features(self, scenes: SceneSet) -> Float32[np.ndarray, "features points tracks"]:
        """Scaled speed [m/s], position [m] and distance [m] of every track, the tracks contiguous."""
        curves = np.empty((len(FEATURES), self.speed.shape[1], len(self)), dtype=np.float32)
        scaled = scale_speed(self.speed, scenes.speed_min, scenes.speed_max, scenes.speed_norm)
        for feature, values in enumerate((scaled, self.position, self.distance)):
            curves[feature] = values.T
        return curves


def track_features(recording: Recording, keys: SceneKeys) -> TrackSet:
    """Feature curves of all tracks with at least `tracks.min_frames` frames.

    d is computed at every frame from all vehicles recorded then (of the same carriageway with
    scenes.direction=per_direction). In frames in which a vehicle is alone, it has the value of its last earlier frame
    with other vehicles, else of the first later one. Curves are interpolated linearly in time.

    Source: Bi et al., features F(P_i(t)) = (v, x, d) and the filter L >= 100.
    """
    index, vehicles = Tracks(recording), vehicles_of(recording)
    cells = Cells(index, vehicles.direction, np.unique(index.frame), keys.scenes)
    rows, present = cells.rows(np.flatnonzero(cells.counts.reshape(-1)))
    by_place = feature_distance(vehicles, rows, present, rows.shape[1], keys.features.d, keys.spacing.metric)
    distance = np.empty(len(index.frame))
    distance[rows[present]] = by_place[present]
    if np.isnan(distance).any():
        by_track = pd.Series(distance).groupby(index.ordinal)
        distance = by_track.ffill().fillna(by_track.bfill()).to_numpy()

    is_long = index.lengths >= keys.tracks.min_frames
    is_alone = np.isnan(distance[index.starts])
    kept = np.flatnonzero(is_long & ~is_alone)
    first, last = index.key[index.starts[kept]], index.key[index.starts[kept] + index.lengths[kept] - 1]
    # Keys ascend over the whole table and every query is within its own track, so one interpolation serves all tracks.
    at = np.linspace(first, last, keys.tracks.points, axis=1)
    speed, position, distance = (
        np.interp(at, index.key, values).astype(np.float32) for values in (vehicles.speed, vehicles.position, distance)
    )
    return TrackSet(
        recording=np.full(len(kept), recording.info.id),
        track_id=index.track_id[index.starts[kept]],
        n_frames=index.lengths[kept],
        direction=vehicles.direction[index.starts[kept]],
        speed=speed,
        position=position,
        distance=distance,
        n_short=int(np.sum(~is_long)),
        n_alone=int(np.sum(is_long & is_alone)),
    )
