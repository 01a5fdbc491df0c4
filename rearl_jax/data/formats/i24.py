"""Reader of I-24 MOTION INCEPTION: JSON documents of trajectories in feet, hours of several miles in one file.

A recording is a time window on a section of road; the code calls this pair a cell. x_position is the mile marker of the
rear of a vehicle, in feet; it rises eastbound and falls westbound. y_position is the distance from the middle of the
road: 12 ft of shoulder, then lanes of 12 ft. The files hold no speeds; they are derived from x_position and time.

Source: Gloudemans, Wang, Ji, Zachar, Barbour and Work, I-24 MOTION: An instrument for freeway traffic science,
Transportation Research Part C 155 (2023) 104311; github.com/I24-MOTION/data_tutorial.
"""

import re
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.frame_rates import MAX_FRAME_OFFSET, between_frames
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.checks.motion_checks import standing
from rearl_jax.data.checks.typed_table import unknown_class
from rearl_jax.data.files.content import in_utf8
from rearl_jax.data.files.folder import named_files
from rearl_jax.data.files.json_documents import parsed, read_documents
from rearl_jax.data.files.text_layout import readable
from rearl_jax.data.formats.i24_index import FEET, FIELDS, LANE, OPTIONAL, Cell, Index, Tracks, index_of
from rearl_jax.data.problems import Finding, bad_recording
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.problems import out_of_range

LICENCE = "on request from i24motion.org, no redistribution"
ATTRIBUTION = (
    "Gloudemans et al. (2023), I-24 MOTION: An instrument for freeway traffic science, Transportation Research Part C; "
    "I-24 MOTION INCEPTION, i24motion.org"
)
N_LANES = 4
"""Through lanes of each direction; further lanes are added where vehicles use them."""
_MAX_LANES = 6
_USED = 0.01  # smallest share of the rows of a direction that makes a further lane
_BATCH_BYTES = 32 * 2**20  # bytes of documents that are parsed at a time
_FIRST_DOCUMENT_BYTES = 2**23  # more than the document of a vehicle that is recorded for an hour
_WINTER = timedelta(hours=-6)  # Central Standard Time; all published days are in it
_CLASSES = {0.0: "car", 1.0: "car", 2.0: "car", 3.0: "car", 4.0: "truck", 5.0: "truck", 6.0: "motorcycle"}
_CODES = "0 (sedan), 1 (midsize), 2 (van), 3 (pickup), 4 (semi), 5 (truck), 6 (motorcycle)"
# Columns of the file by canonical name, for messages.
_SPELLING = {
    "x": "x_position",
    "position": "x_position",
    "speed": "x_position",
    "y": "y_position",
    "lateral": "y_position",
    "frame": "timestamp",
    "vehicle_class": "coarse_vehicle_class",
}

find_files = partial(
    named_files,
    endings=(".json", ".jsonl", ".ndjson"),
    wanted="the folder with the trajectories of I-24 MOTION INCEPTION, as JSON",
    usual=".json",
)
"""The .json files in the folder, or the one file that is named; FileNotFoundError if there is none."""


def is_one(path: Path) -> bool:
    """True if the file begins with a document that has the fields of a trajectory."""
    with readable(path), in_utf8(path) as file:
        head = file.read(_FIRST_DOCUMENT_BYTES)
    return re.match(rb"(\xef\xbb\xbf)?\s*(\[\s*)?\{", head) is not None and all(
        re.search(rb'"%s"\s*:' % name.encode(), head) for name in FIELDS
    )


def cells(path: Path, policy: DataConfig) -> dict[str, Cell]:
    """Recording id -> its window and section; i24_20221121_063000_mm59.65 begins at 6:30:00 and mile marker 59.65.

    Raises:
        BadRecordingError: The file holds no documents of I-24 MOTION, or one is broken and data.on_bad is stop.
        InvalidInputError: data.window or data.section is so short that two recordings would have one name.
    """
    index = index_of(path, policy)
    if not index.cells:
        raise bad_recording("no-rows", "the file has no sound document", "remove the file or copy it again", path)
    cell_of = {_name(cell, path, policy): cell for cell in sorted(index.cells)}
    if len(cell_of) < len(index.cells):
        is_window = policy.window is not None and policy.window < 1.0
        key, least, value = ("window", "1 s", policy.window) if is_window else ("section", "17 m", policy.section)
        message = f"must be at least {least}, so that every recording has a name of its own"
        raise out_of_range(f"data.{key}", message, value)
    return cell_of


def read_cell(path: Path, recording: str, cell: Cell, policy: DataConfig) -> Recording:
    """One window of time on one section of road.

    Documents that were left out are counted with the first recording of the file.

    Raises:
        BadRecordingError: A row breaks the schema.
    """
    index = index_of(path, policy)
    losses = Losses()
    if cell == min(index.cells):
        losses.counts.update(index.dropped)
    numbers = np.array(index.cells[cell])
    rows = pd.concat([_rows(path, part, index, cell, policy) for part in _parts(numbers, index)])
    return _recording(rows, index, recording, cell, path, policy, losses)


def _name(cell: Cell, path: Path, policy: DataConfig) -> str:
    """Id of the recording of a cell: local start of its window and mile marker of its section."""
    name = f"i24_{path.stem}"
    if policy.window is not None:
        start = datetime.fromtimestamp(cell[0] * policy.window, UTC) + _WINTER
        name = start.strftime("i24_%Y%m%d_%H%M%S")
    if policy.section is not None:
        name += f"_mm{cell[1] * policy.section / (5280.0 * FEET):.2f}"
    return name


def _parts(numbers: np.ndarray, index: Index) -> list[np.ndarray]:
    """The documents in groups of about _BATCH_BYTES, because a document holds the whole track of a vehicle."""
    group = np.cumsum(np.array(index.sizes)[numbers]) // _BATCH_BYTES
    return np.split(numbers, np.flatnonzero(np.diff(group)) + 1)


def _rows(path: Path, numbers: np.ndarray, index: Index, cell: Cell, policy: DataConfig) -> pd.DataFrame:
    """Rows of documents in a window and section, in SI units; the index holds the numbers of the documents."""
    texts = read_documents(path, [index.starts[n] for n in numbers], [index.sizes[n] for n in numbers])
    documents, _ = parsed(texts, FIELDS | OPTIONAL)
    tracks = Tracks(documents)

    def every_row(name: str) -> np.ndarray:
        return np.repeat(tracks.of_document(name), tracks.counts)

    time, side, length = tracks.time, every_row("direction"), FEET * every_row("length")
    rear = FEET * tracks.values("x_position")
    begin = time[tracks.begins] * index.frame_rate - index.phase
    frame = np.repeat(np.rint(begin), tracks.counts)
    frame += np.rint((time - np.repeat(time[tracks.begins], tracks.counts)) * index.frame_rate)
    rows = pd.DataFrame(
        {
            "frame": frame,
            "side": side,
            "centre": rear + 0.5 * side * length,
            "lateral": FEET * (np.abs(tracks.values("y_position")) - LANE),
            "speed": side * _slope(rear, time, tracks),
            "length": length,
            "width": FEET * every_row("width"),
            "class": every_row("coarse_vehicle_class"),
            "is_between_frames": np.repeat(np.abs(begin - np.rint(begin)) > MAX_FRAME_OFFSET, tracks.counts),
        },
        index=np.repeat(numbers, tracks.counts),
    )
    return rows.iloc[np.flatnonzero(_within(time, rows["centre"].to_numpy(), tracks, cell, policy))]


def _recording(
    rows: pd.DataFrame, index: Index, recording: str, cell: Cell, path: Path, policy: DataConfig, losses: Losses
) -> Recording:
    """The recording that consists of the rows of a cell, as from `_rows`."""
    centre, side, lateral, speed, frame = (
        rows[name].to_numpy() for name in ("centre", "side", "lateral", "speed", "frame")
    )
    start = float(centre.min()) if policy.section is None else cell[1] * policy.section
    length = float(centre.max()) - start if policy.section is None else policy.section
    along = centre - start
    speed, of_speeds = standing(speed)
    lane, lane_count, unknown = _lanes(lateral, side)
    table = pd.DataFrame(
        {
            "track_id": rows.index.to_numpy() + 1,
            "frame": frame - frame.min(),
            "direction": np.where(side > 0.0, 2, 1),
            "x": along,
            "y": side * (lateral + FEET * LANE),
            "position": np.where(side > 0.0, along, length - along),
            "lateral": lateral,
            "lane": lane,
            "speed": speed,
            "length": rows["length"].to_numpy(),
            "width": rows["width"].to_numpy(),
            "vehicle_class": _classes(rows["class"].to_numpy()),
        },
        index=rows.index,
    )
    notes = ["speeds are changes of position, accelerations are unknown; the road is straightened by the source"]
    notes += of_speeds
    if unknown:
        notes.append(f"{unknown} rows beside the lanes (12 ft each, from 12 ft off the median) have no lane")
    is_between = rows["is_between_frames"].to_numpy(bool)
    if is_between.any():
        notes.append(between_frames(rows.index[is_between].nunique()))
    info = RecordingInfo(
        id=recording,
        frame_rate=index.frame_rate,
        lane_count=lane_count,
        road_length=max(length, 1.0),
        source="I-24 MOTION INCEPTION",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        notes=tuple(notes),
        file=str(path),
        columns=_SPELLING,
    )
    text, remedy = "no speed follows from the times: there is only one, or they do not rise", "correct the times"
    no_speed = Finding("time_unordered", "frame", ~np.isfinite(speed), text, remedy)
    table = reject(table, no_speed, info, policy, losses)
    table = reject(table, unknown_class(table, info, policy, _CODES), info, policy, losses)
    return Recording(info, *validate(table, info, policy, losses))


def _slope(values: np.ndarray, time: np.ndarray, tracks: Tracks) -> np.ndarray:
    """Changes of values with time within each document: central differences, one-sided at its ends."""
    rows = np.arange(len(values))
    before = np.where(tracks.follows, rows - 1, rows)
    after = np.append(np.where(tracks.follows[1:], rows[1:], rows[:-1]), rows[-1])
    step = time[after] - time[before]
    # A document with one row, or with one time only, has no speed.
    return np.divide(values[after] - values[before], step, out=np.full(len(values), np.nan), where=step > 0.0)


def _within(time: np.ndarray, centre: np.ndarray, tracks: Tracks, cell: Cell, policy: DataConfig) -> np.ndarray:
    """Mask of the rows in the window, from the first to the last of each document in the section."""
    inside = np.ones(len(time), dtype=bool)
    if policy.window is not None:
        inside &= np.floor(time / policy.window) == cell[0]
    if policy.section is None:
        return inside
    there = inside & (np.floor(centre / policy.section) == cell[1])
    rows = np.arange(len(time))
    first = np.minimum.reduceat(np.where(there, rows, len(rows)), tracks.begins)
    last = np.maximum.reduceat(np.where(there, rows, -1), tracks.begins)
    return inside & (rows >= np.repeat(first, tracks.counts)) & (rows <= np.repeat(last, tracks.counts))


def _lanes(lateral: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, dict[int, int], int]:
    """Lane of each row, lanes of each direction, and number of rows without a lane."""
    lane = np.floor(lateral / (FEET * LANE))
    lane_count = {}
    for way in (-1.0, 1.0):
        here = lane[side == way]
        if here.size:
            used = [n for n in range(N_LANES, _MAX_LANES) if np.mean(here == n) >= _USED]
            lane_count[2 if way > 0 else 1] = max(used, default=N_LANES - 1) + 1
            lane[side == way] = np.where((here >= 0) & (here <= max(used, default=N_LANES - 1)), here, np.nan)
    return lane, lane_count, int((~np.isfinite(lane)).sum())


def _classes(numbers: np.ndarray) -> np.ndarray:
    """Classes of the schema; an unknown number stays as text, a missing one is None."""
    found, which = np.unique(numbers, return_inverse=True)
    words = [_CLASSES.get(number, None if np.isnan(number) else f"{number:g}") for number in found]
    return np.array(words, object)[which]
