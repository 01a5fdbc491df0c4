"""Recordings in a published NGSIM table, distinguished by the time of their frame 0: global time - 100 ms * frame."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.data.checks.stray_rows import are_few, are_shared, continue_in, fill_gaps_of
from rearl_jax.data.formats.ngsim import LANES
from rearl_jax.data.formats.published_names import plain
from rearl_jax.data.problems import bad_recording, source_row

ARTERIALS = ("lankershim", "peachtree")
"""Sites that are not highways, in the export of all sites."""
# Both campaigns were in daylight saving time of the Pacific coast (13 April and 15 June 2005).
_LOCAL_TIME = timedelta(hours=-7)
_PERIOD = 100.0  # ms between two frames
_LATEST = 4.1e12  # ms, the end of the year 2099
_UNITS = {"s": 1e3, "us": 1e-3, "ns": 1e-6, "min": 6e4, "h": 3.6e6, "days": 8.64e7}  # ms
_SINCE = 3.1e11  # ms, the year 1980: smaller times are in a larger unit than ms
_MAX_STANDING = 0.5  # largest share of frames with the same time as the frame before


def recordings_of(rows: pd.DataFrame, path: Path) -> dict[str, np.ndarray]:
    """Recording id -> its row positions; empty if all rows are of arterials.

    The rows have the columns `track_id`, `frame`, `global_time` and perhaps `location`; without it the name of the file
    states the place. The index holds the rows of the file.

    Raises:
        BadRecordingError: Times are in another unit, a time is impossible, or it belongs to another frame or place than
            the row says.
    """
    impossible = impossible_times(rows, path)
    if impossible.any():
        text = "the time is before 1970 or after 2100"
        remedy, row = "give milliseconds since 1970, and 10 frames per second", source_row(rows, impossible)
        raise bad_recording("time-impossible", text, remedy, path, column="Global_Time", row=row)
    start = _start(rows)
    recordings: dict[str, np.ndarray] = {}
    places = places_of(rows, path)
    _require_one_place(rows, start, places, path)
    for place, here in places.items():
        if place in ARTERIALS:
            continue
        starts, inverse = np.unique(start[here], return_inverse=True)
        parts = [here[inverse == number] for number in range(len(starts))]
        _require_many_vehicles(rows, parts, path)
        for frame_zero, part in zip(starts, parts, strict=True):
            recording = f"{place}_{_clock(int(frame_zero))}"
            earlier = recordings.setdefault(recording, part)
            if earlier is not part:
                text = f"Global_Time and Frame_ID of {recording} do not go together as in its other rows"
                raise _contradiction(text, rows, min(part, earlier, key=len), path)
    return recordings


def impossible_times(rows: pd.DataFrame, path: Path) -> np.ndarray:
    """Mask of the rows whose frame 0 would be before 1970 or after 2100, for example because of a placeholder.

    Raises:
        BadRecordingError: Times are in another unit.
    """
    track, frame, time = (rows[name].to_numpy(np.float64) for name in ("track_id", "frame", "global_time"))
    _require_ms(track, frame, time, path)
    start = _start(rows)
    return ~((start >= 0.0) & (start <= _LATEST))


def _start(rows: pd.DataFrame) -> np.ndarray:
    """Time of frame 0 that follows from each row [ms since 1970]."""
    return rows["global_time"].to_numpy(np.float64) - _PERIOD * rows["frame"].to_numpy(np.float64)


def places_of(rows: pd.DataFrame, path: Path) -> dict[str, np.ndarray]:
    """Place, such as us101 -> its row positions; the place is that of the file name if the rows do not state it.

    Raises:
        BadRecordingError: Some places are those of NGSIM and others are not.
    """
    if "location" not in rows:
        return {_place_of(path.name): np.arange(len(rows))}
    categories = pd.Categorical(rows["location"].fillna(""))
    words = [plain(str(word)) for word in categories.categories]
    names = [_place_of(word, word) if word else _place_of(path.name) for word in words]
    of_word = np.array(names, dtype=object)[categories.codes]
    places = {name: np.flatnonzero(of_word == name) for name in dict.fromkeys(names)}
    known = [name for name in places if name in (*LANES, *ARTERIALS)]
    strange = [name for name in places if name not in known]
    if known and strange:
        part = places[strange[0]]
        stated = rows["location"].iloc[part[0]]
        text = f"{_rows_of(rows, part)} have " + ("no place" if pd.isna(stated) else f"the place {str(stated)!r}")
        remedy = f"write {' or '.join(known)} there, or remove the rows"
        raise _error("location-unknown", f"{text}, the others {' and '.join(known)}", remedy, rows, part, path)
    return places or {_place_of(path.name): np.arange(0)}


def _require_ms(track: np.ndarray, frame: np.ndarray, time: np.ndarray, path: Path) -> None:
    """Raise BadRecordingError for times that are not in ms, by their size and their growth per frame."""
    known = np.isfinite(track) & np.isfinite(frame) & np.isfinite(time)
    track, frame, time = track[known], frame[known], time[known]
    order = np.lexsort((frame, track))
    follows = (np.diff(track[order]) == 0) & (np.diff(frame[order]) > 0)
    steps = np.diff(time[order])[follows] / np.diff(frame[order])[follows]
    usual = float(np.median(time)) if len(time) else 0.0
    for unit, milliseconds in _UNITS.items():
        is_date = _SINCE <= usual * milliseconds <= _LATEST and not _SINCE <= usual <= _LATEST
        grows_so = steps.size and abs(float(np.mean(steps)) * milliseconds / _PERIOD - 1.0) < 0.5
        if is_date and (grows_so or not steps.size):
            text = f"the times are in {unit}, not ms: they are about {usual:.6g}"
            raise bad_recording("wrong-units", text, "give milliseconds since 1970", path, column="Global_Time")
    if steps.size and np.mean(steps == 0.0) > _MAX_STANDING:
        text = f"the times have lost digits: {np.mean(steps == 0.0):.0%} of them are as in the frame before"
        remedy = "export them with all digits, in milliseconds since 1970"
        raise bad_recording("time-contradicts-frame", text, remedy, path, column="Global_Time")
    # In the order of time, because several recordings of the file have the same vehicles and frames.
    order = np.lexsort((time, track))
    follows = (np.diff(track[order]) == 0) & (np.diff(frame[order]) > 0)
    growths = np.diff(time[order])[follows] / np.diff(frame[order])[follows]
    growth = float(np.median(growths)) if growths.size else _PERIOD
    if not 0.5 * _PERIOD < growth < 1.5 * _PERIOD:
        text = f"the times grow by {growth:g} per frame, and not by {_PERIOD:g} ms"
        remedy = "give milliseconds since 1970, and 10 frames per second"
        raise bad_recording("wrong-units", text, remedy, path, column="Global_Time")


def _require_one_place(rows: pd.DataFrame, start: np.ndarray, places: dict[str, np.ndarray], path: Path) -> None:
    """Raise BadRecordingError for rows with a wrong place: vehicles that complete a recording of another place."""
    if len(places) < 2:
        return
    track, frame = rows["track_id"].to_numpy(), rows["frame"].to_numpy()
    with_start: dict[float, str] = {}  # time of frame 0 -> place with the most rows
    for place in sorted(places, key=lambda name: -len(places[name])):
        for frame_zero in np.unique(start[places[place]]):
            main = with_start.setdefault(frame_zero, place)
            if main == place:
                continue
            part, other = (here[start[here] == frame_zero] for here in (places[place], places[main]))
            if not are_shared(track, frame, part, other):
                text = f"{_rows_of(rows, part)} have the place {place}, the other vehicles of their time {main}"
                remedy = "correct or remove the rows"
                raise _error("location-contradicts-time", text, remedy, rows, part, path)


def _require_many_vehicles(rows: pd.DataFrame, parts: list[np.ndarray], path: Path) -> None:
    """Raise BadRecordingError for rows with shifted times, which would become a separate recording of few vehicles.

    Such rows belong to the largest recording if their vehicles are few in comparison, have the numbers that are missing
    there, or continue there in the next frame; vehicle numbers of separate recordings are independent.
    """
    track, frame = rows["track_id"].to_numpy(), rows["frame"].to_numpy()
    vehicles = [np.unique(track[part]) for part in parts]
    largest = max(range(len(parts)), key=lambda number: len(parts[number]), default=0)
    for number, part in enumerate(parts):
        own, others = vehicles[number], vehicles[largest]
        if number != largest and (
            are_few(len(own), len(others))
            or fill_gaps_of(own, others)
            or continue_in(track, frame, part, parts[largest])
        ):
            text = f"{_rows_of(rows, part)} have another Global_Time for their Frame_ID than all other rows"
            raise _contradiction(text, rows, part, path)


def _rows_of(rows: pd.DataFrame, part: np.ndarray) -> str:
    """Rows of a part and their vehicles, in words."""
    vehicles = np.unique(rows["track_id"].to_numpy()[part])
    others = f" and {len(vehicles) - 1} others" if len(vehicles) > 1 else ""
    return f"{len(part)} rows of vehicle {vehicles[0]}{others}"


def _contradiction(text: str, rows: pd.DataFrame, part: np.ndarray, path: Path) -> Exception:
    """The error for rows whose time is not that of their frame."""
    return _error("time-contradicts-frame", text, "correct or remove the rows", rows, part, path, "Global_Time")


def _error(
    code: str, text: str, remedy: str, rows: pd.DataFrame, part: np.ndarray, path: Path, column: str = "Location"
) -> Exception:
    """The error for some rows of the file."""
    return bad_recording(code, text, remedy, path, column=column, row=int(rows.index[part[0]]) + 1)


def _place_of(name: str, otherwise: str = "ngsim") -> str:
    """Known place whose name is part of the name of a file or place."""
    return next((place for place in (*LANES, *ARTERIALS) if place in plain(name)), otherwise)


def _clock(start_ms: int) -> str:
    """Local start time on the 12-hour clock to the nearest five minutes, as in the NGSIM file names."""
    start = datetime.fromtimestamp(start_ms / 1000.0, UTC) + _LOCAL_TIME + timedelta(minutes=2.5)
    return (start - timedelta(minutes=start.minute % 5)).strftime("%I%M")
