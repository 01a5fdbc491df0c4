"""Notes on properties of recordings that are not faults, but need the attention of the user."""

from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.data.checks.lateral_checks import EDGE_TOLERANCE, lane_middles, lanes_off, share_off
from rearl_jax.data.checks.leaders import next_in_lane, notes_on_leaders
from rearl_jax.data.checks.typed_table import MAX_LANES, RANGES
from rearl_jax.data.checks.unit_checks import MIN_STEPS, moving_steps
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.vehicle_rows import ABSENT, first_and_last_rows, follows_row_before

OVERLAPS = 0.005
"""Share of overlaps [-], among rows with a vehicle ahead in the lane, above which noise does not explain them.

Measured: 0.0004 in NGSIM US-101, whose lengths are assumed, and 0 in I-80.
"""
_CHANGE = 2.0  # m/s; a larger change of speed is not noise
_LENGTH_CHANGE = 1.0  # m; more than the error of a camera from frame to frame
_LONG_CAR = 9.8  # m, longer than every car; the length of a short car in ft
_SHORT_CAR = 2.0  # m, shorter than every car; the length of a long car in m, read as ft
_OFF_MOTION = 0.03  # relative difference; measured: 0.005 or less in NGSIM, OpenACC and FHWA's pairs
_HOLE = 60.0  # s without any vehicle, longer than on any road with traffic
_BESIDE = 3.0  # m, from the middle of the lane; a vehicle there is in another lane
_BETWEEN_LANES = 0.42  # lane widths from the middle of the lane; 0.5 is between lanes; measured: 0.35 or less in NGSIM
_WIDTH = 1.8  # m, of a car whose width is unknown


def noted(recording: Recording) -> Recording:
    """The recording, with notes on its rows added to its own notes, each once."""
    table = recording.table
    found = [*notes_on_leaders(table), *_on_lanes(table), *_on_overlaps(table), *_on_starts(table)]
    found += [*_on_accelerations(table), *_on_changing_vehicles(table), *_on_lengths_of_cars(table)]
    found += _on_missing_speeds(table, recording.info.frame_rate)
    found += [*_on_holes(table, recording.info.frame_rate), *_on_motion(table, recording.info)]
    notes = tuple(dict.fromkeys([*recording.info.notes, *found]))
    return recording if notes == recording.info.notes else replace(recording, info=replace(recording.info, notes=notes))


def _on_lanes(table: pd.DataFrame) -> list[str]:
    """Notes on lateral positions that do not agree with lane numbers or the left edge of the carriageway."""
    notes = []
    direction = table["direction"].to_numpy()
    for side in np.unique(direction):
        part = table.iloc[np.flatnonzero(direction == side)]
        if (lanes_off(part) or 0) > 0:
            notes.append(f"direction {side}: lateral positions are further to the right than lane numbers state")
        elif abs(share_off(part) or 0.0) > _BETWEEN_LANES:
            text = "vehicles drive between the lanes that they state: lateral may count from the middle of a lane"
            notes.append(f"direction {side}: {text}, not from the left edge")
        n_beside = _vehicles_beside_lane(part)
        if n_beside:
            notes.append(f"direction {side}: {n_beside} vehicles are a lane beside the one that they state, by lateral")
        n_left = int((part["lateral"] < -EDGE_TOLERANCE).sum())
        if n_left:
            text = "it is assumed to count from the left edge of the carriageway, positive to the right"
            notes.append(f"direction {side}: lateral is negative in {n_left} rows; {text}")
    return notes


def _vehicles_beside_lane(table: pd.DataFrame) -> int:
    """Number of vehicles whose median distance from the middle of their stated lanes exceeds _BESIDE."""
    lane, lateral = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan), table["lateral"].to_numpy()
    lanes, middle = lane_middles(lane, lateral)
    known = np.flatnonzero(np.isfinite(lane) & np.isfinite(lateral))
    if lanes.size < 2 or not known.size:
        return 0
    off = np.abs(lateral[known] - middle[np.searchsorted(lanes, lane[known])])
    return int((pd.Series(off).groupby(table["track_id"].to_numpy()[known]).median() > _BESIDE).sum())


def _on_overlaps(table: pd.DataFrame) -> list[str]:
    """Note if more vehicles overlap with the one ahead than noise explains."""
    ahead = next_in_lane(table)
    without_lane = _next_overlapping_laterally(table)
    ahead = np.where(ahead == ABSENT, without_lane, ahead)
    rows = np.flatnonzero(ahead != ABSENT)
    position, length = table["position"].to_numpy(), table["length"].to_numpy()
    other = ahead[rows]
    gap = position[other] - position[rows] - 0.5 * (length[other] + length[rows])
    n_overlaps = int((gap < 0.0).sum())
    if not n_overlaps or n_overlaps < OVERLAPS * len(rows):
        return []
    text = "rows overlap with the vehicle ahead (gap below 0): lengths, positions or ids may be wrong"
    if not _states_lanes(table):
        text += ", or vehicles are in several lanes, which the table does not state"
    return [f"{n_overlaps} of {len(rows)} {text}"]


def _on_starts(table: pd.DataFrame) -> list[str]:
    """Note if more vehicles begin abreast than there can be lanes: times may count from the start of each track."""
    starts, _ = first_and_last_rows(table["track_id"].to_numpy())
    frame, position, length = (table[name].to_numpy()[starts] for name in ("frame", "position", "length"))
    apart = float(np.ptp(position)) if starts.size else 0.0
    if len(starts) <= MAX_LANES or np.ptp(frame) > 0 or apart > float(np.median(length)):
        return []
    text = f"all {len(starts)} vehicles begin at the same time within {apart:.1f} m"
    return [f"{text}: the times of each vehicle may count from its own start"]


def _on_accelerations(table: pd.DataFrame) -> list[str]:
    """Note if all rows have the same acceleration although speeds change: the source may not have computed it."""
    values, speed = table["acceleration"].to_numpy(), table["speed"].to_numpy()
    known = values[np.isfinite(values)]
    if not known.size or np.ptp(known) > 0.0:
        return []
    if _ranges(speed, table["track_id"].to_numpy()).max() < _CHANGE:
        return []
    return [f"acceleration is {known[0]:g} m/s^2 in every row although speeds change: the column may hold nothing"]


def _on_missing_speeds(table: pd.DataFrame, frame_rate: float) -> list[str]:
    """Note if speeds fall to 0, or repeatedly to one value, within one frame and faster than any vehicle brakes."""
    speed = table["speed"].to_numpy()
    falls = follows_row_before(table["track_id"].to_numpy())[1:]
    falls &= speed[:-1] - speed[1:] > max(RANGES["acceleration"][1] / frame_rate, _CHANGE)
    values, counts = np.unique(speed[1:][falls], return_counts=True)
    if not values.size:
        return []
    value, n_falls = values[np.argmax(counts)], int(counts.max())
    if value > 0.0 and n_falls < 2:
        return []
    fastest = speed[:-1][falls & (speed[1:] == value)].max()
    text = f"in one frame, from up to {fastest:.1f} m/s: it may stand for an unknown speed"
    return [f"speeds fall to {value:g} m/s {n_falls} times {text}"]


def _on_changing_vehicles(table: pd.DataFrame) -> list[str]:
    """Notes on vehicles whose class or length changes: a track may join two vehicles, or detection was uncertain."""
    track = table["track_id"].to_numpy()
    changing = {
        "class": table["vehicle_class"].astype(str).groupby(track).nunique() > 1,
        f"length by more than {_LENGTH_CHANGE:g} m": _ranges(table["length"].to_numpy(), track) > _LENGTH_CHANGE,
    }
    return [f"{int(bad.sum())} vehicles change their {what}" for what, bad in changing.items() if bad.any()]


def _on_lengths_of_cars(table: pd.DataFrame) -> list[str]:
    """Notes on cars whose median length is that of no car."""
    cars = table.iloc[np.flatnonzero(table["vehicle_class"] == "car")]
    length = cars.groupby("track_id")["length"].median().to_numpy()
    faults = {
        f"longer than {_LONG_CAR:g} m: their lengths may be in ft, or they are trucks": length > _LONG_CAR,
        f"shorter than {_SHORT_CAR:g} m: their lengths may be in another unit": length < _SHORT_CAR,
    }
    return [f"{int(bad.sum())} of {len(length)} cars are {text}" for text, bad in faults.items() if bad.any()]


def _on_motion(table: pd.DataFrame, info: RecordingInfo) -> list[str]:
    """Note if vehicles move a little less or more than speed x time, as with the rate of another camera."""
    rows, step, expected = moving_steps(table, info)
    if rows.size < MIN_STEPS:
        return []
    off = np.array([np.median(step / expected), np.sum(step) / np.sum(expected)]) - 1.0
    if not ((off > _OFF_MOTION).all() or (off < -_OFF_MOTION).all()):
        return []
    text = f"vehicles move {1.0 + off[1]:.3f} times as far as speed x time"
    return [f"{text}: speeds, or the frame rate ({info.frame_rate:g} 1/s), may be slightly wrong"]


def _on_holes(table: pd.DataFrame, frame_rate: float) -> list[str]:
    """Note on the longest time without any vehicle: a clock may have been shifted."""
    frames = np.unique(table["frame"].to_numpy())
    if len(frames) < 2 or np.diff(frames).max() <= _HOLE * frame_rate:
        return []
    place = int(np.argmax(np.diff(frames)))
    is_late = table["frame"].to_numpy() > frames[place]
    track = table["track_id"].to_numpy()
    n_after, n_before = np.unique(track[is_late]).size, np.unique(track[~is_late]).size
    seconds = (frames[place + 1] - frames[place]) / frame_rate
    text = f"no vehicle is recorded for {seconds:.0f} s, between {n_before} vehicles and {n_after} others"
    return [f"{text}: clocks may differ"]


def _ranges(values: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Largest less smallest value of each track; the rows of a track are together."""
    starts, _ = first_and_last_rows(track)
    return np.maximum.reduceat(values, starts) - np.minimum.reduceat(values, starts)


def _states_lanes(table: pd.DataFrame) -> bool:
    """True if any column shows which vehicles are in different lanes."""
    return any(table[name].notna().any() for name in ("lane", "lateral", "leader_id"))


def _next_overlapping_laterally(table: pd.DataFrame) -> np.ndarray:
    """Row of the next vehicle ahead if both overlap laterally, for rows without a lane; ABSENT otherwise.

    In a table without lanes, lateral positions and leaders, all vehicles are assumed to be in one lane.
    """
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    frame, direction = table["frame"].to_numpy(), table["direction"].to_numpy()
    lateral = table["lateral"].to_numpy() if _states_lanes(table) else np.zeros(len(table))
    width = np.nan_to_num(table["width"].to_numpy(), nan=_WIDTH)
    order = np.lexsort((table["position"].to_numpy(), direction, frame))
    here, there = order[:-1], order[1:]
    with np.errstate(invalid="ignore"):  # a vehicle at an unknown lateral position overlaps with none
        same = np.abs(lateral[there] - lateral[here]) < 0.5 * (width[there] + width[here])
    same &= (frame[there] == frame[here]) & (direction[there] == direction[here]) & np.isnan(lane[here])
    ahead = np.full(len(table), ABSENT)
    ahead[here[same]] = there[same]
    return ahead
