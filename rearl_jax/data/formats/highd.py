"""Reader of the highD format, NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv, one at a time.

Two properties of the format matter here: `x`, `y` are the upper left corner of the bounding box, y pointing
down, and `width`, `height` are the box in the picture, so `width` is the length of the vehicle.

Source: Krajewski, Bock, Kloeker and Eckstein, The highD Dataset, IEEE ITSC 2018, and its format description.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.leaders import without_absent
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.checks.typed_table import RANGES
from rearl_jax.data.checks.unit_checks import WRONG_SHARE
from rearl_jax.data.files.delimited import read_csv, read_header
from rearl_jax.data.files.folder import recordings_missing, tell_of_others_below, visible_files
from rearl_jax.data.formats.highd_meta import read_recording_meta, read_tracks_meta, whole_tracks
from rearl_jax.data.problems import Finding, bad_recording, file_missing, without_value
from rearl_jax.data.roads.origin import from_its_beginning
from rearl_jax.data.schema import Recording, RecordingInfo, validate

LICENCE = "highD licence: non-commercial research on request, no redistribution"
ATTRIBUTION = "Krajewski, Bock, Kloeker and Eckstein, The highD Dataset, IEEE ITSC 2018; levelxdata.com"
GENERATED_LICENCE = "MIT"
GENERATED_ATTRIBUTION = "made by the generator of rearl_jax in the highD format, no measured data"

_TRACKS = {
    "frame": pa.int64(),
    "id": pa.int64(),
    "x": pa.float64(),
    "y": pa.float64(),
    "width": pa.float64(),
    "height": pa.float64(),
    "xVelocity": pa.float64(),
    "xAcceleration": pa.float64(),
    "precedingId": pa.int64(),
    "laneId": pa.int64(),
}
COLUMNS = frozenset(_TRACKS)
"""Columns by which a tracks file is recognised."""
# Columns of the file by canonical name, for messages.
_SOURCE_COLUMNS = {
    "track_id": "id",
    "speed": "xVelocity",
    "acceleration": "xAcceleration",
    "lane": "laneId",
    "position": "x",
    "lateral": "y",
    "length": "width",
    "width": "height",
    "leader_id": "precedingId",
    "vehicle_class": "class",
    "direction": "drivingDirection",
}
_TRACKS_END = "_tracks.csv"
_RARE_SHARE = 0.01  # share of the rows of a direction below which a laneId far from the markings is a fault
_MIN_DIRECTED_SPEED = 0.5  # m/s; the mean velocity of a vehicle in a jam has no reliable sign


def find_recordings(root: Path) -> list[Path]:
    """The NN_tracks.csv that is named, or those in the folder or in its subfolder `data`, as in the published archive.

    Raises:
        FileNotFoundError: There is none.
    """
    if root.is_file() and root.name.lower().endswith(_TRACKS_END):
        return [root]
    for folder in (root, root / "data"):
        found = visible_files(folder, (_TRACKS_END,))
        if found:
            tell_of_others_below(folder, (_TRACKS_END,))
            return found
    wanted = (
        "the folder with NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv of the highD format; "
        "`rearl prepare data=generated` writes such recordings"
    )
    raise recordings_missing("no NN_tracks.csv, neither there nor in its subfolder data", root, wanted, (_TRACKS_END,))


def recording_files(tracks_file: Path) -> tuple[Path, Path, Path]:
    """Tracks, tracks meta and recording meta file of the recording with this tracks file, in whatever case."""
    meta, recording = (
        tracks_file.with_name(f"{number_of(tracks_file)}_{part}.csv") for part in ("tracksMeta", "recordingMeta")
    )
    return tracks_file, _in_any_case(meta), _in_any_case(recording)


def _in_any_case(file: Path) -> Path:
    """The file, or the one whose name differs from its name by case only."""
    if file.is_file():
        return file
    return next((other for other in file.parent.glob("*") if other.name.lower() == file.name.lower()), file)


def number_of(tracks_file: Path) -> str:
    """Number of the recording with this tracks file, such as 01; its name may be in capitals."""
    is_one = tracks_file.name.lower().endswith(_TRACKS_END)
    return tracks_file.name[: -len(_TRACKS_END)] if is_one else tracks_file.name


def require_files(tracks_file: Path) -> tuple[Path, Path, Path]:
    """Tracks, tracks meta and recording meta file of a recording, all of which exist.

    Raises:
        FileNotFoundError: One is missing.
    """
    files = recording_files(tracks_file)
    for file in files:
        if not file.is_file():
            raise file_missing(file)
    return files


def recording_id(tracks_file: Path, *, generated: bool = False) -> str:
    """Id of the recording with this tracks file, such as highd_01; generated_01 if it is not a measurement."""
    return f"{'generated' if generated else 'highd'}_{number_of(tracks_file)}"


def read_recording(tracks_file: Path, policy: DataConfig, *, generated: bool = False) -> Recording:
    """The recording whose tracks are in the file NN_tracks.csv.

    With c the centre of the bounding box and L the largest box edge of the recording: direction 2 drives to
    the right, position = c_x, lateral = c_y - first lower marking; direction 1 drives to the left, position
    = L - c_x, lateral = last upper marking - c_y. speed = |xVelocity|. The other two files lie beside the tracks file.

    Raises:
        FileNotFoundError: One of the three files is missing.
        BadRecordingError: The files contradict each other, or a row breaks the schema, see `validate`.
    """
    losses = Losses()
    if "xCenter" in read_header(tracks_file):
        text = "this is the format of exiD, inD, rounD and uniD"
        remedy = "read exiD with data=exid; the others are not straight roads"
        raise bad_recording("format-unsupported", text, remedy, tracks_file, column="xCenter")
    _, meta_file, recording_file = recording_files(tracks_file)
    recording = read_recording_meta(recording_file)
    meta = read_tracks_meta(meta_file, policy, losses)
    source = _read_tracks(tracks_file, policy, losses)
    info = RecordingInfo(
        id=recording_id(tracks_file, generated=generated),
        frame_rate=recording.frame_rate,
        lane_count={},
        road_length=_last_edge(source["x"].to_numpy() + source["width"].to_numpy()),
        source="generated recordings in the highD format" if generated else "highD",
        licence=GENERATED_LICENCE if generated else LICENCE,
        attribution=GENERATED_ATTRIBUTION if generated else ATTRIBUTION,
        generated=generated,
        speed_limit=recording.speed_limit,
        lane_markings={
            side: tuple(sorted(round(abs(y - _left_edge(lines, side)), 6) for y in lines))
            for side, lines in recording.markings.items()
        },
        file=str(tracks_file),
        columns=_SOURCE_COLUMNS,
    )
    # Completeness before any other loss of single rows, which would make a track look cut off.
    source = whole_tracks(source, meta, info, policy, losses)
    source = reject(source, without_value(source, "laneId"), info, policy, losses).astype({"laneId": np.int64})
    source = reject(source, _wrong_sign(source, meta), info, policy, losses)
    source = reject(source, _no_lane(source, meta, recording.markings), info, policy, losses)
    lanes, notes = _lane_ids(source, meta, recording.markings)
    lane_count = {side: high - low + 1 for side, (low, high) in lanes.items()}
    info = replace(info, lane_count=lane_count, notes=notes)
    table = _driver_frame(source, meta, recording.markings, lanes, info.road_length)
    table, dropped = validate(table, info, policy, losses)
    if dropped:
        # Dropped rows must not influence the road length of the others.
        length = _last_edge(table["x"].to_numpy() + 0.5 * table["length"].to_numpy())
        to_right = table["direction"].to_numpy() == 2
        along = np.where(to_right, table["x"].to_numpy(), length - table["x"].to_numpy())
        table, info = table.assign(position=along), replace(info, road_length=length)
    return from_its_beginning(Recording(info, table, dropped))


def _read_tracks(path: Path, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """Columns _TRACKS of the tracks file, the id as track_id; broken lines are counted."""
    rows, n_broken = read_csv(path, _TRACKS, policy.on_bad)
    losses.count("broken_line", n_broken)
    if not rows.num_rows:
        raise bad_recording("no-rows", "the recording has no rows", "remove the file or complete it", path)
    # Converted column by column, so that Arrow's and NumPy's copies of the table are not in memory together.
    source = pd.DataFrame({name: rows.column(name).to_numpy() for name in _TRACKS}, copy=False)
    return source.rename(columns={"id": "track_id"})


def _no_lane(source: pd.DataFrame, meta: pd.DataFrame, markings: dict[int, tuple[float, ...]]) -> Finding | None:
    """Rows whose laneId is neither a lane of their carriageway nor a stripe next to it, such as the median; and few
    rows with a stripe of vehicles that are between the markings.
    """
    lane_id, median = source["laneId"].to_numpy(), len(markings[1]) + 1
    upper = meta["drivingDirection"].reindex(source["track_id"].to_numpy()).to_numpy() == 1
    first, last = np.where(upper, 2, median + 1), np.where(upper, median - 1, median + len(markings[2]) - 1)
    bad = (lane_id < first - 1) | (lane_id > last + 1)
    y = source["y"].to_numpy() + 0.5 * source["height"].to_numpy()
    for side in (1, 2):
        here = upper == (side == 1)
        beside = here & ~bad & ((lane_id < first) | (lane_id > last))
        beside &= (y > min(markings[side])) & (y < max(markings[side]))
        # If they are many, all ids count from another number.
        if beside.sum() <= WRONG_SHARE * here.sum():
            bad |= beside
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    text = f"laneId {lane_id[row]} of track {source['track_id'].iloc[row]} is not a lane of its carriageway, "
    text += f"they are {first[row]} to {last[row]}"
    return Finding("lane_out_of_range", "lane", bad, text, "correct the laneId")


def _wrong_sign(source: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows of tracks whose mean velocity does not have the sign of their driving direction."""
    ids, which, counts = np.unique(source["track_id"].to_numpy(), return_inverse=True, return_counts=True)
    velocity = source["xVelocity"].to_numpy()
    # An impossible velocity does not determine the direction; the schema check finds it.
    velocity = np.where(np.abs(velocity) <= RANGES["speed"][1], velocity, 0.0)
    mean = np.bincount(which, weights=velocity) / counts
    direction = meta["drivingDirection"].reindex(ids).to_numpy()
    wrong = (np.abs(mean) > _MIN_DIRECTED_SPEED) & (np.sign(mean) != np.where(direction == 2, 1.0, -1.0))
    if not wrong.any():
        return None
    track = int(np.argmax(wrong))
    text = f"track {ids[track]} has mean xVelocity {mean[track]:.1f} m/s but drivingDirection {direction[track]}"
    remedy = "direction 1 drives to the left (negative), 2 to the right (positive): correct one of them"
    return Finding("wrong_direction", "speed", wrong[which], text, remedy)


def _driver_frame(
    source: pd.DataFrame,
    meta: pd.DataFrame,
    markings: dict[int, tuple[float, ...]],
    lanes: dict[int, tuple[int, int]],
    road_length: float,
) -> pd.DataFrame:
    """Columns of the schema; `lanes` holds the smallest and largest laneId of each direction."""
    ids, inverse = np.unique(source["track_id"].to_numpy(), return_inverse=True)
    direction = meta["drivingDirection"].reindex(ids).to_numpy()[inverse]
    classes = pd.Categorical(meta["class"].reindex(ids))
    to_right = direction == 2
    x = source["x"].to_numpy() + 0.5 * source["width"].to_numpy()
    y = source["y"].to_numpy() + 0.5 * source["height"].to_numpy()
    lane_id = source["laneId"].to_numpy()
    position = np.where(to_right, x, road_length - x)
    track, frame = source["track_id"].to_numpy(), source["frame"].to_numpy()
    leader = source["precedingId"].to_numpy()
    return pd.DataFrame(
        {
            "track_id": track,
            "frame": frame,
            "direction": direction.astype(np.int8),
            "x": x,
            "y": y,
            "position": position,
            "lateral": np.where(to_right, y - _left_edge(markings[2], 2), _left_edge(markings[1], 1) - y),
            "lane": np.where(to_right, lane_id - lanes[2][0], lanes[1][1] - lane_id),
            "speed": np.abs(source["xVelocity"].to_numpy()),
            "acceleration": np.where(to_right, 1.0, -1.0) * source["xAcceleration"].to_numpy(),
            "length": source["width"].to_numpy(),
            "width": source["height"].to_numpy(),
            "vehicle_class": pd.Categorical.from_codes(classes.codes[inverse], categories=classes.categories),
            # precedingId 0 means that no vehicle is ahead in the image.
            "leader_id": without_absent(leader, track=track, frame=frame, lane=lane_id, position=position),
        },
        index=source.index,
        copy=False,
    )


def _last_edge(edges: np.ndarray) -> float:
    return float(np.max(edges, where=np.isfinite(edges), initial=0.0))


def _left_edge(lines: tuple[float, ...], direction: int) -> float:
    """y of the marking at the median [m]: y grows downwards, so it is the topmost of direction 2, the lowest of 1."""
    return min(lines) if direction == 2 else max(lines)


def _lane_ids(
    source: pd.DataFrame, meta: pd.DataFrame, markings: dict[int, tuple[float, ...]]
) -> tuple[dict[int, tuple[int, int]], tuple[str, ...]]:
    """Smallest and largest laneId of each direction, and notes.

    highD numbers the stripes between markings from the top, starting with 1 above the first one: n_upper and
    n_lower markings make the upper lanes 2 .. n_upper and the lower ones n_upper + 2 .. n_upper + n_lower.
    Counted from the markings, lanes have the right numbers even if no vehicle used an outer lane. If ids are outside of
    the markings, lanes are counted from the ids that occur. Rare ids that are not next to the markings are ignored,
    because a single one would change the numbers of all lanes; the schema check finds them.
    """
    n_upper, n_lower = len(markings[1]), len(markings[2])
    lanes = {1: (2, n_upper), 2: (n_upper + 2, n_upper + n_lower)}
    notes: tuple[str, ...] = ()
    direction = meta["drivingDirection"].reindex(source["track_id"].to_numpy()).to_numpy()
    lane_id = source["laneId"].to_numpy()
    for side, (low, high) in lanes.items():
        here = lane_id[direction == side]
        used, counts = np.unique(here, return_counts=True)
        used = used[(counts >= _RARE_SHARE * here.size) | ((used >= low - 1) & (used <= high + 1))]
        if used.size and (used.min() < low or used.max() > high):
            lanes[side] = (int(used.min()), int(used.max()))
            notes += (f"direction {side}: laneId outside the lane markings, lanes counted from the ids that occur",)
    return lanes, notes
