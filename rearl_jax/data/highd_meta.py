"""The two small files of a highD recording: NN_recordingMeta.csv and NN_tracksMeta.csv."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import DataConfig, OnBad
from rearl_jax.data.checks import CLASSES
from rearl_jax.data.delimited import read_csv, read_header
from rearl_jax.data.losses import Losses
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, require_columns

_TRACKS_META = {
    "id": pa.int64(),
    "numFrames": pa.int64(),
    "class": pa.string(),
    "drivingDirection": pa.int64(),
}


@dataclass(frozen=True)
class RecordingMeta:
    """What NN_recordingMeta.csv says.

    Attributes:
        frame_rate: Frames per second [1/s].
        speed_limit: [m/s]; None where there is none.
        markings: y of the lane markings per direction [m], rising; y points down, the first is the topmost.
    """

    frame_rate: float
    speed_limit: float | None
    markings: dict[int, tuple[float, ...]]


def read_recording_meta(path: Path) -> RecordingMeta:
    """Frame rate, speed limit and lane markings of one recording.

    Raises:
        BadRecordingError: A column is missing, or a value is no number.
    """
    present = read_header(path)
    require_columns(present, ("frameRate", "upperLaneMarkings", "lowerLaneMarkings"), str(path))
    with path.open(newline="", encoding="utf-8-sig") as file:
        row = next(csv.DictReader(file), None)
    if row is None:
        raise BadRecordingError(str(path), "the recording has no row", "complete the file")

    def numbers(name: str, at_least: int) -> tuple[float, ...]:
        try:
            values = sorted(float(part) for part in str(row[name]).split(";") if part.strip())
        except ValueError:
            values = []
        if len(values) < at_least or not np.all(np.isfinite(values)):
            text = f"{row[name]!r} is not {at_least} number{'s separated by ; or more' if at_least > 1 else ''}"
            raise BadRecordingError(str(path), text, "correct it", name, 1)
        return tuple(values)

    frame_rate = numbers("frameRate", 1)[0]
    if frame_rate <= 0.0:
        raise BadRecordingError(str(path), f"{frame_rate:g} is not positive", "correct it", "frameRate", 1)
    limit = numbers("speedLimit", 1)[0] if row.get("speedLimit") else -1.0
    return RecordingMeta(
        frame_rate=frame_rate,
        # highD writes -1 where there is no speed limit.
        speed_limit=limit if limit > 0.0 else None,
        markings={1: numbers("upperLaneMarkings", 2), 2: numbers("lowerLaneMarkings", 2)},
    )


def read_tracks_meta(path: Path, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """Columns numFrames, class (in words of the schema) and drivingDirection of every track, by its id.

    A class the schema does not know is left to `schema.validate` unless data.on_bad is stop.

    Raises:
        BadRecordingError: A column or value is missing, an id occurs twice, a direction is neither 1 nor 2;
            or a line is broken or a class is unknown and data.on_bad is stop.
    """
    rows, n_broken = read_csv(path, _TRACKS_META, policy.on_bad)
    if n_broken:
        losses.counts["broken_meta_line"] += n_broken
    meta = rows.to_pandas()
    meta["class"] = meta["class"].str.lower()
    direction = meta["drivingDirection"]
    stops = (
        ("id", meta["id"].isna(), "has no id", "complete it"),
        ("id", meta["id"].duplicated(), "is listed twice", "keep one of the two rows"),
        ("numFrames", meta["numFrames"].isna(), "has no number of frames", "complete it"),
        (
            "drivingDirection",
            ~direction.isin([1, 2]),
            "has a direction that is neither 1 nor 2",
            "correct it",
        ),
    )
    if policy.on_bad is OnBad.stop:
        remedy = f"use one of {', '.join(CLASSES)}{DROP_HINT}"
        stops += (("class", ~meta["class"].isin(CLASSES), "has an unknown class", remedy),)
    for column, bad, problem, remedy in stops:
        if bad.any():
            row = int(np.argmax(bad))
            text = f"track {meta['id'].iloc[row]} {problem} ({meta[column].iloc[row]!r})"
            raise BadRecordingError(str(path), text, remedy, column, row + 1)
    return meta.set_index("id")
