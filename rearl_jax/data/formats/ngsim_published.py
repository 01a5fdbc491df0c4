"""Reader of NGSIM trajectory tables as published: feet, one row per vehicle and frame.

NGSIM gives the middle of a vehicle's front, Local_Y along the road and Local_X from the left edge; the canonical table
holds the centre. Vehicle and frame numbers restart in each 15-minute recording, so global time - 100 ms * frame, the
time of frame 0, distinguishes the recordings of a file.

Source: U.S. Department of Transportation, Next Generation Simulation Vehicle Trajectories and Supporting
Data, DOI 10.21949/1504477.
"""

import re
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.lateral_checks import is_below_first
from rearl_jax.data.checks.leaders import without_absent
from rearl_jax.data.checks.losses import Losses, reject, stop_or_count
from rearl_jax.data.checks.typed_table import MAX_LANES, unknown_class
from rearl_jax.data.files.columnar import is_parquet
from rearl_jax.data.files.delimited import read_blank_separated, read_csv, read_header, text_endings
from rearl_jax.data.files.folder import named_files, visible_files
from rearl_jax.data.files.text_layout import first_lines, first_names
from rearl_jax.data.formats.ngsim import ATTRIBUTION, CLASSES, FRAME_RATE, LANES, LICENCE, US101_LENGTH
from rearl_jax.data.formats.ngsim_clock import ARTERIALS, impossible_times, places_of, recordings_of
from rearl_jax.data.formats.published_names import by_plain_name, plain, unit_stated
from rearl_jax.data.problems import DROP_HINT, Finding, bad_recording, require_columns, source_row
from rearl_jax.data.roads.origin import from_its_beginning
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.data.units import SI_FACTOR, to_si

# Canonical name: name in the published tables without case and punctuation, unit, required.
_PUBLISHED = {
    "track_id": ("vehicleid", None, True),
    "frame": ("frameid", None, True),
    "global_time": ("globaltime", "ms", True),
    "lateral": ("localx", "ft", True),
    "front": ("localy", "ft", True),
    "length": ("vlength", "ft", True),
    "width": ("vwidth", "ft", True),
    "vehicle_class": ("vclass", None, True),
    "speed": ("vvel", "ft/s", True),
    "acceleration": ("vacc", "ft/s^2", True),
    "lane": ("laneid", None, True),
    "leader_id": ("preceding", None, False),
    "location": ("location", None, False),
}
_KINDS = {"ms": "s", "ft": "m", "ft/s": "m/s", "ft/s^2": "m/s^2"}
"""Kinds of the units of the columns; the name of a column may state another unit of the kind."""
_TXT_COLUMNS = (
    "Vehicle_ID Frame_ID Total_Frames Global_Time Local_X Local_Y Global_X Global_Y v_Length v_Width v_Class "
    "v_Vel v_Acc Lane_ID Preceding Following Space_Headway Time_Headway"
).split()
# For error messages: the usual spelling of the column a canonical one comes from.
_PUBLISHED_SPELLING = {
    "track_id": "Vehicle_ID",
    "frame": "Frame_ID",
    "x": "Local_Y",
    "y": "Local_X",
    "position": "Local_Y",
    "lateral": "Local_X",
    "lane": "Lane_ID",
    "speed": "v_Vel",
    "acceleration": "v_Acc",
    "length": "v_Length",
    "width": "v_Width",
    "vehicle_class": "v_Class",
    "leader_id": "Preceding",
}
_CODES = ", ".join(f"{code} ({name})" for code, name in CLASSES.items())
_ARTERIAL_FIELDS = 24  # of a line of a .txt of an arterial, which also states zones, sections and movements
_ENDINGS = (*text_endings(".csv"), *text_endings(".txt"))
_SAMPLE_LINES = 5  # lines of a .txt from which it is decided whether it is a table
# A time that is not in ms may have a fraction; its unit is reported as the fault.
_TYPES = {"location": pa.string(), "global_time": pa.float64()}
_KEYS = ("track_id", "frame", "global_time")

find_published = partial(
    named_files,
    endings=_ENDINGS,
    wanted="the folder with the NGSIM trajectory tables, such as trajectories-0750am-0805am.csv or the export of the "
    "data portal",
    usual=".csv or .txt",
)
"""The published tables: .csv with a header, .txt without; FileNotFoundError if there is none."""


class PublishedFile:
    """A published table; its rows stay in memory after the first recording has been read.

    The arterials in the export of all places (Lankershim, Peachtree) are not highways and are left out.

    Attributes:
        path: The file.
        passed_over: Arterials that were left out, known after a call of `recordings`.
    """

    def __init__(self, path: Path, policy: DataConfig) -> None:
        self.path = path
        self.passed_over: tuple[str, ...] = ()
        self._policy = policy

    def recordings(self) -> list[str]:
        """Ids of the highway recordings in the file, such as us101_0750."""
        rows, _ = self._load((*_KEYS, "location"))
        self.passed_over = tuple(place for place in places_of(rows, self.path) if place in ARTERIALS)
        return list(recordings_of(rows, self.path))

    def read(self, recording: str) -> Recording:
        """One recording, checked: centre instead of front, SI instead of feet.

        Raises:
            BadRecordingError: The table or a row breaks the schema, or a row occurs twice.
        """
        rows, broken = self._rows
        chosen = rows.iloc[recordings_of(rows, self.path)[recording]]
        losses = Losses()
        losses.counts.update(broken)
        # Sorted, because copies from the data portal are not.
        chosen = chosen.sort_values(["track_id", "frame"], kind="stable")
        table, info = _converted(recording, chosen.drop(columns="location", errors="ignore"), self.path)
        twice = chosen.duplicated().to_numpy()
        if twice.any():
            finding = Finding("exact_duplicate", "track_id", twice, "the row occurs twice", "remove the copies")
            # A repeated row is not a fault of the vehicle, so drop_track, too, keeps the first of the two rows.
            stop_or_count(chosen, finding, info, self._policy, losses)
            table = table.iloc[np.flatnonzero(~twice)]
        table = reject(table, _no_lane(table, self.path), info, self._policy, losses)
        table = reject(table, unknown_class(table, info, self._policy, _CODES), info, self._policy, losses)
        table, dropped = validate(table, info, self._policy, losses)
        # From the rows that are left, because a bad row must not add lanes or lengthen the road.
        info = replace(info, lane_count={1: _n_lanes(recording, table)}, road_length=_road_length(recording, table))
        return from_its_beginning(Recording(info, table, dropped))

    @cached_property
    def _rows(self) -> tuple[pd.DataFrame, dict[str, int]]:
        return self._load(tuple(_PUBLISHED))

    def _require_table(self, *, is_txt: bool) -> None:
        """Raise BadRecordingError for a file that is something else, such as a readme."""
        required = {name for name, _, needed in _PUBLISHED.values() if needed}
        lines: list[list[str]] = []
        if is_txt:
            lines = [line.split() for line in first_lines(self.path, _SAMPLE_LINES)]
            # Not _are_numbers, because a single value that is not a number is reported with its row and column.
            is_table = any(2 * sum(map(_is_number, line)) > max(len(line), len(_TXT_COLUMNS)) for line in lines)
        else:
            is_table = 2 * len(required & {plain(name) for name in read_header(self.path)}) > len(required)
        if is_txt and is_table and {len(line) for line in lines} == {_ARTERIAL_FIELDS}:
            text = f"the lines have {_ARTERIAL_FIELDS} fields, as those of Lankershim and Peachtree have: no highways"
            raise bad_recording("format-unsupported", text, "move the file out of the folder", self.path)
        if not is_table:
            text = f"{self.path.name} is not a trajectory table of NGSIM"
            raise bad_recording("not-a-table", text, "move it out of the folder", self.path)

    def _load(self, wanted: tuple[str, ...]) -> tuple[pd.DataFrame, dict[str, int]]:
        """The wanted columns of the file in the names of _PUBLISHED, and the counts of lines left out."""
        losses = Losses()
        is_txt = self.path.name.lower().endswith(text_endings(".txt"))
        self._require_table(is_txt=is_txt)
        header = _TXT_COLUMNS if is_txt else read_header(self.path)
        names = by_plain_name(header, {name for name, _, _ in _PUBLISHED.values()}, self.path)
        if "preceeding" in names:
            names["preceding"] = names.pop("preceeding")
        for canonical, (name, _, needed) in _PUBLISHED.items():
            if needed and name not in names:
                require_columns(header, [_PUBLISHED_SPELLING.get(canonical, "Global_Time")], self.path)
        types = {
            names[name]: _TYPES.get(column, pa.float64() if unit else pa.int64())
            for column, (name, unit, _) in ((column, _PUBLISHED[column]) for column in wanted)
            if name in names
        }
        if is_txt:
            table, n_broken = read_blank_separated(self.path, _TXT_COLUMNS, types, self._policy.on_bad)
        else:
            table, n_broken = read_csv(self.path, types, self._policy.on_bad)
        losses.count("broken_line", n_broken)
        rows = table.to_pandas(split_blocks=True, self_destruct=True)
        if rows.empty:
            raise bad_recording("no-rows", "the table has no rows", "remove the file or complete it", self.path)
        renamed = {names[_PUBLISHED[c][0]]: c for c in wanted if _PUBLISHED[c][0] in names}
        rows = rows.reindex(columns=list(renamed)).rename(columns=renamed)
        for name, (source, unit, _) in _PUBLISHED.items():
            if unit and name in rows and (stated := unit_stated(names[source], _KINDS[unit], self.path)):
                rows[name] *= SI_FACTOR[stated] / SI_FACTOR[unit]
        for name in _KEYS:
            missing = rows[name].isna().to_numpy()
            if missing.any() and self._policy.on_bad is BadRows.stop:
                row, column = int(np.argmax(missing)) + 1, names[_PUBLISHED[name][0]]
                remedy = f"complete it{DROP_HINT}"
                raise bad_recording("not-finite", "the value is missing", remedy, self.path, column=column, row=row)
            if missing.any():
                rows = losses.remove(rows, missing, "not_finite")
        impossible = impossible_times(rows, self.path)
        if impossible.any() and not impossible.all() and self._policy.on_bad is not BadRows.stop:
            rows = losses.remove(rows, impossible, "time_impossible")
        return rows, dict(losses.counts)


def recognises(path: Path) -> Path | None:
    """The file or folder if the table, or the first of them, has the columns of the published ones."""
    files = [path] if path.is_file() else visible_files(path, _ENDINGS)
    if not files or is_parquet(files[0]):
        return None
    if files[0].name.lower().endswith(text_endings(".txt")):
        lines = [line.split() for line in first_lines(files[0], _SAMPLE_LINES)]
        is_table = bool(lines) and all(len(line) == len(_TXT_COLUMNS) and _are_numbers(line) for line in lines)
        return path if is_table else None
    required = {name for name, _, needed in _PUBLISHED.values() if needed}
    return path if required <= {plain(name) for name in first_names(files[0])} else None


def _are_numbers(words: list[str]) -> bool:
    return all(map(_is_number, words))


def _is_number(word: str) -> bool:
    return re.fullmatch(r"-?\d+(\.\d*)?", word) is not None


def _converted(recording: str, rows: pd.DataFrame, path: Path) -> tuple[pd.DataFrame, RecordingInfo]:
    """Columns of the schema from rows in feet, and metadata of the recording."""
    place = recording.rpartition("_")[0]
    source = {name: to_si(rows[name].to_numpy(), unit) for name, (_, unit, _) in _PUBLISHED.items() if unit}
    lane = rows["lane"].to_numpy(np.float64, na_value=np.nan)
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: LANES.get(place, MAX_LANES)},
        road_length=1.0,
        source=f"NGSIM {place}",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        notes=("positions from 10 Hz video tracking, raw speeds and accelerations are noisy",),
        file=str(path),
        columns=_PUBLISHED_SPELLING,
    )
    position = source["front"] - 0.5 * source["length"]
    columns = {
        "track_id": rows["track_id"].to_numpy(),
        "frame": rows["frame"].to_numpy(),
        "direction": np.ones(len(rows), dtype=np.int8),
        "x": position,
        "y": source["lateral"],
        "position": position,
        "lateral": source["lateral"],
        "lane": lane - 1,
        "speed": source["speed"],
        "acceleration": source["acceleration"],
        "length": source["length"],
        "width": source["width"],
        "vehicle_class": pd.Categorical(rows["vehicle_class"].replace(CLASSES)),
    }
    if "leader_id" in rows:
        others = {name: columns[name] for name in ("frame", "lane", "position")}
        columns["leader_id"] = without_absent(rows["leader_id"].to_numpy(), track=columns["track_id"], **others)
    return pd.DataFrame(columns, index=rows.index), info


def _no_lane(table: pd.DataFrame, path: Path) -> Finding | None:
    """Finding of rows whose Lane_ID is not a lane.

    Raises:
        BadRecordingError: All lanes are counted from 0.
    """
    lane = table["lane"].to_numpy(np.float64)
    no_lane = (lane < 0) | (lane >= MAX_LANES)
    if not no_lane.any():
        return None
    if (below := is_below_first(lane, table["lateral"].to_numpy())).any():
        text = f"Lane_ID counts from {lane[below].min() + 1:g} at the left"
        remedy, row = "count lanes from 1, as in the published tables", source_row(table, below)
        raise bad_recording("wrong-origin", text, remedy, path, column="Lane_ID", row=row)
    text = f"Lane_ID {lane[np.argmax(no_lane)] + 1:g} is not a lane, they are 1 to {MAX_LANES}"
    return Finding("lane_out_of_range", "lane", no_lane, text, "correct the Lane_ID")


def _n_lanes(recording: str, table: pd.DataFrame) -> int:
    """Number of lanes of the place, or up to the last one that a row states."""
    used = table["lane"].to_numpy(dtype=np.float64, na_value=0.0)
    return LANES.get(recording.rpartition("_")[0], int(used.max()) + 1)


def _road_length(recording: str, table: pd.DataFrame) -> float:
    """Length of the recorded road [m]: the furthest front."""
    if recording.startswith("us101_"):
        return US101_LENGTH
    front = table["position"].to_numpy() + 0.5 * table["length"].to_numpy()
    return max(float(front.max()), 1.0)
