"""Scenes of equal shape: one record for all of them, the rescaling of speeds, lane-change rates.

The scaled speed is not stored, but derived from the recorded speed and two stored extremes.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, Int8, Shaped

from rearl_jax.config.scenes import Direction, SpeedNorm
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE
from rearl_jax.problems import InvalidInputError, Problem

SPEED_RANGE = (5.0, 32.0)
"""Range of the scaled speed [m/s] = target speeds the simulated vehicles can have. Source: Bi et al.; DiLu's
run_dilu.py, target_speeds = linspace(5, 32, 9)."""

Slots = "scenes frames slots"


@dataclass(frozen=True)
class SceneCounts:
    """Counts of the recordings read and of windows examined; a rejected one has a snapshot with too few vehicles."""

    recordings: int
    recordings_without_scenes: int
    windows: int
    rejected: int
    accepted: int


@dataclass(frozen=True)
class SceneSet:
    """Scenes of equal shape and where they come from.

    Axes: scenes, frames (1 Hz snapshots), slots (vehicles picked for the scene, the longest recorded first). The
    vehicle of a slot changes when vehicles leave; `track_id` identifies it.

    Attributes:
        scene_id: Number of the scene, from 0, in the order of recordings, windows and carriageways.
        recording: Recording of the scene.
        window: Number of the window in its recording, from 0, rejected windows counted.
        start_frame: First frame, as the recording counts frames.
        start_time: Start since the first frame of the recording [s].
        frame_rate: Frames per second of the recording [1/s].
        track_id: Vehicle, unique in its recording.
        x: Centre in the common ground frame, along the road [m].
        y: Centre in the common ground frame, across the road [m].
        position: Centre along its driving direction, from the upstream edge [m].
        lane: Lane, 0 = leftmost in driving direction, -1 = unknown.
        direction: Carriageway, 1 or 2.
        length: Vehicle length [m].
        speed: Recorded speed along the driving direction [m/s].
        action: Action of the vehicle in the next second: 0 left, 1 keep, 2 right, 3 faster, 4 slower.
        has_next: The vehicle is still recorded one second later.
        next_lane: Lane one second later; -1 = unknown or no longer recorded.
        spacing: Mean distance to the other picked vehicles [m].
        feature_distance: Distance d of the feature vector, over all vehicles present [m].
        is_long_track: The vehicle's track has at least `tracks.min_frames` frames.
        speed_min: Recorded speed that becomes 5 m/s [m/s].
        speed_max: Recorded speed that becomes 32 m/s [m/s].
        speed_norm: Rescaling of speeds.
        infos: Metadata of the recordings of the scenes.
        counts: Counts of the recordings and windows read.
        settings: Keys that the scenes were cut with, as the user writes them.
    """

    scene_id: Int[np.ndarray, " scenes"]
    recording: Shaped[np.ndarray, " scenes"]
    window: Int[np.ndarray, " scenes"]
    start_frame: Int[np.ndarray, " scenes"]
    start_time: Float[np.ndarray, " scenes"]
    frame_rate: Float[np.ndarray, " scenes"]
    track_id: Int[np.ndarray, Slots]
    x: Float[np.ndarray, Slots]
    y: Float[np.ndarray, Slots]
    position: Float[np.ndarray, Slots]
    lane: Int8[np.ndarray, Slots]
    direction: Int8[np.ndarray, Slots]
    length: Float[np.ndarray, Slots]
    speed: Float[np.ndarray, Slots]
    action: Int8[np.ndarray, Slots]
    has_next: Bool[np.ndarray, Slots]
    next_lane: Int8[np.ndarray, Slots]
    spacing: Float[np.ndarray, Slots]
    feature_distance: Float[np.ndarray, Slots]
    is_long_track: Bool[np.ndarray, Slots]
    speed_min: float
    speed_max: float
    speed_norm: SpeedNorm
    infos: tuple[RecordingInfo, ...]
    counts: SceneCounts
    settings: Mapping[str, str | int | float | None]

    def __len__(self) -> int:
        return len(self.scene_id)

    @property
    def seconds(self) -> int:
        """Length of a scene [s], which is its number of snapshots."""
        return self.speed.shape[1]

    @property
    def n_slots(self) -> int:
        """Number of picked vehicles."""
        return self.speed.shape[2]

    @property
    def generated(self) -> bool:
        """True if any recording was made by the generator, not measured."""
        return any(info.generated for info in self.infos)

    @property
    def is_one_way(self) -> bool:
        """True if each scene holds one carriageway only."""
        return self.settings.get("scenes.direction") == Direction.per_direction.name

    @cached_property
    def scaled_speed(self) -> Float[np.ndarray, Slots]:
        """Speed in the simulator's range of 5 to 32 m/s; see `scale_speed`."""
        return scale_speed(self.speed, self.speed_min, self.speed_max, self.speed_norm)

    @cached_property
    def mean_spacing(self) -> Float[np.ndarray, "scenes frames"]:
        """Mean distance over all pairs of picked vehicles [m].

        Every pair counts in the means of both its vehicles, so the mean over vehicles is the mean over pairs.
        """
        return self.spacing.mean(axis=2)

    @cached_property
    def data_id(self) -> str:
        """Sixteen hexadecimal digits that are equal if the settings and all values are equal."""
        digest = hashlib.sha256(json.dumps(dict(self.settings), sort_keys=True).encode())
        for name in ARRAYS:
            values = getattr(self, name)
            content = "\n".join(values).encode() if values.dtype.kind == "U" else values.tobytes()
            digest.update(name.encode() + content)
        return digest.hexdigest()[:16]

    def select(self, indices: np.ndarray) -> "SceneSet":
        """The scenes with the given indices, in that order, under their old ids and speed extremes."""
        return replace(self, **{name: getattr(self, name)[indices] for name in ARRAYS})


ARRAYS = tuple(
    item.name
    for item in fields(SceneSet)
    if item.name not in ("speed_min", "speed_max", "speed_norm", "infos", "counts", "settings")
)
"""Names of the fields of a `SceneSet` that have a scene axis."""


def speed_extremes(speed: np.ndarray, norm: SpeedNorm) -> tuple[float, float]:
    """Recorded speeds that become the ends of the range [m/s]; without rescaling the observed extremes.

    Source: Bi et al., min-max normalisation; they do not state over what. Here it is over all picked vehicles
    of all scenes: extremes per scene would erase the differences between scenes.
    """
    if norm is SpeedNorm.minmax_p01_999:
        low, high = (float(value) for value in np.percentile(speed, [0.1, 99.9]))
    else:
        low, high = float(speed.min()), float(speed.max())
    if norm in (SpeedNorm.minmax, SpeedNorm.minmax_p01_999) and not low < high:
        message = (
            f"cannot spread speeds over {SPEED_RANGE[0]:g} to {SPEED_RANGE[1]:g} m/s that are all {low:g} m/s: set "
            "speed.norm=clip or speed.norm=none"
        )
        raise InvalidInputError(Problem("speeds-all-equal", message, key="speed.norm"))
    return low, high


def scale_speed(speed: np.ndarray, speed_min: float, speed_max: float, norm: SpeedNorm) -> np.ndarray:
    """Speed in the simulator's range [m/s].

    v' = 5 + (32 - 5) (v - v_min) / (v_max - v_min), clipped to [5, 32], with recorded speeds v [m/s]; `clip` clips v
    itself, `none` returns v.

    Source: Bi et al.
    """
    low, high = SPEED_RANGE
    if norm is SpeedNorm.none:
        return speed
    if norm is SpeedNorm.clip:
        return np.clip(speed, low, high)
    share = np.clip((speed - speed_min) / (speed_max - speed_min), 0.0, 1.0)
    # A weighted sum instead of low + share * range, because it gives both ends exactly.
    return (1.0 - share) * low + share * high


def recorded_lane_change_rate(scenes: SceneSet) -> Float[np.ndarray, " scenes"]:
    """Lane changes per vehicle-second of every scene, in the recorded traffic.

    Number of (snapshot, slot) whose vehicle is in another lane one second later, over all snapshots x slots.
    A vehicle that has left the recording by then counts as unchanged (`has_next` marks the others).

    Raises:
        ValueError: A vehicle's lane is unknown.

    Source: Bi et al., lane-change rate, with 60 x 10 in the denominator.
    """
    unknown = np.argwhere(scenes.lane == UNKNOWN_LANE)
    if len(unknown):
        message = "a vehicle has no lane: lane changes and time headways cannot be measured"
        file = f"recording {scenes.recording[unknown[0, 0]]}"
        raise InvalidInputError(Problem("lane-missing", message, "choose data with lanes", file=file))
    changed = scenes.has_next & (scenes.next_lane != UNKNOWN_LANE) & (scenes.next_lane != scenes.lane)
    return changed.mean(axis=(1, 2))
