"""The two small files of a recording of highD or exiD, NN_recordingMeta.csv and NN_tracksMeta.csv, and the check that
its rows are those of the tracks that are listed there.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.checks.unit_checks import LANE_WIDTH
from rearl_jax.data.files.delimited import read_csv, read_header
from rearl_jax.data.problems import DROP_HINT, Finding, bad_recording, require_columns, without_value
from rearl_jax.data.records import SPEED_LIMITS, RecordingInfo
from rearl_jax.data.vehicle_classes import CLASSES, classes_of

_REQUIRED = ("frameRate", "upperLaneMarkings", "lowerLaneMarkings")
_SLOWEST, _FASTEST = 0.1, 1000.0  # frames per second; outside of this range no camera records traffic

_TRACKS_META = {
    "id": pa.int64(),
    "numFrames": pa.int64(),
    "class": pa.string(),
    "drivingDirection": pa.int64(),
}


@dataclass(frozen=True)
class RecordingMeta:
    """Content of NN_recordingMeta.csv: frame rate [1/s], speed limit [m/s] if there is one, and for each direction y of
    the lane markings [m], ascending; y points down, so that the first is the topmost.
    """

    frame_rate: float
    speed_limit: float | None
    markings: dict[int, tuple[float, ...]]


def check_single_row(rows: pa.Table, path: Path) -> None:
    """Raise BadRecordingError unless a recording is described by one row."""
    if rows.num_rows != 1:
        message = f"a recording is described by one row, not {rows.num_rows}"
        raise bad_recording("one-row", message, "keep the row of this recording", path)


def read_recording_meta(path: Path) -> RecordingMeta:
    """Frame rate, speed limit and lane markings of one recording.

    Raises:
        BadRecordingError: A column is missing, there is not one row, or a value is not a number.
    """
    present = read_header(path)
    require_columns(present, _REQUIRED, path)
    columns = {name: pa.string() for name in (*_REQUIRED, *({"speedLimit"} & set(present)))}
    rows, _ = read_csv(path, columns, BadRows.stop)
    check_single_row(rows, path)

    def numbers(name: str, at_least: int) -> tuple[float, ...]:
        written = rows[name][0].as_py() or ""
        try:
            values = sorted(float(part) for part in written.split(";") if part.strip())
        except ValueError:
            values = []
        if len(values) < at_least or not np.all(np.isfinite(values)):
            text = f"{written!r} is not {at_least} number{'s separated by ; or more' if at_least > 1 else ''}"
            raise bad_recording("not-a-number", text, "correct it", path, column=name, row=1)
        return tuple(values)

    def markings(name: str) -> tuple[float, ...]:
        lines = numbers(name, 2)
        width = float(np.median(np.diff(lines)))
        if not LANE_WIDTH[0] <= width <= LANE_WIDTH[1]:
            text = f"the lane markings are {width:.2f} m apart, outside {LANE_WIDTH[0]} to {LANE_WIDTH[1]} m"
            raise bad_recording("wrong-units", text, "give them in m", path, column=name, row=1)
        return lines

    frame_rate = sound_frame_rate(numbers("frameRate", 1)[0], path)
    limit = numbers("speedLimit", 1)[0] if "speedLimit" in columns and rows["speedLimit"][0].as_py() else -1.0
    return RecordingMeta(
        frame_rate=frame_rate,
        speed_limit=sound_speed_limit(limit, path),
        markings={1: markings("upperLaneMarkings"), 2: markings("lowerLaneMarkings")},
    )


def sound_frame_rate(value: float, path: Path) -> float:
    """The frame rate [1/s]; BadRecordingError if it is implausible."""
    if not _SLOWEST <= value <= _FASTEST:
        text = f"{value:g} is not a number of frames per second"
        raise bad_recording("frame-rate", text, "correct it", path, column="frameRate", row=1)
    return value


def sound_speed_limit(value: float, path: Path) -> float | None:
    """The speed limit [m/s]; None for -1, which means no limit; BadRecordingError if it is implausible."""
    if value > 0.0 and not SPEED_LIMITS[0] <= value <= SPEED_LIMITS[1]:
        text = f"{value:g} m/s is not a speed limit of a highway"
        raise bad_recording("speed-limit", text, "give it in m/s, -1 for none", path, column="speedLimit", row=1)
    return value if value > 0.0 else None


def read_tracks_meta(path: Path, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """Columns numFrames, class (in words of the schema) and drivingDirection of every track, by its id.

    Files of exiD call the id trackId and have no direction. A class that the schema does not know is left to
    `schema.validate` unless data.on_bad is stop.

    Raises:
        BadRecordingError: A column or value is missing, an id occurs twice, a direction is neither 1 nor 2;
            or a line is broken or a class is unknown and data.on_bad is stop.
    """
    track = "trackId" if "trackId" in read_header(path) else "id"
    columns = {track if name == "id" else name: kind for name, kind in _TRACKS_META.items()}
    if track == "trackId":
        del columns["drivingDirection"]
    rows, n_broken = read_csv(path, columns, policy.on_bad)
    losses.count("broken_meta_line", n_broken)
    meta = rows.to_pandas().rename(columns={track: "id"})
    meta["class"] = classes_of(meta["class"])
    direction = meta["drivingDirection"] if "drivingDirection" in meta else pd.Series(1, index=meta.index)
    neither = "has a direction that is neither 1 nor 2"
    stops = (
        ("id-missing", "id", meta["id"].isna(), "has no id", "complete it"),
        ("duplicate", "id", meta["id"].duplicated(), "is listed twice", "keep one of the two rows"),
        ("value-missing", "numFrames", meta["numFrames"].isna(), "has no number of frames", "complete it"),
        ("wrong-direction", "drivingDirection", ~direction.isin([1, 2]), neither, "correct it"),
    )
    if policy.on_bad is BadRows.stop:
        remedy = f"use one of {', '.join(CLASSES)}{DROP_HINT}"
        stops += (("unknown-class", "class", ~meta["class"].isin(CLASSES), "has an unknown class", remedy),)
    for code, column, bad, message, remedy in stops:
        if bad.any():
            row = int(np.argmax(bad))
            text = f"track {meta['id'].iloc[row]} {message} ({meta[column].astype(object).iloc[row]!r})"
            raise bad_recording(code, text, remedy, path, column=track if column == "id" else column, row=row + 1)
    return meta.set_index("id")


def whole_tracks(
    rows: pd.DataFrame, meta: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> pd.DataFrame:
    """The rows of tracks with all frames that NN_tracksMeta.csv states; tracks that are only listed there are counted.

    Raises:
        BadRecordingError: A row has no track, its track is not listed or lacks frames, or a listed track has no row,
            and data.on_bad is stop; or nothing is left.
    """
    rows = reject(rows, without_value(rows, "track_id"), info, policy, losses).astype({"track_id": np.int64})
    absent = np.setdiff1d(meta.index.to_numpy(), rows["track_id"].to_numpy())
    if absent.size and policy.on_bad is BadRows.stop:
        text = f"{absent.size} tracks of the meta file have no row, the first is {absent[0]}"
        remedy = f"the file is cut off: copy it again{DROP_HINT}"
        raise bad_recording("tracks-without-rows", text, remedy, info.file, column=info.columns["track_id"])
    losses.count("tracks_without_rows", int(absent.size))
    rows = reject(rows, _not_in_meta(rows, meta), info, policy, losses)
    return reject(rows, _truncated(rows, meta), info, policy, losses)


def _not_in_meta(rows: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows whose track is not listed in NN_tracksMeta.csv."""
    track = rows["track_id"].to_numpy()
    unknown = ~np.isin(track, meta.index.to_numpy())
    if not unknown.any():
        return None
    text = f"track {track[np.argmax(unknown)]} is not in the meta file"
    return Finding("track_without_meta", "track_id", unknown, text, "complete the meta file")


def _truncated(rows: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows of tracks that have fewer frames than NN_tracksMeta.csv states."""
    ids, which, counts = np.unique(rows["track_id"].to_numpy(), return_inverse=True, return_counts=True)
    stated = meta["numFrames"].reindex(ids).to_numpy()
    short = counts < stated
    if not short.any():
        return None
    first = which[np.argmax(short[which])]
    text = f"track {ids[first]} has {counts[first]} of the {stated[first]} frames that the meta file states"
    return Finding("truncated", "track_id", short[which], text, "the file is cut off: copy it again")
