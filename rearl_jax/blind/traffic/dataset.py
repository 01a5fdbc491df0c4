"""Files of a data set: canonical tables, which contain only measured quantities, and the truth about them."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.blind.traffic.catalogue import HIDDEN, LANE_CHOICE, LISTED
from rearl_jax.blind.traffic.highd import write_highd
from rearl_jax.blind.traffic.measurement import ARTEFACTS, LANE_WIDTH, Frames, measure, seen_road
from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import Events, simulate
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.tables.canonical import write_recording
from rearl_jax.problems import out_of_range

POSITIONS = ("start", "end")
"""Parameters of effects that are positions on the road. The truth states them from the start of the recorded road."""


def write_dataset(folder: Path, scenario: Scenario, *, as_highd: bool = False) -> dict[str, Any]:
    """Simulates a data set and writes one canonical table per recording; returns the truth without writing it.

    Args:
        folder: Folder of the tables; created if missing.
        scenario: Scenario of the data set.
        as_highd: Write three files per recording in the highD format instead.

    Raises:
        ValueError: The scenario contains an unknown effect, or cannot be stored in the highD format.
    """
    for item in scenario.planted:
        if item.name not in (*HIDDEN, *LANE_CHOICE, *ARTEFACTS):
            names = ", ".join([*HIDDEN, *LANE_CHOICE, *ARTEFACTS])
            raise out_of_range("planted", f"must be one of {names}", item.name)
        if item.name in LANE_CHOICE and not scenario.free_changes:
            raise out_of_range("free_changes", f"must be 1 for {item.name}", int(scenario.free_changes))
    events = simulate(scenario)
    write = write_highd if as_highd else write_tables
    write(folder, scenario, events, measure(scenario, events))
    return hidden_truth(scenario, events)


def write_tables(folder: Path, scenario: Scenario, events: Events, frames: Frames) -> None:
    """Writes one canonical table per recording."""
    for number in range(scenario.n_recordings):
        recording = _recording(scenario, events, frames, number)
        write_recording(recording, folder / f"{recording.info.id}.parquet")


def hidden_truth(scenario: Scenario, events: Events) -> dict[str, Any]:
    """The truth of a data set: an entry per hidden effect, and the numbers of lane changes and emergency brakings.

    The kind of an effect is "artefact", "listed" (in the library of effects) or "unlisted".
    """
    effects = iter(events.effects)
    road_start, _ = seen_road(scenario, events)
    planted = []
    for item in scenario.planted:
        entry: dict[str, Any] = {"name": item.name, "strength": item.strength}
        if item.name in ARTEFACTS:
            planted.append(entry | {"kind": "artefact", "truths": [item.name], "variables": [], "parameters": {}})
            continue
        effect = next(effects)
        parameters = {
            name: value - road_start if name in POSITIONS else value for name, value in effect.parameters.items()
        }
        kind = "listed" if item.name in LISTED | LANE_CHOICE else "unlisted"
        entry |= {"kind": kind, "truths": list(effect.truths), "variables": list(effect.variables)}
        planted.append(entry | {"parameters": {name: float(value) for name, value in parameters.items()}})
    n_changes = int(np.count_nonzero(np.diff(events.lane, axis=0)))
    return {"planted": planted, "n_lane_changes": n_changes, "n_emergencies": events.n_emergencies}


def _recording(scenario: Scenario, events: Events, frames: Frames, number: int) -> Recording:
    """Recording number `number`, counted from 0, as a canonical table."""
    members = np.flatnonzero(events.fleet.recording == number)
    # Identifiers are random, so that they do not reveal the order in the platoon.
    shuffled = np.random.default_rng([scenario.seed, 7, number]).permutation(members)
    n_frames = len(frames.position)
    seen = frames.seen[:, shuffled].T.ravel()
    columns = {name: getattr(frames, name)[:, shuffled].T.ravel()[seen] for name in vars(frames) if name != "seen"}
    track = np.repeat(np.arange(1, len(shuffled) + 1), n_frames)[seen]
    vehicle = np.repeat(shuffled, n_frames)[seen]
    frame = np.tile(np.arange(n_frames), len(shuffled))[seen]
    name = hashlib.sha256(f"{scenario.seed} {number}".encode()).hexdigest()[:6]
    position = np.round(columns["position"], 3)
    lateral = np.round(columns["lateral"], 3)
    table = pd.DataFrame(
        {
            "recording": pd.Categorical([f"r{name}"] * len(track)),
            "track_id": track,
            "frame": frame,
            "time": frame / scenario.frame_rate,
            "direction": np.int8(1),
            "x": position,
            "y": lateral,
            "position": position,
            "lateral": lateral,
            "lane": pd.array(columns["lane"], dtype="Int8"),
            "speed": np.round(columns["speed"], 3),
            "acceleration": np.round(columns["acceleration"], 3),
            "length": events.fleet.length[vehicle],
            "width": events.fleet.width[vehicle],
            "vehicle_class": pd.Categorical(np.where(events.fleet.is_truck[vehicle], "truck", "car")),
            "leader_id": pd.array([pd.NA] * len(track), dtype="Int64"),
        }
    )
    markings = tuple(LANE_WIDTH * k for k in range(scenario.n_lanes + 1))
    info = RecordingInfo(
        id=f"r{name}",
        frame_rate=scenario.frame_rate,
        lane_count={1: scenario.n_lanes},
        road_length=float(np.ceil(position.max() + 50.0)),
        source="blind study",
        licence="CC0-1.0",
        attribution="generated",
        generated=True,
        lane_markings={1: markings},
    )
    return Recording(info, table)
