"""Tracks of all recordings, collected while scenes are cut from them, and the curves they are compared by."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import SceneKeys
from rearl_jax.data.scenes.track_features import FEATURES, TrackSet, track_features
from rearl_jax.problems import InvalidInputError, Problem


@dataclass
class TrackCollector:
    """Collects the feature curves of recordings that are read for another purpose; keeps no recording.

    `build_scenes(collector.passing(recordings), ...)` reads every recording once for scenes and tracks.
    """

    keys: SceneKeys
    parts: list[TrackSet] = field(default_factory=list)

    def passing(self, recordings: Iterable[Recording]) -> Iterator[Recording]:
        """The recordings, unchanged and one at a time."""
        for recording in recordings:
            self.parts.append(track_features(recording, self.keys))
            yield recording
            # Released before the next recording is read.
            del recording

    def collected(self) -> TrackSet:
        """All tracks so far; parts are freed while they are joined, so that memory contains them only once.

        Raises:
            ValueError: No track is long enough.
        """
        parts, self.parts = self.parts, []
        n_short, n_alone = (sum(getattr(part, name) for part in parts) for name in ("n_short", "n_alone"))
        if not any(map(len, parts)):
            least = self.keys.tracks.min_frames
            message = (
                f"no track can be clustered: {n_short} are shorter than tracks.min_frames = {least} frames and "
                f"{n_alone} are never in company"
            )
            remedy = "lower tracks.min_frames or read more recordings"
            raise InvalidInputError(Problem("tracks-too-few", message, remedy))
        names = ("recording", "track_id", "n_frames", "direction", *FEATURES)
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return TrackSet(**joined, n_short=n_short, n_alone=n_alone)


@dataclass(frozen=True)
class FeatureScale:
    """Affine map from features to the unitless curves that are compared.

    Attributes:
        low: Least value over the training tracks, by feature.
        high: Largest value.
        weight: Weight after scaling to 0 to 1.
    """

    low: Float32[np.ndarray, " features"]
    high: Float32[np.ndarray, " features"]
    weight: Float32[np.ndarray, " features"]

    @classmethod
    def of(
        cls, features: Float32[np.ndarray, "features points tracks"], weights: tuple[float, float, float]
    ) -> "FeatureScale":
        """The scale that maps these features to 0 to their weight; a feature that never varies becomes 0."""
        low, high = features.min(axis=(1, 2)), features.max(axis=(1, 2))
        return cls(low, high, np.asarray(weights, dtype=np.float32))

    def scaled(
        self, features: Float32[np.ndarray, "features points tracks"]
    ) -> Float32[np.ndarray, "features points tracks"]:
        """Features as unitless curves."""
        span = self.high - self.low
        factor = np.where(span > 0, self.weight / np.where(span > 0, span, 1), 0).astype(np.float32)
        return (features - self.low[:, None, None]) * factor[:, None, None]

    def physical(
        self, centres: Float[np.ndarray, "centres features vertices"]
    ) -> Float[np.ndarray, "centres features vertices"]:
        """Unitless centres in units of the features."""
        span = (self.high - self.low).astype(np.float64)
        return self.low[:, None] + centres * (span / self.weight)[:, None]


def picked_in(tracks: TrackSet, scenes: SceneSet, indices: Int[np.ndarray, " scenes"]) -> Bool[np.ndarray, " tracks"]:
    """Mask of tracks that are picked in any snapshot of some scenes."""
    index = track_index(tracks, scenes, indices)
    is_picked = np.zeros(len(tracks), dtype=bool)
    is_picked[index[index >= 0]] = True
    return is_picked


def track_index(
    tracks: TrackSet, scenes: SceneSet, indices: Int[np.ndarray, " scenes"]
) -> Int[np.ndarray, "scenes frames slots"]:
    """Index of the track in every slot of some scenes; -1 for tracks that were not collected."""
    result = np.full((len(indices), *scenes.track_id.shape[1:]), -1, dtype=np.int64)
    bounds = recording_bounds(tracks.recording)
    for number, scene in enumerate(indices):
        start, stop = bounds.get(str(scenes.recording[scene]), (0, 0))
        track_ids = tracks.track_id[start:stop]  # rising in a recording
        wanted = scenes.track_id[scene]
        nearest = np.minimum(np.searchsorted(track_ids, wanted), max(len(track_ids) - 1, 0))
        if len(track_ids):
            result[number] = np.where(track_ids[nearest] == wanted, start + nearest, -1)
    return result


def recording_bounds(recording: Shaped[np.ndarray, " tracks"]) -> dict[str, tuple[int, int]]:
    """Index of the first track of every recording, and of the track after its last."""
    starts = np.flatnonzero(np.concatenate([[True], recording[1:] != recording[:-1]]))
    stops = np.append(starts[1:], len(recording))
    return {str(recording[start]): (int(start), int(stop)) for start, stop in zip(starts, stops, strict=True)}
