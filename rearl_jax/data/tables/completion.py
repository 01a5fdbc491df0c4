"""Conversion of the rows of a foreign table to canonical ones: units, numbers for ids, and columns derived from others.

Notes of the recording state everything that is assumed or derived.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks import clock
from rearl_jax.data.checks.lateral_checks import EDGE_TOLERANCE, USUAL_WIDTH, lane_middles
from rearl_jax.data.checks.placeholders import is_placeholder
from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording, source_row
from rearl_jax.data.roads.origin import DISTANT_ORIGIN
from rearl_jax.data.roads.ring import unrolled
from rearl_jax.data.tables.moments import seconds_of
from rearl_jax.data.tables.spelling import ENDS, Spelling, require_needed_columns
from rearl_jax.data.tables.track_names import LABEL, numbered

_MAX_STEP = 1e6  # frames; beyond it the number is not a frame
_NAME_FRAMES = "name the column of frames: 'data.columns={frame: NAME}'"


def completed(
    rows: pd.DataFrame, spelling: Spelling, data: DataConfig, file: str
) -> tuple[pd.DataFrame, tuple[str, ...], tuple[str, ...]]:
    """The rows in SI units with every required column, notes on the changes, and labels of tracks that were added.

    Times whose unit is not stated stay as they are. The given rows are already under canonical names; their index holds
    the row numbers of the source. Of the keys of data, `default_length` and `ring` are used.

    Raises:
        BadRecordingError: A column is missing that does not follow from others, or an id or a time cannot be read.
    """
    require_needed_columns(list(rows.columns), file)
    notes: list[str] = []
    if "time" in rows and not pd.api.types.is_numeric_dtype(rows["time"]):
        column = spelling.columns.get("time", "time")
        seconds, form = seconds_of(pd.Series(rows["time"]), file, column)
        rows = rows.assign(time=seconds)
        if form is not None:
            notes.append(f"times are dates and times of day ({form}), taken as seconds")
    rows, of_ids = numbered(rows, file, spelling.columns)
    rows = _in_si(rows, spelling, file)
    rows, of_frames = _with_frames(rows, spelling, file)
    rows, of_centres = _with_centres(rows, data)
    if spelling.factors.get("lateral", 1.0) < 0.0 or _are_far(rows):
        rows, of_edge = _from_left_edge(rows)
        of_centres += of_edge
    if data.ring is not None:
        rows, of_ring = unrolled(rows, data.ring, file)
        of_centres += of_ring
    rows, of_others = _with_defaults(rows, data)
    return rows, (*notes, *of_ids, *of_frames, *of_centres, *of_others), (LABEL,) if of_ids else ()


def _in_si(rows: pd.DataFrame, spelling: Spelling, file: str) -> pd.DataFrame:
    """The rows, with columns of stated units in SI units; times follow from frames whose rate is stated."""
    for name, factor in spelling.factors.items():
        values = pd.Series(pd.to_numeric(rows[name], errors="coerce"), index=rows.index)
        bad = (values.isna() & rows[name].notna()).to_numpy()
        if bad.any():
            text, column = f"{rows[name].iloc[int(np.argmax(bad))]!r} is not a number", spelling.columns[name]
            row = source_row(rows, bad)
            raise bad_recording("not-a-number", text, "write a number", file, column=column, row=row)
        if name == "frame":
            rows = rows.assign(time=values.astype(np.float64) / factor)
        elif name == "lane":
            rows = rows.assign(lane=factor * (values.astype(np.float64) - (spelling.leftmost or 0)))
        elif factor != 1.0:
            rows = rows.assign(**{name: values.astype(np.float64) * factor})
    return rows


def _with_frames(rows: pd.DataFrame, spelling: Spelling, file: str) -> tuple[pd.DataFrame, list[str]]:
    """The rows with frames that rise by 1, from the times where there are none."""
    track = numbers_of(pd.Series(rows["track_id"]))
    if "frame" not in rows:
        if "time" not in rows:
            text = "the table has neither frames nor times"
            remedy = "name the column of times: 'data.columns={time: NAME}'"
            raise bad_recording("column-missing", text, remedy, file, column="frame")
        time, column = numbers_of(pd.Series(rows["time"])), spelling.columns.get("time", "time")
        if not pd.Series(track[np.isfinite(track) & np.isfinite(time)]).duplicated().any():
            text = "no vehicle has two rows with its id and a time"
            column = column if np.isfinite(track).any() else spelling.columns["track_id"]
            raise bad_recording("frames-unknown", text, "complete the rows", file, column=column)
        if _share_times(rows, track, time):
            text = (
                "rows of one vehicle at different positions have the same time: times are too coarse, or ids are shared"
            )
            remedy = f"write times to the hundredth of a second, or {_NAME_FRAMES}"
            raise bad_recording("times-too-coarse", text, remedy, file, column=column)
        found = clock.frames_of(track, time)
        if found is None:
            text = "the times of a vehicle do not rise by multiples of one step, so frames cannot be derived from them"
            remedy = f"resample the recording to a fixed rate, or {_NAME_FRAMES}"
            raise bad_recording("frames-unknown", text, remedy, file, column=column)
        return rows.assign(frame=found[0]), ["frames counted from the times"]
    frame = numbers_of(pd.Series(rows["frame"]))
    known = np.isfinite(track) & np.isfinite(frame)
    order = np.flatnonzero(known)[np.lexsort((frame[known], track[known]))]
    steps = np.diff(frame[order])[np.diff(track[order]) == 0]
    if not steps.size or (steps != np.rint(steps)).any() or steps.max() > _MAX_STEP:
        return rows, []
    every = int(np.gcd.reduce(steps.astype(np.int64)))
    first = float(frame[order[0]])
    if every < 2 or ((frame[known] - first) % every).any():
        return rows, []
    return rows.assign(frame=(frame - np.min(frame[known])) / every), [
        f"only every {every}th frame is recorded; frames were renumbered"
    ]


def _share_times(rows: pd.DataFrame, track: np.ndarray, time: np.ndarray) -> bool:
    """True if many rows have the time of another row of their vehicle, but another position."""
    place = next(name for name in ("position", *ENDS) if name in rows)
    table = pd.DataFrame({"track": track, "time": time, "place": numbers_of(pd.Series(rows[place]))}).dropna()
    table = table.drop_duplicates()
    return bool(table.duplicated(["track", "time"]).sum() > clock.MAX_IRREGULAR_SHARE * len(table))


def _with_centres(rows: pd.DataFrame, data: DataConfig) -> tuple[pd.DataFrame, list[str]]:
    """The rows with the positions of centres where the table has those of the fronts or rears of vehicles."""
    end = next((name for name in ENDS if name in rows), None)
    if end is None:
        return rows, []
    length = rows["length"] if "length" in rows else data.default_length
    position = numbers_of(pd.Series(rows[end])) + ENDS[end] * np.asarray(length, dtype=np.float64)
    return rows.drop(columns=end).assign(position=position), [f"positions of the {end}, moved to the centre by lengths"]


def _are_far(rows: pd.DataFrame) -> bool:
    """True if lateral positions count from an origin far from the road, as coordinates of a map do."""
    lateral = numbers_of(pd.Series(rows["lateral"])) if "lateral" in rows else np.empty(0)
    lateral = np.abs(lateral[np.isfinite(lateral) & ~is_placeholder(lateral)])
    return bool(lateral.size and lateral.min() > DISTANT_ORIGIN)


def _from_left_edge(rows: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The rows, with lateral positions moved so that they count from the left edge, which lanes determine."""
    lateral = numbers_of(pd.Series(rows["lateral"]))
    lane = numbers_of(pd.Series(rows["lane"])) if "lane" in rows else np.full(len(rows), np.nan)
    lanes, middle = lane_middles(lane, lateral)
    width = float(np.median(np.diff(middle) / np.diff(lanes))) if lanes.size > 1 else USUAL_WIDTH
    if lanes.size:
        edge = float(np.median(middle - width * (lanes + 0.5)))
    else:
        edge = float(np.nanquantile(lateral, 0.01)) - 0.5 * USUAL_WIDTH if np.isfinite(lateral).any() else 0.0
    if abs(edge) <= EDGE_TOLERANCE:
        return rows, []
    return rows.assign(lateral=lateral - edge), [f"{edge:.1f} m subtracted from the lateral positions"]


def _with_defaults(rows: pd.DataFrame, data: DataConfig) -> tuple[pd.DataFrame, list[str]]:
    """The rows with the columns that a table of one straight road may leave out."""
    notes = []
    lateral = rows["lateral"] if "lateral" in rows else 0.0
    fillings: Mapping[str, tuple[object, str]] = {
        "direction": (1, "one direction of travel"),
        "x": (rows["position"], "x is the position along the road"),
        "y": (lateral, "y is the lateral position" if "lateral" in rows else "y is 0"),
        "length": (data.default_length, f"every vehicle is {data.default_length:g} m long"),
        "vehicle_class": ("car", "every vehicle is a car"),
    }
    for name, (values, meaning) in fillings.items():
        if name not in rows:
            rows = rows.assign(**{name: values})
            notes.append(meaning)
    return rows, [f"not in the table, assumed: {', '.join(notes)}"] if notes else []
