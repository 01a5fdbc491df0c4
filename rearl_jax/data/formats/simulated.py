"""Recordings of traffic simulators: links of a network become one road, positions of fronts become those of centres.

Every reader of a simulator's output converts its rows to the columns of `FIELDS`. Simulated traffic is not a
measurement, so these recordings are marked as generated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks import clock
from rearl_jax.data.checks.frame_rates import phase_of, require_distinct_times, usual_rate_of
from rearl_jax.data.checks.losses import Losses, reject, split_tracks
from rearl_jax.data.checks.placeholders import is_placeholder
from rearl_jax.data.checks.typed_table import MAX_LANES, MAX_MAGNITUDE
from rearl_jax.data.problems import Finding, bad_recording
from rearl_jax.data.roads.main_road import Steps, main_road
from rearl_jax.data.roads.origin import from_its_beginning
from rearl_jax.data.schema import Recording, RecordingInfo, validate

FIELDS = ("time", "track_id", "link", "lane", "front", "speed", "length", "vehicle_class")
"""Columns that every simulator must give.

time [s], track_id from 0, link (categories are the names of links), lane on the link (0 = rightmost), front: distance
of the vehicle's front from the beginning of the link [m], speed [m/s], length [m], vehicle_class.
"""

LANE_STEP = 4.0
"""Lateral distance [m] that a vehicle may move in a step: simulators change lanes at once; SUMO's are 3.2 m wide."""

# Columns of FIELDS whose values must be known.
_KNOWN = ("time", "track_id", "link", "lane", "front", "speed", "length")
_CLOCK_TOLERANCE = 0.05  # of a time step; largest deviation of a time from the steps of the simulation
_MAX_ROUNDING = 0.45  # of a time step; from half a step on, rounded times are not those of one step
_MAX_TIME = 1e8  # s, three years
_MAX_NAMED_LINKS = 3  # links that a note names
_MIN_LANE_ROWS = 3  # rows from which on a lane counts as used


@dataclass(frozen=True)
class Simulation:
    """Properties of a simulation beyond its rows.

    Attributes:
        info: The recording, without frame rate, lanes and length of the road, which follow from the rows.
        lanes: Number of lanes of links by name; for other links the lanes that vehicles use are counted.
        limits: Speed limits of links by their names [m/s].
        lane_width: Width of a lane [m], if `aside` gives the position in the lane; else None.
    """

    info: RecordingInfo
    lanes: Mapping[str, int]
    limits: Mapping[str, float]
    lane_width: float | None = None


def is_generated(data: DataConfig, root: Path) -> bool:
    """True: simulated traffic is not a measurement."""
    return True


def info_of(
    path: Path, id: str, source: str, labels: tuple[str, ...], notes: Sequence[str], columns: dict[str, str]
) -> RecordingInfo:
    """The record of a simulated recording; frame rate, lanes and road length are placeholders until rows are read.

    `source` is the simulator; `labels` are columns that are labels of tracks, `notes` the assumptions, and `columns`
    the names of columns in the file, by canonical name.
    """
    return RecordingInfo(
        id=id,
        frame_rate=1.0,
        lane_count={1: 1},
        road_length=1.0,
        source=source,
        licence="not stated in the file",
        attribution="who ran the simulation",
        generated=True,
        labels=labels,
        notes=tuple(notes),
        file=str(path),
        columns=columns,
    )


def recording_of(rows: pd.DataFrame, simulation: Simulation, policy: DataConfig, losses: Losses) -> Recording:
    """The recording of the main road.

    The rows have FIELDS, and where the source has them x, y (of the front), hx, hy (unit vector of the heading in x,
    y), aside (position in the lane, to the right of its middle, in lane widths), acceleration, width, leader_id,
    labels. The index holds the rows of the source, from 0.

    Raises:
        BadRecordingError: A value is missing or the times do not follow a clock and data.on_bad is stop, or a row
            breaks the schema, see `validate`.
    """
    info = simulation.info
    links = rows["link"].cat.categories
    # Before bad rows are dropped, because a lane that disappears with them would change the numbers of all others.
    n_lanes = _lanes_of_links(rows, simulation.lanes)
    rows = _known(rows, info, policy, losses)
    rows, period = _on_clock(rows, info, policy, losses)
    rows = rows.iloc[np.lexsort((rows["frame"].to_numpy(), rows["track_id"].to_numpy()))]
    code = rows["link"].cat.codes.to_numpy().astype(np.int64)
    numbers = {name: rows[name].to_numpy(np.float64) for name in ("front", "speed", "lane", "length")}
    track, frame = rows["track_id"].to_numpy(), rows["frame"].to_numpy()
    begins, laps = main_road(Steps(track, frame, code, numbers["front"], numbers["speed"], period))
    begin = begins[code]
    on_road = ~np.isnan(begin)
    front = begin + numbers["front"]
    position = front - 0.5 * numbers["length"]
    lane = n_lanes[code] - 1.0 - numbers["lane"]
    further = ("acceleration", "width", "leader_id", *info.labels)
    table = rows[["track_id", "frame", "speed", "length", "vehicle_class", *(n for n in further if n in rows)]]
    table = table.assign(direction=1, position=position, lane=lane)
    table = _on_ground(table, rows, simulation)
    info = _described(info, begins, n_lanes, links, period, simulation)
    # A vehicle that comes back from another road, or begins another lap, is a track of its own.
    starts = (_comes_back(track, on_road) | laps) & on_road
    if not on_road.all():
        info = _with_note_on_others(info, code[~on_road], links)
        losses.count("other_road", int((~on_road).sum()))
    table, starts = table.iloc[np.flatnonzero(on_road)], starts[on_road]
    if starts.any():
        note = f"{int(starts.sum())} times a vehicle came back or began another lap: it continues as another vehicle"
        info, table = replace(info, notes=(*info.notes, note)), split_tracks(table, starts)
    with_lane_steps = replace(policy, max_jump=max(policy.max_jump, LANE_STEP / period))
    table, dropped = validate(table, info, with_lane_steps, losses)
    # From the rows that are left, because a bad row must not change the length or the start of the road.
    half = 0.5 * table["length"].to_numpy()
    start = min(float(np.min(table["position"].to_numpy() - half)), 0.0)
    shifted = ("position",) if "hx" in rows else ("position", "x")
    table = table.assign(**{name: table[name] - start for name in shifted}) if start else table
    end = float(np.max(table["position"].to_numpy() + half))
    return from_its_beginning(Recording(replace(info, road_length=end), table, dropped))


def _comes_back(track: np.ndarray, on_road: np.ndarray) -> np.ndarray:
    """Mask of the rows in which a vehicle returns to the road after rows on other links."""
    rows = np.arange(len(track))
    before = np.maximum.accumulate(np.where(on_road, rows, -1))  # last row on the road up to each row
    back = np.zeros(len(track), bool)
    last = before[:-1]  # of any vehicle
    back[1:] = on_road[1:] & ~on_road[:-1] & (last >= 0) & (track[last] == track[1:])
    return back


def _known(rows: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """The rows in which all values of _KNOWN are stated."""
    if rows.empty:
        raise bad_recording("no-rows", "no vehicle is in the file", "complete the file", info.file)
    for name in _KNOWN:
        column = rows[name]
        missing = column.isna().to_numpy()
        if pd.api.types.is_float_dtype(column.dtype):
            missing = ~(np.abs(column.to_numpy()) <= MAX_MAGNITUDE)
        text = "the value is missing, infinite or unreadable"
        rows = reject(rows, Finding("not_finite", name, missing, text, "complete it"), info, policy, losses)
    # Lengths of links follow from speeds, so a speed that stands for none would move other vehicles.
    unknown = is_placeholder(rows["speed"].to_numpy(np.float64))
    if unknown.any():
        text = f"speed is {rows['speed'].iloc[int(np.argmax(unknown))]:g}, which seems to mean an unknown value"
        rows = reject(rows, Finding("out_of_range", "speed", unknown, text, "correct it"), info, policy, losses)
    return rows


def _on_clock(
    rows: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> tuple[pd.DataFrame, float]:
    """The rows with their frame, and the time between two frames [s]."""
    time = np.clip(rows["time"].to_numpy(np.float64), -2.0 * _MAX_TIME, 2.0 * _MAX_TIME)
    track = rows["track_id"].to_numpy()
    order = np.lexsort((time, track))
    same, column = np.diff(track[order]) == 0, info.columns.get("time", "time")
    moved = np.abs(np.diff(rows["front"].to_numpy(np.float64)[order]))
    require_distinct_times(np.diff(time[order])[same], moved[same], info.file, column)
    steps = np.diff(time[order])[same]
    steps = steps[steps > 0.0]
    if not steps.size:
        text, remedy = "no vehicle has rows at two times", "write the positions of every time step"
        raise bad_recording("frame-rate-unknown", text, remedy, info.file, column=column)
    # Steps of 1/30 s are written as 0.03 and 0.04 s.
    is_rounded = np.mean(np.abs(steps - np.median(steps)) > _CLOCK_TOLERANCE * steps) > clock.MAX_IRREGULAR_SHARE
    n_tracks = len(np.unique(track))
    rate = (usual_rate_of(steps, n_tracks) if is_rounded else None) or clock.rate_of(float(np.median(steps)), 0.0)
    least, most = clock.PLAUSIBLE_RATES
    if not least <= rate <= most:
        text = f"vehicles have a row every {1.0 / rate:.4g} s"
        remedy = f"give times in s, and write every {1.0 / most:.2g} to {1.0 / least:g} s"
        raise bad_recording("wrong-units", text, remedy, info.file, column=column)
    steps_since_zero = time * rate
    # Relative to the time of a row near the median; the mean of two middle times might be between two steps.
    since = steps_since_zero - np.sort(steps_since_zero)[len(steps_since_zero) // 2]
    allowed = _CLOCK_TOLERANCE
    if is_rounded:
        since = steps_since_zero - phase_of(steps_since_zero)
        allowed = min(0.505 * clock.resolution(time) * rate + _CLOCK_TOLERANCE, _MAX_ROUNDING)
    off = (np.abs(since - np.rint(since)) > allowed) | (np.abs(time) > _MAX_TIME)
    if off.any():
        text = f"time {time[int(np.argmax(off))]:g} s is none of the time steps, which are {1.0 / rate:g} s apart"
        finding = Finding("bad_time", "time", off, text, "write all vehicles at the same time steps")
        rows = reject(rows, finding, info, policy, losses)
        steps_since_zero = rows["time"].to_numpy(np.float64) * rate
    return rows.assign(frame=np.rint(steps_since_zero).astype(np.int64)), 1.0 / rate


def _lanes_of_links(rows: pd.DataFrame, stated: Mapping[str, int]) -> np.ndarray:
    """Number of lanes of every link: as stated, or up to the leftmost lane with so many rows that it is no error."""
    links = rows["link"].cat.categories
    code, lane = rows["link"].cat.codes.to_numpy(), rows["lane"].to_numpy(np.float64)
    known = (code >= 0) & (lane >= 0.0) & (lane < MAX_LANES)
    pairs = np.stack([code[known], lane[known]]).astype(np.int64)
    lanes, n_rows = np.unique(pairs, axis=1, return_counts=True)
    # On a short link with few rows, a single row is enough.
    enough = np.minimum(_MIN_LANE_ROWS, np.bincount(pairs[0], minlength=len(links))[lanes[0]] // 10)
    used = np.ones(len(links))
    np.maximum.at(used, lanes[0, n_rows >= enough], lanes[1, n_rows >= enough] + 1.0)
    return np.array([stated.get(name, n) for name, n in zip(links, used, strict=True)], np.float64)


def _on_ground(table: pd.DataFrame, rows: pd.DataFrame, simulation: Simulation) -> pd.DataFrame:
    """The table with x, y and, where the position in the lane is known, lateral."""
    aside = rows["aside"].to_numpy() if "aside" in rows else 0.0
    with np.errstate(over="ignore"):  # the schema check finds values out of range
        lateral = (table["lane"].to_numpy() + 0.5 + aside) * (simulation.lane_width or 1.0)
    if "hx" in rows:
        half = 0.5 * rows["length"].to_numpy()
        table = table.assign(
            x=rows["x"].to_numpy() - half * rows["hx"].to_numpy(),
            y=rows["y"].to_numpy() - half * rows["hy"].to_numpy(),
        )
        return table.assign(lateral=lateral) if "aside" in rows else table
    return table.assign(x=table["position"], y=lateral, lateral=lateral)


def _described(
    info: RecordingInfo, begins: np.ndarray, n_lanes: np.ndarray, links: pd.Index, period: float, simulation: Simulation
) -> RecordingInfo:
    """The recording with the properties of its road."""
    order = [int(link) for link in np.argsort(begins) if not np.isnan(begins[link])]
    names = [str(links[link]) for link in order]
    shown = [name for name in names if not name.startswith(":")] or names
    text = ", ".join(shown[: 2 * _MAX_NAMED_LINKS]) + (", ..." if len(shown) > 2 * _MAX_NAMED_LINKS else "")
    notes = [f"simulated; road: {text}"]
    unstated = [name for name in names if name not in simulation.lanes]
    if unstated:
        notes.append("lanes are counted by the vehicles that use them: lanes left of those are not known")
    limits = {simulation.limits.get(name) for name in shown}
    return replace(
        info,
        frame_rate=clock.rate_of(period, 1e-9),
        lane_count={1: int(np.max(n_lanes[order]))},
        speed_limit=limits.pop() if len(limits) == 1 else None,
        notes=(*info.notes, *notes),
    )


def _with_note_on_others(info: RecordingInfo, others: np.ndarray, links: pd.Index) -> RecordingInfo:
    """The recording with a note on links that are not part of the road."""
    found, counts = np.unique(others, return_counts=True)
    most = np.argsort(-counts, kind="stable")[:_MAX_NAMED_LINKS]
    names = ", ".join(f"{links[found[link]]} ({counts[link]} rows)" for link in most)
    more = f" and {len(found) - _MAX_NAMED_LINKS} more" if len(found) > _MAX_NAMED_LINKS else ""
    note = f"{len(others)} rows on other links left out: {names}{more}"
    return replace(info, notes=(*info.notes, note))
