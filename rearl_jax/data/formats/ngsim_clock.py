"""Recordings in a published NGSIM table, distinguished by the time of their frame 0: global time - 100 ms * frame."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.data.problems import bad_recording

# Lanes with the ramps, NGSIM data descriptions: US-101 has five lanes, the auxiliary lane 6, on-ramp 7 and
# off-ramp 8; I-80 has six lanes and the on-ramp 7. Lane 1 is the leftmost.
LANES = {"us101": 8, "i80": 7}
"""Lanes of each highway."""
ARTERIALS = ("lankershim", "peachtree")
"""Sites that are not highways, in the export of all sites."""
# Both campaigns were in daylight saving time of the Pacific coast (13 April and 15 June 2005).
_LOCAL_TIME = timedelta(hours=-7)
_PERIOD = 100.0  # ms between two frames
_LATEST = 4.1e12  # ms, the end of the year 2099
_UNITS = {"s": 1e3, "us": 1e-3, "ns": 1e-6}  # ms
_SINCE = 3.1e11  # ms, the year 1980: smaller times since 1970 are in a larger unit
_MIN_VEHICLE_SHARE = (
    0.05  # share of the vehicles of a site's largest recording below which another one is a fault of the clock
)


def recordings_of(rows: pd.DataFrame, path: Path) -> dict[str, np.ndarray]:
    """Recording id -> its row positions; empty if all rows are of arterials.

    Args:
        rows: Columns `track_id`, `frame`, `global_time` and perhaps `location`; the index holds the rows of the file.
        path: The file, whose name may state the place.

    Raises:
        BadRecordingError: Times are in another unit, a time is impossible, or it belongs to another frame than the row
            says.
    """
    impossible = impossible_times(rows, path)
    if impossible.any():
        row = int(np.argmax(impossible))
        text = "the time is before 1970 or after 2100"
        remedy = "give milliseconds since 1970, and 10 frames per second"
        raise bad_recording("time-impossible", text, remedy, path, column="Global_Time", row=int(rows.index[row]) + 1)
    start = _start(rows)
    recordings: dict[str, np.ndarray] = {}
    for place, here in places_of(rows, path).items():
        if place in ARTERIALS:
            continue
        starts, inverse = np.unique(start[here], return_inverse=True)
        parts = [here[inverse == number] for number in range(len(starts))]
        _require_many_vehicles(rows, parts, path)
        for first, own in zip(starts, parts, strict=True):
            recording = f"{place}_{_clock(int(first))}"
            others = recordings.setdefault(recording, own)
            if others is not own:
                text = f"Global_Time and Frame_ID of {recording} do not go together as in its other rows"
                raise _contradiction(text, rows, min(own, others, key=len), path)
    return recordings


def impossible_times(rows: pd.DataFrame, path: Path) -> np.ndarray:
    """Mask of the rows of a frame 0 before 1970 or after 2100, such as those with a placeholder as their time.

    Raises:
        BadRecordingError: Times are in another unit.
    """
    track, frame, time = (rows[name].to_numpy(np.float64) for name in ("track_id", "frame", "global_time"))
    _require_ms(track, frame, time, path)
    start = _start(rows)
    return ~((start >= 0.0) & (start <= _LATEST))


def _start(rows: pd.DataFrame) -> np.ndarray:
    """Time of frame 0 by each row [ms since 1970]."""
    return rows["global_time"].to_numpy(np.float64) - _PERIOD * rows["frame"].to_numpy(np.float64)


def places_of(rows: pd.DataFrame, path: Path) -> dict[str, np.ndarray]:
    """Place, such as us101 -> its row positions; by the name of the file where the rows do not state it."""
    if "location" not in rows:
        return {_place_of(path): np.arange(len(rows))}
    categories = pd.Categorical(rows["location"].fillna(""))
    names = [plain(str(name)) or _place_of(path) for name in categories.categories]
    places = {name: np.flatnonzero(categories.codes == code) for code, name in enumerate(names)}
    return places or {_place_of(path): np.arange(0)}


def plain(name: str) -> str:
    """A column or place name without case and punctuation: the spelling differs from copy to copy."""
    return "".join(c for c in name.lower() if c.isalnum())


def _require_ms(track: np.ndarray, frame: np.ndarray, time: np.ndarray, path: Path) -> None:
    """Raise BadRecordingError for times in s, us or ns, by their size and by what they grow per frame."""
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


def _require_many_vehicles(rows: pd.DataFrame, parts: list[np.ndarray], path: Path) -> None:
    """Raise BadRecordingError for some rows with a shifted clock, which would be a recording of a few vehicles.

    Vehicle numbers restart in every recording. So rows belong to the other recording if their vehicles are few compared
    with those of the other one, or if they continue there in the next frame.
    """
    track, frame = rows["track_id"].to_numpy(), rows["frame"].to_numpy()
    vehicles = [np.unique(track[part]) for part in parts]
    largest = max(range(len(parts)), key=lambda number: len(parts[number]), default=0)
    for number, part in enumerate(parts):
        few = number != largest and len(vehicles[number]) <= max(1.0, _MIN_VEHICLE_SHARE * len(vehicles[largest]))
        alone = len(vehicles[number]) < len(vehicles[largest])
        if number != largest and ((few and alone) or _continues(track, frame, part, parts[largest])):
            text = f"{len(part)} rows of vehicle {vehicles[number][0]}"
            text += f" and {len(vehicles[number]) - 1} others" if len(vehicles[number]) > 1 else ""
            text += " have another Global_Time for their Frame_ID than all other rows"
            raise _contradiction(text, rows, part, path)


def _continues(track: np.ndarray, frame: np.ndarray, part: np.ndarray, other: np.ndarray) -> bool:
    """True if every vehicle of a part has its next or last frame, and none of its own frames, in the other part."""
    own = pd.DataFrame({"track": track[part], "frame": frame[part]})
    there = pd.MultiIndex.from_arrays([track[other], frame[other]])
    if pd.MultiIndex.from_frame(own).isin(there).any():
        return False
    ends = own.groupby("track")["frame"].agg(["min", "max"])
    before = pd.MultiIndex.from_arrays([ends.index, ends["min"] - 1]).isin(there)
    after = pd.MultiIndex.from_arrays([ends.index, ends["max"] + 1]).isin(there)
    return bool((before | after).all())


def _contradiction(text: str, rows: pd.DataFrame, part: np.ndarray, path: Path) -> Exception:
    row = int(rows.index[part[0]]) + 1
    remedy = "correct or remove the rows"
    return bad_recording("time-contradicts-frame", text, remedy, path, column="Global_Time", row=row)


def _place_of(path: Path) -> str:
    """Name of the place if the file name contains it."""
    return next((place for place in LANES if place in plain(path.name)), "ngsim")


def _clock(start_ms: int) -> str:
    """Local start time on the 12-hour clock to the nearest five minutes, as in the NGSIM file names."""
    start = datetime.fromtimestamp(start_ms / 1000.0, UTC) + _LOCAL_TIME + timedelta(minutes=2.5)
    return (start - timedelta(minutes=start.minute % 5)).strftime("%I%M")
