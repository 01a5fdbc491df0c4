"""Record of one scene in highway-env: its vehicles at the start, the meta-actions, and every tick after that.

NumPy only. The scenario axis comes last, as in the core; a single scene has none.
"""

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class Start:
    """All vehicles of a scene before the first tick, in the order of highway-env's list.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        heading: Heading [rad].
        speed: Speed [m/s].
        desired_speed: Desired speed of an IDM vehicle, target speed of one with meta-actions [m/s].
        target_lane: Lane the vehicle is steered to.
        timer: Time since the last lane-change decision [s].
        is_meta: Whether the vehicle follows meta-actions instead of IDM and MOBIL.
        max_accel: Maximum acceleration of the IDM [m/s^2].
        comfort_decel: Comfortable deceleration, positive [m/s^2].
        jam_spacing: Spacing at standstill, centre to centre [m].
        time_gap: Desired time gap [s].
        accel_exponent: Acceleration exponent [-].
        accel_limit: Bound of the executed acceleration [m/s^2].
        politeness: Weight of the followers in MOBIL [-].
        gain_threshold: Least gain of a lane change [m/s^2].
        safe_decel: Largest deceleration a change may impose, positive [m/s^2].
        changes_lanes: Whether the vehicle changes lanes at all.
        length: Length [m].
        width: Width [m].
        collides: Whether the vehicle checks for collisions.
    """

    x: Float[np.ndarray, "vehicles *scenarios"]
    y: Float[np.ndarray, "vehicles *scenarios"]
    heading: Float[np.ndarray, "vehicles *scenarios"]
    speed: Float[np.ndarray, "vehicles *scenarios"]
    desired_speed: Float[np.ndarray, "vehicles *scenarios"]
    target_lane: Int[np.ndarray, "vehicles *scenarios"]
    timer: Float[np.ndarray, "vehicles *scenarios"]
    is_meta: Bool[np.ndarray, "vehicles *scenarios"]
    max_accel: Float[np.ndarray, "vehicles *scenarios"]
    comfort_decel: Float[np.ndarray, "vehicles *scenarios"]
    jam_spacing: Float[np.ndarray, "vehicles *scenarios"]
    time_gap: Float[np.ndarray, "vehicles *scenarios"]
    accel_exponent: Float[np.ndarray, "vehicles *scenarios"]
    accel_limit: Float[np.ndarray, "vehicles *scenarios"]
    politeness: Float[np.ndarray, "vehicles *scenarios"]
    gain_threshold: Float[np.ndarray, "vehicles *scenarios"]
    safe_decel: Float[np.ndarray, "vehicles *scenarios"]
    changes_lanes: Bool[np.ndarray, "vehicles *scenarios"]
    length: Float[np.ndarray, "vehicles *scenarios"]
    width: Float[np.ndarray, "vehicles *scenarios"]
    collides: Bool[np.ndarray, "vehicles *scenarios"]


@dataclass(frozen=True)
class Tracks:
    """The motion of all vehicles: at the start and after every tick.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        heading: Heading [rad].
        speed: Speed [m/s].
        lane: Nearest lane.
        target_lane: Lane the vehicle is steered to.
        crashed: Whether the vehicle has been in a collision.
    """

    x: Float[np.ndarray, "steps vehicles *scenarios"]
    y: Float[np.ndarray, "steps vehicles *scenarios"]
    heading: Float[np.ndarray, "steps vehicles *scenarios"]
    speed: Float[np.ndarray, "steps vehicles *scenarios"]
    lane: Int[np.ndarray, "steps vehicles *scenarios"]
    target_lane: Int[np.ndarray, "steps vehicles *scenarios"]
    crashed: Bool[np.ndarray, "steps vehicles *scenarios"]


@dataclass(frozen=True)
class Recorded:
    """One scene (or, with a scenario axis, many) as highway-env ran it.

    Attributes:
        start: The vehicles before the first tick.
        actions: Meta-action of each vehicle at the start of each second; IDLE for IDM vehicles.
        tracks: The motion.
    """

    start: Start
    actions: Int[np.ndarray, "seconds vehicles *scenarios"]
    tracks: Tracks


def stack(scenes: Sequence[Recorded]) -> Recorded:
    """Scenes of equal size side by side, the scenario axis last."""
    parts = [_arrays(scene) for scene in scenes]
    return _recorded({name: np.stack([part[name] for part in parts], axis=-1) for name in parts[0]})


def to_bytes(scene: Recorded) -> bytes:
    """The scene as an uncompressed .npz file (double precision hardly compresses)."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **_arrays(scene))
    return buffer.getvalue()


def from_bytes(content: bytes) -> Recorded:
    """The scene written by `to_bytes`.

    Raises:
        ValueError: If the checksum of an array is wrong. NumPy itself checks only arrays that it reads to their end.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as file:
        if (name := file.testzip()) is not None:
            raise ValueError(f"wrong checksum of {name}")
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return _recorded({name: file[name] for name in file.files})


def _arrays(scene: Recorded) -> dict[str, np.ndarray]:
    """All arrays by their full names, e.g. `tracks.x`."""
    arrays = {"actions": scene.actions}
    for part in ("start", "tracks"):
        record = getattr(scene, part)
        arrays |= {f"{part}.{field.name}": getattr(record, field.name) for field in fields(record)}
    return arrays


def _recorded(arrays: dict[str, np.ndarray]) -> Recorded:
    def part(record: type, prefix: str) -> dict[str, np.ndarray]:
        return {field.name: arrays[f"{prefix}.{field.name}"] for field in fields(record)}

    return Recorded(
        start=Start(**part(Start, "start")), actions=arrays["actions"], tracks=Tracks(**part(Tracks, "tracks"))
    )
