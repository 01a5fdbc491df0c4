"""Recorded traffic around the vehicles of scenes: vehicles that enter the simulation, and vehicles that are replayed.

The simulated vehicles of a second are those that the scene picks in the snapshot at its beginning. Each keeps its place
(index) in the arrays. When it is no longer picked, because it has left the recording, another picked vehicle gets its
place and enters at its recorded position. All other vehicles are replayed, or only those ahead of the foremost
simulated vehicle of each lane.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Float32, Int, Int16

from rearl_jax.config.scenes import BoundarySource
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE, frame_offsets
from rearl_jax.data.vehicle_rows import ABSENT, VehicleRows
from rearl_jax.problems import InvalidInputError, Problem

NO_VEHICLE = -1
"""Track of a place without a replayed vehicle."""


@dataclass(frozen=True)
class SceneBoundary:
    """Simulated and replayed vehicles of some scenes, second by second.

    Positions count from the most upstream position of a simulated vehicle of the scene; lanes of both carriageways lie
    side by side.

    Attributes:
        track_id: Recorded vehicle that each simulated vehicle represents.
        is_new: True if the vehicle enters at the beginning of this second; false in the first second.
        x: Recorded position at the beginning of the second [m].
        speed: Recorded speed at the beginning of the second [m/s].
        lane: Recorded lane at the beginning of the second.
        highest_speed: Highest recorded speed in the snapshots of the scene in which the vehicle is simulated [m/s].
        replayed_id: Track of each replayed vehicle; NO_VEHICLE for a place without one.
        replayed_number: Number of the vehicle in its scene; simulated vehicles have the smaller numbers.
        replayed_length: Length [m].
        replayed_is_truck: Whether the vehicle is a truck.
        replayed_x: Position at the beginning of each time step [m].
        replayed_speed: Speed at the beginning of each time step [m/s].
        replayed_acceleration: Acceleration at the beginning of each time step [m/s^2]; 0 where it was not recorded.
        replayed_lane: Lane at the beginning of each time step; NOT_RECORDED while the vehicle is not recorded.
    """

    track_id: Int[np.ndarray, "scenes seconds vehicles"]
    is_new: Bool[np.ndarray, "scenes seconds vehicles"]
    x: Float[np.ndarray, "scenes seconds vehicles"]
    speed: Float[np.ndarray, "scenes seconds vehicles"]
    lane: Int[np.ndarray, "scenes seconds vehicles"]
    highest_speed: Float[np.ndarray, "scenes seconds vehicles"]
    replayed_id: Int[np.ndarray, "scenes seconds replayed"]
    replayed_number: Int[np.ndarray, "scenes seconds replayed"]
    replayed_length: Float32[np.ndarray, "scenes seconds replayed"]
    replayed_is_truck: Bool[np.ndarray, "scenes seconds replayed"]
    replayed_x: Float32[np.ndarray, "scenes seconds steps replayed"]
    replayed_speed: Float32[np.ndarray, "scenes seconds steps replayed"]
    replayed_acceleration: Float32[np.ndarray, "scenes seconds steps replayed"]
    replayed_lane: Int16[np.ndarray, "scenes seconds steps replayed"]

    def select(self, scenes: np.ndarray) -> "SceneBoundary":
        """The scenes with these indices, in this order."""
        return SceneBoundary(**{name: values[scenes] for name, values in vars(self).items()})

    @property
    def n_lanes(self) -> int:
        """Lanes that some vehicle is on."""
        return int(max(self.lane.max(), self.replayed_lane.max(initial=0))) + 1


@dataclass(frozen=True)
class BoundaryOptions:
    """Choice of the replayed vehicles.

    Attributes:
        source: All vehicles that are not simulated, or those ahead of the foremost simulated one of each lane.
        steps_per_second: Time steps of the simulation per second [1/s].
        is_one_way: Whether a scene holds one carriageway only.
        keeps_first: Whether no other vehicle gets the place of the first vehicle after that has left the recording.
    """

    source: BoundarySource
    steps_per_second: int
    is_one_way: bool
    keeps_first: bool = False


def cut_boundary(
    recordings: Iterable[Recording], scenes: SceneSet, subset: np.ndarray, options: BoundaryOptions
) -> SceneBoundary:
    """The recorded traffic around the vehicles of a subset of the scenes, which holds their indices.

    Between two recorded frames positions, speeds and accelerations change linearly; a lane is that of the earlier one.
    The recordings are read once, one at a time.

    Raises:
        InvalidInputError: The lane of a vehicle is unknown, or a recording is missing.
    """
    chosen = scenes.select(subset)
    simulated = _simulated(chosen)
    if options.keeps_first:
        simulated = _keeping_first(simulated)
    replayed: dict[int, dict[str, np.ndarray]] = {}
    for recording in recordings:
        of_recording = np.flatnonzero(chosen.recording == recording.info.id)
        if len(of_recording):
            rows = VehicleRows(recording.table)
            _require_same(recording, rows, chosen.select(of_recording))
            for scene in of_recording:
                replayed[int(scene)] = _replayed(recording, rows, chosen, simulated, int(scene), options)
    missing = sorted(set(range(len(chosen))) - set(replayed))
    if missing:
        message = "holds the vehicles around a scene, but is not among the recordings"
        raise InvalidInputError(Problem("recording-missing", message, file=f"recording {chosen.recording[missing[0]]}"))
    return SceneBoundary(**simulated, **_joined([replayed[scene] for scene in range(len(chosen))]))


def _require_same(recording: Recording, rows: VehicleRows, scenes: SceneSet) -> None:
    """Raise InvalidInputError if scenes were cut from another recording of the same name."""
    track, frame = scenes.track_id[:, 0], scenes.start_frame[:, None]
    row = rows.rows(track.ravel(), np.broadcast_to(frame, track.shape).ravel())
    position = recording.table["position"].to_numpy(np.float64)[row]
    if (row == ABSENT).any() or not np.allclose(position, scenes.position[:, 0].ravel(), atol=0.01):
        message = "is not the recording that the scenes were cut from"
        raise InvalidInputError(Problem("recording-missing", message, file=f"recording {recording.info.id}"))


def lanes_side_by_side(scenes: SceneSet, lane: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Lane numbers on a road with both carriageways side by side: those of carriageway 2 follow those of carriageway 1.

    In scenes of one carriageway each they are unchanged. The scenes are the first axis of the lanes and carriageways.
    """
    if scenes.is_one_way:
        return lane
    counts = {info.id: info.lane_count for info in scenes.infos}
    first = np.array([counts[name].get(1, 0) for name in scenes.recording.tolist()])
    return lane + np.where(direction == 2, first.reshape(-1, *(1,) * (lane.ndim - 1)), 0)


def _simulated(scenes: SceneSet) -> dict[str, np.ndarray]:
    """Fields of `SceneBoundary` about simulated vehicles."""
    if (scenes.lane == UNKNOWN_LANE).any():
        raise _lane_missing()
    place = np.stack([_places(track) for track in scenes.track_id])
    lane = lanes_side_by_side(scenes, scenes.lane.astype(np.int64), scenes.direction)
    by_slot = {"track_id": scenes.track_id, "x": scenes.position, "speed": scenes.speed, "lane": lane}
    found = {name: np.take_along_axis(values, place, axis=2) for name, values in by_slot.items()}
    found["x"] = found["x"] - found["x"].min(axis=(1, 2), keepdims=True)
    track = found["track_id"]
    found["is_new"] = np.concatenate([np.zeros_like(track[:, :1], bool), track[:, 1:] != track[:, :-1]], axis=1)
    occupant = np.cumsum(found["is_new"], axis=1)  # number of the vehicle among those that have the same place in turn
    highest = np.zeros_like(found["speed"])
    for number in range(int(occupant.max()) + 1):
        is_occupant = occupant == number
        top = np.where(is_occupant, found["speed"], -np.inf).max(axis=1, keepdims=True)
        highest = np.where(is_occupant, top, highest)
    return found | {"highest_speed": highest}


def _keeping_first(simulated: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The fields of `_simulated`, in which no other vehicle takes the place of the first one after it has left."""
    track, lane, is_new = simulated["track_id"].copy(), simulated["lane"].copy(), simulated["is_new"]
    first = track[:, :1, :1].copy()
    has_left = np.logical_or.accumulate(track[:, :, :1] != first, axis=1)
    lane[:, :, :1] = np.where(has_left, NOT_RECORDED, lane[:, :, :1])
    track[:, :, :1] = first
    return simulated | {"track_id": track, "lane": lane, "is_new": is_new & (track != first)}


def _places(track_id: Int[np.ndarray, "frames slots"]) -> Int[np.ndarray, "frames places"]:
    """Slot in the scene of the vehicle in each place: vehicles keep their places, new ones fill those that are free."""
    slots = np.empty(track_id.shape, np.int64)
    slots[0] = np.arange(track_id.shape[1])
    for frame in range(1, len(track_id)):
        before, now = track_id[frame - 1][slots[frame - 1]], track_id[frame]
        stays = np.isin(before, now)
        newcomers = np.flatnonzero(~np.isin(now, before))
        slots[frame, stays] = [int(np.flatnonzero(now == track)[0]) for track in before[stays]]
        slots[frame, ~stays] = newcomers
    return slots


def _replayed(
    recording: Recording,
    rows: VehicleRows,
    scenes: SceneSet,
    simulated: dict[str, np.ndarray],
    scene: int,
    options: BoundaryOptions,
) -> dict[str, np.ndarray]:
    """Fields of `SceneBoundary` about replayed vehicles of one scene, without its axis."""
    table, n_seconds = recording.table, scenes.seconds
    offsets = frame_offsets(np.arange(n_seconds + 1), recording.info.frame_rate)
    frame, first = table["frame"].to_numpy(np.int64), int(scenes.start_frame[scene])
    is_near = (frame >= first) & (frame < first + offsets[-1])
    if options.is_one_way:
        is_near &= table["direction"].to_numpy() == scenes.direction[scene, 0, 0]
    tracks, first_row = np.unique(table["track_id"].to_numpy(np.int64)[is_near], return_index=True)
    row = np.flatnonzero(is_near)[first_row]

    share = np.arange(options.steps_per_second) / options.steps_per_second
    time = (offsets[:-1, None] + share * np.diff(offsets)[:, None]).reshape(-1)  # in frames
    before = np.floor(time + 1e-9).astype(np.int64)
    weight = np.where(time - before < 1e-9, 0.0, time - before)
    earlier = rows.rows(np.repeat(tracks, len(time)), np.tile(first + before, len(tracks)))
    later = rows.rows(np.repeat(tracks, len(time)), np.tile(first + before + (weight > 0), len(tracks)))
    shape = (len(tracks), n_seconds, options.steps_per_second)
    is_recorded = ((earlier != ABSENT) & (later != ABSENT)).reshape(shape)

    def between(name: str) -> np.ndarray:
        values = table[name].to_numpy(np.float64)
        mixed = values[earlier] + np.tile(weight, len(tracks)) * (values[later] - values[earlier])
        return np.where(is_recorded, np.nan_to_num(mixed).reshape(shape), 0.0)

    lane = table["lane"].to_numpy(np.int64, na_value=UNKNOWN_LANE)[earlier].reshape(shape)
    if (is_recorded & (lane == UNKNOWN_LANE)).any():
        raise _lane_missing()
    direction = table["direction"].to_numpy(np.int64)[row]
    if (direction == 2).any() and not options.is_one_way:
        lane = lane + np.where(direction == 2, recording.info.lane_count.get(1, 0), 0)[:, None, None]
    lane = np.where(is_recorded, lane, NOT_RECORDED)
    origin = scenes.position[scene, 0, 0] - simulated["x"][scene, 0, 0]
    moving = {"x": between("position") - origin, "speed": between("speed"), "acceleration": between("acceleration")}
    of_scene = {name: values[scene] for name, values in simulated.items()}
    is_simulated = (tracks[:, None, None] == of_scene["track_id"]).any(axis=2)  # [tracks, seconds]
    if options.source is BoundarySource.measured:
        picked = _all_around(is_recorded.any(axis=2) & ~is_simulated)
    else:
        picked = _in_front(moving["x"][:, :, 0], np.where(is_simulated, NOT_RECORDED, lane[:, :, 0]), of_scene)
    return _placed(picked, tracks, moving | {"lane": lane}, table.iloc[row], of_scene["x"].shape[1])


def _all_around(is_around: Bool[np.ndarray, "tracks seconds"]) -> Int[np.ndarray, "seconds places"]:
    """Indices of the tracks around the scene in each second, NO_VEHICLE in unused places."""
    picked = np.full((is_around.shape[1], max(int(is_around.sum(axis=0).max(initial=0)), 1)), NO_VEHICLE)
    for second, there in enumerate(is_around.T):
        (index,) = np.nonzero(there)
        picked[second, : len(index)] = index
    return picked


def _in_front(
    x: Float[np.ndarray, "tracks seconds"], lane: Int[np.ndarray, "tracks seconds"], simulated: dict[str, np.ndarray]
) -> Int[np.ndarray, "seconds places"]:
    """Index of the nearest track ahead of the foremost simulated vehicle on each of its lanes, lane by lane.

    x [m] and lane are those at the beginning of each second; the lane of simulated tracks is NOT_RECORDED.
    """
    n_lanes = int(max(simulated["lane"].max(), lane.max(initial=0))) + 1
    picked = np.full((x.shape[1], n_lanes), NO_VEHICLE)
    for number in range(n_lanes):
        foremost = np.where(simulated["lane"] == number, simulated["x"], -np.inf).max(axis=1)
        ahead = np.where((lane == number) & np.isfinite(foremost) & (x >= foremost), x, np.inf)
        if len(ahead):
            nearest = ahead.argmin(axis=0)
            picked[:, number] = np.where(np.isfinite(ahead.min(axis=0)), nearest, NO_VEHICLE)
    return picked


def _placed(
    picked: Int[np.ndarray, "seconds places"],
    tracks: Int[np.ndarray, " tracks"],
    moving: dict[str, np.ndarray],
    vehicles: pd.DataFrame,
    n_simulated: int,
) -> dict[str, np.ndarray]:
    """Fields of `SceneBoundary` about replayed vehicles: tracks at their places.

    `picked` holds the index of the track in each second and place, `moving` the motion of each track,
    `[tracks, seconds, steps]`, and `vehicles` a row of each.
    """
    index, is_filled = np.maximum(picked, 0), picked != NO_VEHICLE
    seconds = np.arange(len(picked))[:, None]
    found = {"replayed_id": np.where(is_filled, tracks[index], NO_VEHICLE), "replayed_number": n_simulated + index}
    found["replayed_length"] = vehicles["length"].to_numpy(np.float32)[index]
    found["replayed_is_truck"] = (vehicles["vehicle_class"] == "truck").to_numpy(bool)[index]
    for name, values in moving.items():
        kind = np.int16 if name == "lane" else np.float32
        found[f"replayed_{name}"] = np.swapaxes(values[index, seconds], 1, 2).astype(kind)
    found["replayed_lane"] = np.where(is_filled[:, None], found["replayed_lane"], np.int16(NOT_RECORDED))
    return found


def _joined(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The scenes in common arrays, with as many places as the scene with the most replayed vehicles needs."""
    n_places = max(part["replayed_id"].shape[-1] for part in parts)
    empty = {"replayed_id": NO_VEHICLE, "replayed_lane": NOT_RECORDED}

    def padded(name: str, values: np.ndarray) -> np.ndarray:
        missing = [(0, 0)] * (values.ndim - 1) + [(0, n_places - values.shape[-1])]
        return np.pad(values, missing, constant_values=empty.get(name, 0))

    return {name: np.stack([padded(name, part[name]) for part in parts]) for name in parts[0]}


def _lane_missing() -> InvalidInputError:
    message = "needs the lane of every vehicle; these recordings lack some"
    return InvalidInputError(Problem("lane-missing", message, key="scenes.boundary"))
