"""Reader of the highway recordings of TGSIM (I-90/I-94, I-294, I-395): metres, one row per vehicle and 0.1 s.

The files give the centre of a vehicle in an image, whose y points down, and a lane number whose order differs between
places. So the road is straightened along the paths of its vehicles, and lanes are ranked from the left by the lateral
positions of their vehicles. Vehicle numbers restart in each run of a file.

Source: Federal Highway Administration, Third Generation Simulation Data (TGSIM), data.transportation.gov; Talebpour,
Mahmassani and Hamdar, report FHWA-JPO-24-133 (2024).
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.frame_rates import frame_rate_of, frames_of, require_distinct_times
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.checks.placeholders import nowhere
from rearl_jax.data.checks.stray_rows import require_own_runs
from rearl_jax.data.checks.typed_table import MAX_MAGNITUDE
from rearl_jax.data.files.delimited import read_csv, read_header, stem_of, text_endings
from rearl_jax.data.files.folder import named_files
from rearl_jax.data.files.text_layout import first_names
from rearl_jax.data.formats.published_names import by_plain_name, plain, unit_stated
from rearl_jax.data.problems import DROP_HINT, Finding, bad_recording, require_columns, without_value
from rearl_jax.data.roads.straightened import Straightened, leave_out, straightened
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.data.units import to_si
from rearl_jax.data.vehicle_rows import follows_row_before

LICENCE = "public domain (U.S. Government work)"
ATTRIBUTION = (
    "Federal Highway Administration (2024), Third Generation Simulation Data (TGSIM), https://data.transportation.gov"
)
AUTOMATED = "automated"
"""Label of tracks: yes for the automated test vehicles."""
# Canonical name: name in the files without case and punctuation, which differ between the portal and its archives.
_COLUMNS = {
    "track_id": "id",
    "time": "time",
    "x": "xlockf",
    "y": "ylockf",
    "lane": "lanekf",
    "speed": "speedkf",
    "acceleration": "accelerationkf",
    "length": "lengthsmoothed",
    "width": "widthsmoothed",
    "vehicle_class": "typemostcommon",
}
_OPTIONAL = {"run": "runindex", "av": "av", "acc": "acc"}
_KINDS = dict.fromkeys(("x", "y", "length", "width"), "m") | {"time": "s", "speed": "m/s", "acceleration": "m/s^2"}
"""SI units of the columns; the name of a column may state another."""
_TYPES = {
    "track_id": pa.int64(),
    "run": pa.int64(),
    "vehicle_class": pa.string(),
    "av": pa.string(),
    "acc": pa.string(),
}
_PLACES = {
    "i294l1": ("i294l1",),
    "i294l2": ("i294l2",),
    "i395": ("i395",),
    "i90_94_moving": ("i9094moving", "i90i94moving"),
    "i90_94_stationary": ("i9094stationary", "i90i94stationary"),
}
# The codes of I-395; the other files write words.
_CLASSES = {"1": "car", "2": "truck", "3": "truck", "4": "car", "small vehicle": "car", "large vehicle": "truck"}
_AUTOMATED_CODE = "4"
_YES = ("yes", "true", "1", "1.0")
_RUN_REMEDY = "complete it, or remove the column if the file holds one run only"

_WANTED = "the folder with the trajectories of TGSIM, such as I294_L1_final.csv"
find_files = partial(named_files, endings=text_endings(".csv"), wanted=_WANTED, usual=".csv")
"""The .csv files in the folder, or the one file that is named; FileNotFoundError if there is none."""


def is_one(path: Path) -> bool:
    """True if the first line has the columns of TGSIM's highways."""
    return set(_COLUMNS.values()) <= {plain(name) for name in first_names(path)}


def runs(path: Path, policy: DataConfig) -> dict[str, int | None]:
    """Recording id, such as tgsim_i294l1_2 -> the run of the file; None if the file does not distinguish runs.

    Raises:
        BadRecordingError: The file is not a trajectory table of TGSIM's highways, or a row does not state its run and
            data.on_bad is stop, or no row states it.
    """
    names = _names(path)
    name = f"tgsim_{_place(path)}"
    if "run" not in names:
        return {name: None}
    kinds = {names["run"]: pa.int64(), names["track_id"]: pa.int64(), names["time"]: pa.float64()}
    rows, _ = read_csv(path, kinds, policy.on_bad)
    if not rows.num_rows:
        raise bad_recording("no-rows", "the table has no rows", "remove the file or complete it", path)
    _without_run(rows, names["run"], path, policy)
    found = sorted(run for run in rows[names["run"]].unique().to_pylist() if run is not None)
    if not found:
        raise bad_recording("no-row-left", "no row states its run", _RUN_REMEDY, path, column=names["run"])
    run, track, time = (rows[names[name]].to_numpy(zero_copy_only=False) for name in ("run", "track_id", "time"))
    require_own_runs(run, track, path, names["run"], time)
    return {f"{name}_{run}": run for run in found}


def read_run(path: Path, recording: str, run: int | None, policy: DataConfig) -> Recording:
    """One run of a file, on a straight road.

    Rows on ramps that leave the road are left out and counted as `off_road`.

    Raises:
        BadRecordingError: A column is missing, or a row breaks the schema.
    """
    names = _names(path)
    losses = Losses()
    rows = _rows(path, names, run, policy, losses)
    info = RecordingInfo(
        id=recording,
        frame_rate=1.0,
        lane_count={1: 1},
        road_length=1.0,
        source="TGSIM",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        labels=(AUTOMATED,),
        file=str(path),
        columns={name: names[name] for name in _COLUMNS}
        | {"position": names["x"], "lateral": names["y"], "frame": names["time"]},
    )
    rows["time"] = rows["time"].where(rows["time"].abs() <= MAX_MAGNITUDE)
    for name in ("track_id", "time"):
        rows = reject(rows, without_value(rows, name), info, policy, losses)
    rows = rows.astype({"track_id": np.int64}).sort_values(["track_id", "time"], kind="stable")
    # Before the road is found, because its length and its axis follow from all places.
    rows = reject(rows, nowhere(rows, "x", "y"), info, policy, losses)
    time, follows = rows["time"].to_numpy(np.float64), follows_row_before(rows["track_id"].to_numpy())
    moved = np.abs(np.diff(rows["x"].to_numpy(np.float64))) + np.abs(np.diff(rows["y"].to_numpy(np.float64)))
    require_distinct_times(np.diff(time)[follows[1:]], moved[follows[1:]], path, names["time"])
    rate = frame_rate_of(np.diff(time)[follows[1:]], path, names["time"])
    frame, of_times = frames_of(time, np.flatnonzero(~follows), rate)
    road = _straight(rows, info)
    notes = ["the road is straightened by the paths of its vehicles", *_lane_notes(road), *of_times]
    info = replace(
        info,
        frame_rate=rate,
        lane_count={side: order.count for side, order in road.lanes.items()},
        road_length=road.road_length,
        notes=tuple(notes),
    )
    table = pd.DataFrame(
        {
            "track_id": rows["track_id"].to_numpy(),
            "frame": frame,
            **{name: road.columns[name].to_numpy() for name in road.columns},
            **{name: rows[name].to_numpy(np.float64) for name in ("speed", "acceleration", "length", "width")},
            "vehicle_class": _classes(pd.Series(rows["vehicle_class"])),
            AUTOMATED: _automated(rows),
        },
        index=rows.index,
    )
    faults = {
        "wrong_direction": (road.wrong_way, "x", "the vehicle drives against all others of its lane"),
        "lane_out_of_range": (road.no_lane & rows["lane"].notna().to_numpy(), "lane", "the lane is none of this road"),
    }
    for name, (marked, column, text) in faults.items():
        here = pd.Series(marked, index=rows.index).reindex(table.index).to_numpy(bool)
        table = reject(table, Finding(name, column, here, text, "correct it"), info, policy, losses)
    table = leave_out(table, pd.Series(road.off_road, index=rows.index), losses)
    return Recording(info, *validate(table, info, policy, losses))


def _names(path: Path) -> dict[str, str]:
    """Canonical name of each column -> its name in the file."""
    header = read_header(path)
    present = by_plain_name(header, {*_COLUMNS.values(), *_OPTIONAL.values()}, path)
    if "speedkfx" in present:
        text, remedy = "these are the crossings of Foggy Bottom, which are not straight roads", "move the file away"
        raise bad_recording("format-unsupported", text, remedy, path, column=present["speedkfx"])
    if not set(_COLUMNS.values()) & set(present) - {"id", "time"}:
        text = f"{path.name} is not a trajectory table of TGSIM"
        raise bad_recording("not-a-table", text, "move it out of the folder", path)
    require_columns(present, _COLUMNS.values(), path)
    return {canonical: present[source] for canonical, source in (_COLUMNS | _OPTIONAL).items() if source in present}


def _place(path: Path) -> str:
    name = plain(stem_of(path))
    return next((place for place, words in _PLACES.items() if any(word in name for word in words)), stem_of(path))


def _rows(path: Path, names: dict[str, str], run: int | None, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """The rows of a run under canonical names; the index holds the row numbers of the file."""
    types = {names[canonical]: _TYPES.get(canonical, pa.float64()) for canonical in names}
    table, n_broken = read_csv(path, types, policy.on_bad)
    losses.count("broken_line", n_broken)
    index = np.arange(table.num_rows)
    if run is not None:
        without_run = _without_run(table, names["run"], path, policy)
        if without_run.any():
            # They are of no recording, so each recording of the file counts them, as it does broken lines.
            tracks = pd.DataFrame({"track_id": table[names["track_id"]].to_numpy()})
            losses.remove(tracks, without_run, "not_finite")
        of_run = pc.call_function("equal", [table[names["run"]], pa.scalar(run)]).fill_null(False)
        index = np.flatnonzero(of_run.to_numpy())
        table = table.filter(of_run)
    if not table.num_rows:
        raise bad_recording("no-rows", "the table has no rows", "remove the file or complete it", path)
    rows = table.to_pandas(split_blocks=True, self_destruct=True).set_axis(index, axis=0)
    rows = rows.rename(columns={source: canonical for canonical, source in names.items()})
    for name, kind in _KINDS.items():
        if unit := unit_stated(names[name], kind, path):
            rows[name] = to_si(rows[name].to_numpy(), unit)
    return rows


def _without_run(table: pa.Table, column: str, path: Path, policy: DataConfig) -> np.ndarray:
    """Mask of the rows that do not state their run; BadRecordingError if there are any and data.on_bad is stop."""
    missing = table[column].is_null().to_numpy()
    if missing.any() and policy.on_bad is BadRows.stop:
        others = int(missing.sum()) - 1
        text = "the row does not state its run" + (f" (and {others} more rows)" if others else "")
        row = int(np.argmax(missing)) + 1
        raise bad_recording("not-finite", text, f"{_RUN_REMEDY}{DROP_HINT}", path, column=column, row=row)
    return missing


def _straight(rows: pd.DataFrame, info: RecordingInfo) -> Straightened:
    """The road on which the vehicles drive; y points down unless the traffic then kept to the left."""
    track, lane = rows["track_id"].to_numpy(), rows["lane"].to_numpy(np.float64)
    same = follows_row_before(track)
    same[1:] &= lane[1:] == lane[:-1]
    x, y = (rows[name].to_numpy(np.float64) for name in ("x", "y"))
    paths = (track, np.cumsum(~same), x, y, lane, info)
    road = straightened(*paths, y_down=True)
    return straightened(*paths, y_down=False) if road.is_mirrored else road


def _lane_notes(road: Straightened) -> list[str]:
    notes = []
    for side, order in sorted(road.lanes.items()):
        numbers = ", ".join(str(number) for number, _ in sorted(order.ranks.items(), key=lambda item: item[1]))
        notes.append(f"direction {side}: lanes from the left are lane_kf {numbers}, by the places of their vehicles")
    if len(road.lanes) < 2:
        notes.append("one carriageway: that y points down is taken from the data description")
    return notes


def _classes(words: pd.Series) -> pd.Series:
    """Classes of the schema; an unknown word stays, and the schema check reports it."""
    plain_words = words.str.casefold().str.replace(r"(?<=\w)[-_ ]+", " ", regex=True).str.strip().str.removesuffix(".0")
    return plain_words.map(_CLASSES).fillna(words).astype(object)


def _automated(rows: pd.DataFrame) -> pd.Series:
    """Label for each row: yes if the file calls the vehicle automated in any of its rows, else no."""
    column = next((name for name in ("av", "acc") if name in rows), None)
    if column is None:
        marked = rows["vehicle_class"].str.removesuffix(".0") == _AUTOMATED_CODE
    else:
        marked = rows[column].str.casefold().str.strip().isin(_YES)
    ever = marked.fillna(False).groupby(rows["track_id"].to_numpy()).transform("any")
    return pd.Series(np.where(ever, "yes", "no"), index=rows.index)
