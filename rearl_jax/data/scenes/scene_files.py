"""Scenes to Parquet and back: one row per scene, snapshot and slot, the rest in the schema metadata."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.scenes.scene_set import ARRAYS, SceneCounts, SceneSet
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem
from rearl_jax.results import Study, read_metadata

_METADATA = "scenes"
_WRITE = "write it with `rearl prepare`"
_PER_SCENE = ("scene_id", "recording", "window", "start_frame", "start_time", "frame_rate")
_LANES = ("lane", "next_lane")
_DERIVED = ("scaled_speed",)


def save_scenes(scenes: SceneSet, study: Study, name: str = "scenes") -> Path:
    """Path of the scenes, written as a table of the study; `load_scenes` reads it."""
    return study.write_table(name, scene_table(scenes), **{_METADATA: _metadata(scenes)})


def scene_table(scenes: SceneSet) -> pd.DataFrame:
    """Long form: the per-scene columns, `k` (snapshot), `slot`, then every array and the scaled speed.

    Rows are sorted by scene, snapshot and slot. A lane is missing if it is unknown, `next_lane` also if the vehicle has
    left.
    """
    n_scenes, n_frames, n_slots = scenes.speed.shape
    columns: dict[str, object] = {}
    for name in _PER_SCENE:
        columns[name] = np.repeat(getattr(scenes, name), n_frames * n_slots)
    columns["recording"] = pd.Categorical(columns["recording"])
    columns["k"] = np.tile(np.repeat(np.arange(n_frames, dtype=np.int16), n_slots), n_scenes)
    columns["slot"] = np.tile(np.arange(n_slots, dtype=np.int16), n_scenes * n_frames)
    for name in (*(name for name in ARRAYS if name not in _PER_SCENE), *_DERIVED):
        values = getattr(scenes, name).reshape(-1)
        columns[name] = pd.arrays.IntegerArray(values, values == UNKNOWN_LANE) if name in _LANES else values
    return pd.DataFrame(columns)


def load_scenes(path: str | Path) -> SceneSet:
    """The scenes that `save_scenes` wrote, value for value.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a file of scenes, its description is wrong, or rows are missing or out of order.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingInputError(Problem("file-missing", "there is no such file", _WRITE, file=str(path)))
    stored = read_metadata(path).get(_METADATA)
    if stored is None:
        message = f"the file holds no scenes (its metadata has no key {_METADATA})"
        raise InvalidInputError(Problem("no-scenes", message, _WRITE, file=str(path)))
    try:
        meta = json.loads(stored)
        described = {
            "speed_min": float(meta["speed_min"]),
            "speed_max": float(meta["speed_max"]),
            "speed_norm": SpeedNorm[meta["speed_norm"]],
            "infos": tuple(RecordingInfo.from_json(info) for info in meta["infos"]),
            "counts": SceneCounts(**meta["counts"]),
            "settings": dict(meta["settings"]),
        }
        shape = n_scenes, n_frames, n_slots = tuple(map(int, meta["shape"]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        message = f"the description of the scenes is incomplete or wrong: {type(error).__name__}: {error}"
        raise InvalidInputError(Problem("metadata-unusable", message, _WRITE, file=str(path))) from error
    table = pd.read_parquet(path)
    missing = [name for name in (*ARRAYS, "k", "slot") if name not in table.columns]
    if missing:
        message = "the column is missing"
        raise InvalidInputError(Problem("column-missing", message, _WRITE, file=str(path), column=missing[0]))
    k, slot = table["k"].to_numpy(np.int64), table["slot"].to_numpy(np.int64)
    expected = np.arange(n_scenes * n_frames * n_slots)
    if len(table) != len(expected) or (k * n_slots + slot != expected % (n_frames * n_slots)).any():
        message = (
            f"there are {len(table)} rows, the metadata state {n_scenes} scenes x {n_frames} snapshots x {n_slots} "
            "slots in this order: the file was changed after it was written"
        )
        raise InvalidInputError(Problem("rows-changed", message, _WRITE, file=str(path)))
    arrays = {}
    for name in ARRAYS:
        column = table[name]
        if name in _PER_SCENE:
            arrays[name] = column.to_numpy()[:: n_frames * n_slots].copy()
        else:
            values = column.to_numpy(np.int8, na_value=UNKNOWN_LANE) if name in _LANES else column.to_numpy()
            arrays[name] = values.reshape(shape)
    arrays["recording"] = arrays["recording"].astype(np.str_)
    return SceneSet(**arrays, **described)


def _metadata(scenes: SceneSet) -> str:
    return json.dumps(
        {
            "shape": scenes.speed.shape,
            "speed_min": scenes.speed_min,
            "speed_max": scenes.speed_max,
            "speed_norm": scenes.speed_norm.name,
            "counts": asdict(scenes.counts),
            "infos": [info.to_json() for info in scenes.infos],
            "settings": dict(scenes.settings),
        },
        allow_nan=False,
    )
