"""Frame rate, lanes, road length and road origin of a recording, derived from its rows."""

from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.data.checks import clock
from rearl_jax.data.checks.placeholders import is_far, is_placeholder
from rearl_jax.data.checks.typed_table import MAX_LANES, RANGES
from rearl_jax.data.checks.unit_checks import MIN_SPEED, UNIT_RATIOS
from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.roads.origin import is_distant
from rearl_jax.data.units import SI_FACTOR, to_si

DERIVED = "frame rate, lanes and road length derived from the rows"
ENTRY_MARGIN = 20.0
"""Largest distance [m] of a vehicle before the upstream edge; such a vehicle has not yet entered the view."""
PROJECTED_COORDINATE = 1e5
"""Ground coordinate [m] above which coordinates are those of a map projection such as UTM."""
MOTION_ERROR = 0.01
"""Relative error [-] of a frame rate that follows from the motion of vehicles; usual rates are 4 % apart or more."""
SPEED_BIAS = 0.025
"""Relative difference [-] between motion and times that errors of speeds explain."""
MIN_MOVED = 20.0
"""Distance [m] that a vehicle must have moved to tell the frame rate."""
_COLUMNS = ("track_id", "frame", "time", "direction", "x", "y", "position", "length", "lane", "speed")


def info_of_rows(
    recording: str, rows: pd.DataFrame, file: str, source: str, *, is_in_seconds: bool = False
) -> tuple[pd.DataFrame, RecordingInfo]:
    """The rows on a road that begins at 0, with times in s, and frame rate, lanes and road length of the recording.

    The unit of times that are not known to be in s is derived from the rows; `source` is the name of the data set.

    Raises:
        BadRecordingError: There is no column `time`, or its unit or the frame rate cannot be determined.
    """
    if "time" not in rows:
        text = "without metadata of the recording the frame rate is derived from the column time"
        remedy = "add the column time [s], or state the rate of the frames, such as 'data.units={frame: 25/s}'"
        raise bad_recording("frame-rate-unknown", text, remedy, file, column="time")
    values = {name: numbers_of(pd.Series(rows[name])) for name in _COLUMNS if name in rows}
    notes = [DERIVED]
    rate, unit, is_by_motion = _frame_rate(values, file, is_in_seconds)
    if unit != "s":
        values["time"] = to_si(values["time"], unit)
        rows = rows.assign(time=values["time"])
        notes.append(f"time taken to be in {unit}, which makes {rate:g} frames per second")
    if is_by_motion:
        notes.append(f"times are too coarse to tell the frame rate: {rate:g} 1/s by the motion of the vehicles")
    if clock.resolution(values["time"]) > 1.0 / rate:
        notes.append(f"times are rounded to {clock.resolution(values['time']):g} s: computed from the frames")
        rows = rows.drop(columns="time")
    lanes = {}
    for direction in (1, 2):
        here = values["direction"] == direction
        if here.any():
            lane = values["lane"][here] if "lane" in values else np.full(1, np.nan)
            lane = lane[(lane >= 0) & (lane < MAX_LANES)]
            lanes[direction] = int(np.max(lane, initial=0.0)) + 1
            if lane.size and lane.min() > 0:
                notes.append(f"direction {direction}: no vehicle uses the lanes left of lane {lane.min():g}")
    rows, length, moved = _from_upstream_edge(rows, values)
    info = RecordingInfo(
        id=recording,
        frame_rate=rate,
        lane_count=lanes or {1: 1},
        road_length=length,
        source=source,
        licence="not stated in the file",
        attribution="not stated in the file",
        notes=(*notes, *moved),
        file=file,
    )
    return rows, info


def with_lanes_left(recording: Recording) -> Recording:
    """The recording with the lanes of the rows that are left, if rows were dropped: a bad row must not add lanes."""
    if not recording.dropped:
        return recording
    direction = recording.table["direction"].to_numpy()
    lane = recording.table["lane"].to_numpy(dtype=np.float64, na_value=0.0)
    lanes = {int(side): int(lane[direction == side].max()) + 1 for side in np.unique(direction)}
    return replace(recording, info=replace(recording.info, lane_count=lanes))


def _frame_rate(values: dict[str, np.ndarray], file: str, is_in_seconds: bool) -> tuple[float, str, bool]:
    """Frames per second, the unit of the times, and whether the rate follows from the motion of the vehicles."""
    found = clock.period_of(values["track_id"], values["frame"], values["time"])
    if found is None:
        text = "the frame rate cannot be determined: no track has two rows with rising frame and time"
        remedy, column = "correct frame and time [s], or state the frame rate in the metadata", "time"
        for name in ("track_id", "frame"):
            if not np.isfinite(values[name]).any():
                text, remedy, column = "the column is empty", "complete it", name
        back = _largest_step_back(values)
        if back > 0.0:
            text = f"the times of all vehicles go back, by up to {back:g}, while frames rise"
            remedy = "local times repeat an hour at the end of summer time: write them in UTC or with their offset"
        raise bad_recording("frame-rate-unknown", text, remedy, file, column=column)
    period, uncertainty = found
    scale = _steps_over_speed(values, period)
    unit = clock.unit_of(period, scale, () if is_in_seconds else UNIT_RATIOS.values())
    if is_in_seconds:
        is_usual = clock.PLAUSIBLE_RATES[0] <= 1.0 / period <= clock.PLAUSIBLE_RATES[1]
        if not is_usual and unit not in (None, "s"):
            text = f"by the stated unit rows of a vehicle are {period:g} s apart: the times look like {unit}"
            raise bad_recording("wrong-units", text, f"state 'data.units={{time: {unit}}}'", file, column="time")
        unit = "s"
    if unit is None:
        text = f"the unit of time cannot be determined: it grows by {10.0 * period:g} per 10 frames"
        hint = "'data.units={time: ms}'"
        if scale is not None and scale > 0.0:
            rate = clock.rate_of(period * scale, 0.02 * period * scale)
            text += f", and the motion of the vehicles suggests that {rate * period:g} units are one second"
            hint = f"'data.units={{time: {rate * period:g}/s}}'"
        remedy = f"state its unit, such as {hint}, or 'data.units={{time: s}}'"
        raise bad_recording("time-unit-unknown", text, remedy, file, column="time")
    period, uncertainty = period * SI_FACTOR[unit], uncertainty * SI_FACTOR[unit]
    rate = clock.rate_of(period, uncertainty)
    moved = _period_by_motion(values) if uncertainty > MOTION_ERROR * period else None
    if moved is None or abs(moved * rate - 1.0) <= SPEED_BIAS:
        return rate, unit, False
    other = min(clock.STANDARD_RATES, key=lambda usual: abs(1.0 / usual - moved))
    is_possible = abs(1.0 / other - period) <= uncertainty and abs(moved * other - 1.0) <= MOTION_ERROR
    return (other, unit, True) if is_possible else (rate, unit, False)


def _along_tracks(values: dict[str, np.ndarray], *names: str) -> list[np.ndarray]:
    """The named columns, ordered by track and frame."""
    order = np.lexsort((values["frame"], values["track_id"]))
    return [values[name][order] for name in names]


def _largest_step_back(values: dict[str, np.ndarray]) -> float:
    """Largest step back of a vehicle's time from one frame to the next."""
    track, time = _along_tracks(values, "track_id", "time")
    return -float(np.nanmin(np.where(np.diff(track) == 0, np.diff(time), 0.0), initial=0.0))


def _steps_over_speed(values: dict[str, np.ndarray], period: float) -> float | None:
    """Median ratio of steps of position to speed x time; None if no vehicle moves."""
    track, frame, position, speed = _along_tracks(values, "track_id", "frame", "position", "speed")
    with np.errstate(invalid="ignore"):  # comparisons with NaN are false, so such rows are not used
        step = np.abs(np.diff(position))
        expected = 0.5 * (speed[1:] + speed[:-1]) * np.diff(frame) * period
        used = (np.diff(track) == 0) & (np.diff(frame) > 0) & (speed[1:] > MIN_SPEED) & (step > 0.0) & (expected > 0.0)
    return float(np.median(step[used] / expected[used])) if used.any() else None


def _period_by_motion(values: dict[str, np.ndarray]) -> float | None:
    """Time between two frames [s] in which vehicles move as far as they do; None if none moves far enough."""
    track, frame, position, speed = _along_tracks(values, "track_id", "frame", "position", "speed")
    step, driven = np.diff(position), 0.5 * (speed[1:] + speed[:-1]) * np.diff(frame)
    used = (np.diff(track) == 0) & np.isfinite(step) & np.isfinite(driven)
    vehicle = np.unique(track[1:][used], return_inverse=True)[1]
    moved, driven = np.abs(np.bincount(vehicle, step[used])), np.bincount(vehicle, driven[used])
    far = (moved >= MIN_MOVED) & (driven > 0.0)
    return float(np.median(moved[far] / driven[far])) if far.any() else None


def _from_upstream_edge(
    rows: pd.DataFrame, values: dict[str, np.ndarray]
) -> tuple[pd.DataFrame, float, tuple[str, ...]]:
    """The rows with positions from the upstream edge of the recorded stretch, the length of the road, and notes.

    Positions that already begin near 0 stay as they are.
    """
    notes: tuple[str, ...] = ()
    position, length = values["position"].copy(), values["length"]
    least, most = RANGES["length"]
    half = np.where((length >= least) & (length <= most), 0.5 * length, 0.0)
    road = 0.0
    for direction in (1, 2):
        here = np.flatnonzero((values["direction"] == direction) & _is_place(position))
        if not here.size:
            continue
        here = here[_near_others(position[here])]
        first, last = float(np.min((position - half)[here])), float(np.max((position + half)[here]))
        if first < -ENTRY_MARGIN or last <= 0.0 or is_distant(first, last):
            on_carriageway = values["direction"] == direction
            position[on_carriageway] -= first
            last -= first
            notes += (f"direction {direction}: {first:.1f} m subtracted from the positions, so that they begin at 0",)
        road = max(road, last)
    if notes:
        rows = rows.assign(position=position)
    for name in ("x", "y"):
        known = values[name][_is_place(values[name])]
        if known.size and np.min(np.abs(known)) > PROJECTED_COORDINATE:
            least = float(np.floor(np.min(known)))
            rows = rows.assign(**{name: values[name] - least})
            notes += (f"{least:.0f} m subtracted from {name}",)
    return rows, road, notes


def _near_others(position: np.ndarray) -> np.ndarray:
    """Mask of the positions near the middle 98 % of all that are not impossible; those of damaged rows are far away."""
    sound = ~is_far(position)
    low, high = np.quantile(position[sound], (0.01, 0.99))
    reach = high - low + ENTRY_MARGIN
    return sound & (position >= low - reach) & (position <= high + reach)


def _is_place(values: np.ndarray) -> np.ndarray:
    return np.isfinite(values) & ~(is_placeholder(values) & (values != -1.0))
