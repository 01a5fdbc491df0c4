"""Trajectories as compact JSON inside the page: differences of successive positions in whole centimetres."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from rearl_jax.core.model import traffic_model
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.data.scenes.boundary import NO_VEHICLE, SceneBoundary
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE
from rearl_jax.replay.scenes import Replay, ReplayedScene

MAX_CHARACTERS = 600_000
"""Largest length of the data in a page [characters]; scenes beyond it are left out."""

_CM = 100.0
"""Centimetres per metre."""

_UNSAFE = {ord(char): f"\\u{ord(char):04x}" for char in "<>&'\u2028\u2029"}
"""Characters that could end a script element or an attribute, or a line of JavaScript."""


def embedded(value: Any) -> str:
    """JSON that cannot break out of the script element or attribute it stands in."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).translate(_UNSAFE)


def replay_data(replay: Replay) -> dict[str, Any]:
    """Data of the player.

    `lanes`, `laneWidth` [cm]: the simulated road; `seconds`: frames of a scene; `decisions`: whether vehicles with
    decisions are known; `scenes`: objects with `id`, `recording`, `start` [s], `run`, `h`, `sim` and `real`. The last
    two have `vehicles`: pieces `{t, x, y, l}`, first frame, positions along and across the road as differences [cm],
    length [cm]; and `speed`, the mean of each frame [m/s]. `sim` has `crash` (frame of a vehicle's crash, -1 for none),
    `asked`, `[frame, vehicle, action]`, and `places`, the vehicles simulated at a time; pieces of replayed vehicles
    have `r`.
    """
    model = traffic_model(replay.config.core)
    scenes, size = [], 0
    for replayed in replay.replayed:
        scene = _scene(replay.scenes, replayed, model.lane_width)
        size += len(embedded(scene))
        if scenes and size > MAX_CHARACTERS:
            break
        scenes.append(scene)
    return {
        "lanes": model.n_lanes,
        "realLanes": max(scene["lanes"] for scene in scenes),
        "laneWidth": round(_CM * model.lane_width),
        "seconds": replay.scenes.seconds,
        "decisions": replay.has_decisions,
        "scenes": scenes,
    }


def _scene(scenes: SceneSet, replayed: ReplayedScene, lane_width: float) -> dict[str, Any]:
    index, frames = replayed.index, replayed.frames
    track = scenes.track_id[index]
    y, n_lanes = _lateral(scenes, index, lane_width)
    presences = _presences(replayed)
    sim_x, sim_y = np.asarray(frames.x), np.asarray(frames.y)
    vehicles = [
        _piece(first, sim_x[indices], sim_y[indices], float(replayed.lengths[slot]))
        for slot, first, indices in presences
    ]
    crashes = [np.flatnonzero(np.asarray(frames.crashed)[indices]) for _, _, indices in presences]
    around = [] if replayed.around is None else _replayed_pieces(replayed.around, lane_width)
    asked = []
    for decision in replayed.decisions:
        numbers = (
            number
            for number, (slot, first, (seconds, _)) in enumerate(presences)
            if slot == decision.vehicle and first <= decision.second < first + len(seconds)
        )
        asked += [[decision.second, number, decision.action] for number in numbers]
    return {
        "id": int(scenes.scene_id[index]),
        "recording": str(scenes.recording[index]),
        "start": round(float(scenes.start_time[index]), 1),
        "run": replayed.run,
        "h": round(replayed.h, 4),
        "lanes": n_lanes,
        "sim": {
            "vehicles": vehicles + around,
            "places": len(replayed.lengths),
            "speed": _means(np.asarray(frames.speed)),
            "crash": [
                first + int(crashed[0]) if len(crashed) else -1
                for (_, first, _), crashed in zip(presences, crashes, strict=True)
            ],
            "asked": asked,
        },
        "real": {
            "vehicles": _pieces(track, scenes.position[index], y, scenes.length[index], np.unique(track)),
            "speed": _means(scenes.speed[index]),
            "scaled": _means(scenes.scaled_speed[index]),
        },
    }


_Presence = tuple[int, int, tuple[np.ndarray, int]]
"""Slot of a simulated vehicle, its first frame, and its indices in arrays `[frames, slots]`."""


def _presences(replayed: ReplayedScene) -> list[_Presence]:
    """Simulated vehicles, slot by slot: one each, or several after each other if vehicles enter as recorded."""
    n_frames, n_slots = replayed.frames.x.shape
    is_new = np.zeros((n_frames, n_slots), bool) if replayed.around is None else replayed.around.is_new[0]
    presences = []
    for slot in range(n_slots):
        for seconds in np.split(np.arange(n_frames), np.flatnonzero(is_new[:, slot])):
            presences.append((slot, int(seconds[0]), (seconds, slot)))
    return presences


def _replayed_pieces(around: SceneBoundary, lane_width: float) -> list[dict[str, Any]]:
    """Pieces of replayed vehicles: intervals in which a vehicle is replayed without interruption."""
    lane = around.replayed_lane[0][:, 0].astype(np.int64)
    track = np.where(lane == NOT_RECORDED, NO_VEHICLE, around.replayed_id[0])
    x, y, length = around.replayed_x[0][:, 0], lane * lane_width, around.replayed_length[0]
    return [piece | {"r": 1} for piece in _pieces(track, x, y, length, np.unique(track[track != NO_VEHICLE]))]


def _means(speed: np.ndarray) -> list[float]:
    return [round(float(value), 2) for value in speed.mean(axis=1)]


def _lateral(scenes: SceneSet, index: int, lane_width: float) -> tuple[Float[np.ndarray, "frames slots"], int]:
    """Lateral positions at which recorded vehicles are drawn [m], and the number of lanes.

    The positions are lane centres, with the carriageways side by side; if lanes are unknown, measured positions.
    """
    lane, direction = scenes.lane[index].astype(np.int64), scenes.direction[index]
    if (lane == UNKNOWN_LANE).any():
        y = scenes.y[index] - scenes.y[index].min()
        return y, int(np.ceil(y.max() / lane_width)) + 1
    name = str(scenes.recording[index])
    counts = next((info.lane_count for info in scenes.infos if info.id == name), {})
    n_lanes_1 = counts.get(1, 0)  # those of carriageway 1; the lanes of carriageway 2 are drawn beside them
    lane = lane + np.where(direction == 2, n_lanes_1, 0)
    return lane * lane_width, max(int(lane.max()) + 1, sum(counts.values()))


def _pieces(
    track: np.ndarray, x: np.ndarray, y: np.ndarray, length: np.ndarray, vehicles: np.ndarray
) -> list[dict[str, Any]]:
    """Pieces of vehicles: intervals in which a vehicle is among the tracks without interruption."""
    pieces = []
    for vehicle in vehicles:
        frame, slot = np.nonzero(track == vehicle)
        for part in np.split(np.arange(len(frame)), np.flatnonzero(np.diff(frame) != 1) + 1):
            indices = (frame[part], slot[part])
            pieces.append(_piece(int(frame[part[0]]), x[indices], y[indices], float(length[indices][0])))
    return pieces


def _piece(first: int, x: np.ndarray, y: np.ndarray, length: float) -> dict[str, Any]:
    """A piece as the player reads it, from its first frame, its positions [m] and the length of the vehicle [m]."""
    return {"t": first, "x": differences(x), "y": differences(y), "l": round(_CM * length)}


def differences(values: np.ndarray) -> list[int]:
    """Differences of successive positions [m] in whole centimetres, after the first position; rounding errors do not
    accumulate.
    """
    whole = np.rint(_CM * np.asarray(values, np.float64)).astype(np.int64)
    return np.diff(whole, prepend=0).tolist()


def positions(steps: Sequence[int]) -> Float[np.ndarray, " frames"]:
    """Positions [m] from the result of `differences`."""
    return np.cumsum(np.asarray(steps, np.int64)) / _CM
