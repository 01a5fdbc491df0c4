"""Reader of exiD: entries and exits of German motorways, NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv.

The files give the centre of a vehicle on a map, with y pointing north, and the lanelets (pieces of lanes) it is on. The
road is straightened along the paths of its vehicles, lanelets side by side become lanes, and ramps are left out where
they leave the road.

Source: Moers, Vater, Krajewski, Bock, Zlocki and Eckstein, The exiD Dataset, IEEE IV 2022, and its format description.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.checks.motion_checks import standing
from rearl_jax.data.checks.placeholders import nowhere
from rearl_jax.data.files.delimited import read_csv, read_header
from rearl_jax.data.formats.highd import number_of, recording_files
from rearl_jax.data.formats.highd_meta import (
    check_single_row,
    read_tracks_meta,
    sound_frame_rate,
    sound_speed_limit,
    whole_tracks,
)
from rearl_jax.data.problems import Finding, bad_recording
from rearl_jax.data.roads.straightened import Straightened, leave_out, straightened
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.data.vehicle_rows import follows_row_before

LICENCE = "exiD licence: non-commercial research on request, no redistribution"
ATTRIBUTION = "Moers, Vater, Krajewski, Bock, Zlocki and Eckstein, The exiD Dataset, IEEE IV 2022; levelxdata.com"
_TRACKS = {
    "trackId": pa.int64(),
    "frame": pa.int64(),
    "xCenter": pa.float64(),
    "yCenter": pa.float64(),
    "width": pa.float64(),
    "length": pa.float64(),
    "lonVelocity": pa.float64(),
    "lonAcceleration": pa.float64(),
    # Where lanelets overlap, their numbers are separated by semicolons.
    "laneletId": pa.string(),
    "laneChange": pa.float64(),
}
COLUMNS = frozenset(_TRACKS)
"""Columns of NN_tracks.csv that are read."""
# Columns of the file by canonical name, for messages.
_SPELLING = {
    "track_id": "trackId",
    "x": "xCenter",
    "position": "xCenter",
    "y": "yCenter",
    "lateral": "yCenter",
    "lane": "laneletId",
    "speed": "lonVelocity",
    "acceleration": "lonAcceleration",
    "vehicle_class": "class",
}


def recording_id(tracks_file: Path) -> str:
    """Id of the recording with this tracks file, such as exid_01."""
    return f"exid_{number_of(tracks_file)}"


def read_recording(tracks_file: Path, policy: DataConfig) -> Recording:
    """The recording whose tracks are in the file NN_tracks.csv.

    Rows on ramps away from the road, and outside the map, are left out and counted as `off_road`.

    Raises:
        FileNotFoundError: One of the three files is missing.
        BadRecordingError: The files are of another data set, contradict each other, or a row breaks the schema.
    """
    header = read_header(tracks_file)
    if "xCenter" in header and "laneletId" not in header:
        text = "this is the format of inD, rounD and uniD: crossings, roundabouts and a campus, not straight roads"
        remedy = "read highD with data=highd and exiD with data=exid; only motorways can be read"
        raise bad_recording("format-unsupported", text, remedy, tracks_file, column="laneletId")
    losses = Losses()
    _, meta_file, recording_file = recording_files(tracks_file)
    frame_rate, speed_limit = _recording_meta(recording_file)
    meta = read_tracks_meta(meta_file, policy, losses)
    rows = _rows(tracks_file, policy, losses)
    info = RecordingInfo(
        id=recording_id(tracks_file),
        frame_rate=frame_rate,
        lane_count={1: 1},
        road_length=1.0,
        source="exiD",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        speed_limit=speed_limit,
        file=str(tracks_file),
        columns=_SPELLING,
    )
    rows = whole_tracks(rows, meta, info, policy, losses)
    rows = reject(rows, nowhere(rows, "xCenter", "yCenter"), info, policy, losses)
    rows = rows.iloc[np.lexsort((rows["frame"].to_numpy(), rows["track_id"].to_numpy()))]
    road = _straight(rows, info)
    table, notes = _driver_frame(rows, meta, road)
    lane_count = {side: order.count for side, order in road.lanes.items()}
    info = replace(info, lane_count=lane_count, road_length=road.road_length, notes=tuple(notes))
    text = "the vehicle drives against all others of its lane"
    finding = Finding("wrong_direction", "x", road.wrong_way, text, "correct its positions")
    table = reject(table, finding, info, policy, losses)
    table = leave_out(table, pd.Series(road.off_road | road.no_lane, index=rows.index), losses)
    return Recording(info, *validate(table, info, policy, losses))


def _recording_meta(path: Path) -> tuple[float, float | None]:
    """Frame rate [1/s] and speed limit [m/s], None where there is none."""
    rows, _ = read_csv(path, {"frameRate": pa.float64(), "speedLimit": pa.float64()}, BadRows.stop)
    check_single_row(rows, path)
    if rows["frameRate"][0].as_py() is None:
        raise bad_recording("no-rows", "the recording has no frame rate", "complete the file", path, column="frameRate")
    limit = rows["speedLimit"][0].as_py()
    frame_rate = sound_frame_rate(rows["frameRate"][0].as_py(), path)
    return frame_rate, sound_speed_limit(-1.0 if limit is None else limit, path)


def _rows(path: Path, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """Rows with the first of their lanelets, NaN outside of the map."""
    table, n_broken = read_csv(path, _TRACKS, policy.on_bad)
    losses.count("broken_line", n_broken)
    if not table.num_rows:
        raise bad_recording("no-rows", "the recording has no rows", "remove the file or complete it", path)
    lanelets = pc.call_function("replace_substring_regex", [table["laneletId"]], pc.ReplaceSubstringOptions(";.*", ""))
    try:
        numbers = lanelets.cast(pa.float64()).to_numpy()
    except pa.ArrowInvalid as error:
        text = str(error).partition("\n")[0]
        raise bad_recording("value-unreadable", text, "write numbers there", path, column="laneletId") from None
    rows = table.drop_columns(["laneletId"]).to_pandas(split_blocks=True, self_destruct=True)
    rows["lanelet"] = np.where(numbers >= 0.0, numbers, np.nan)
    return rows.rename(columns={"trackId": "track_id"})


def _straight(rows: pd.DataFrame, info: RecordingInfo) -> Straightened:
    """The road on which the vehicles drive; BadRecordingError if their paths do not show it."""
    track = rows["track_id"].to_numpy()
    begins = ~follows_row_before(track) | (rows["laneChange"].to_numpy() == 1.0)
    x, y, lanelet = (rows[name].to_numpy(np.float64) for name in ("xCenter", "yCenter", "lanelet"))
    # shared=1.0, because all vehicles on a lanelet drive the same way.
    road = straightened(track, np.cumsum(begins), x, y, lanelet, info, y_down=False, shared=1.0)
    if road.is_mirrored:
        text = "the traffic keeps to the left of the oncoming one"
        raise bad_recording("wrong-orientation", text, "let yCenter grow to the north", info.file, column="yCenter")
    return road


def _driver_frame(rows: pd.DataFrame, meta: pd.DataFrame, road: Straightened) -> tuple[pd.DataFrame, list[str]]:
    """Columns of the schema, and notes on what was changed."""
    speed, notes = standing(rows["lonVelocity"].to_numpy(np.float64))
    table = pd.DataFrame(
        {
            "track_id": rows["track_id"].to_numpy(),
            "frame": rows["frame"].to_numpy(),
            **{name: road.columns[name].to_numpy() for name in road.columns},
            "speed": speed,
            "acceleration": rows["lonAcceleration"].to_numpy(np.float64),
            "length": rows["length"].to_numpy(np.float64),
            "width": rows["width"].to_numpy(np.float64),
            "vehicle_class": meta["class"].reindex(rows["track_id"].to_numpy()).to_numpy(object),
        },
        index=rows.index,
    )
    return table, ["the road is straightened by the paths of its vehicles, lanes are lanelets side by side", *notes]
