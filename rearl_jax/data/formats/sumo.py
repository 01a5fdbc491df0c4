"""Reader of SUMO's floating car data, the file of `--fcd-output`, one recording per file.

SUMO states the position of the front bumper and counts lanes from the right, from 0. Vehicle lengths are not part of
the output; they are read from the vehicle types in a route or additional file in the same folder.

Source: SUMO documentation, Simulation/Output/FCDOutput and Vehicle_Type_Parameter_Defaults.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.files.delimited import stem_of
from rearl_jax.data.files.folder import recordings_missing, visible_files
from rearl_jax.data.formats.simulated import Simulation, info_of, recording_of
from rearl_jax.data.formats.sumo_fcd import TABLES, read_fcd
from rearl_jax.data.formats.sumo_network import CLASS, Surroundings, VehicleType, sorted_files, surroundings_of
from rearl_jax.data.formats.sumo_xml import XML
from rearl_jax.data.records import SPEED_LIMITS, Recording
from rearl_jax.data.roads.stretch import metres
from rearl_jax.data.vehicle_classes import CLASSES, class_of
from rearl_jax.data.vehicle_rows import follows_row_before

LABELS = ("vehicle", "type")
"""Labels of tracks: SUMO's id of the vehicle and of its type."""

# Columns of the file by canonical name, for messages.
_SPELLING = {
    "track_id": "id",
    "frame": "time",
    "front": "pos",
    "position": "pos",
    "lateral": "posLat",
    "link": "lane",
    "leader_id": "leaderID",
    "vehicle_class": "type",
    "length": "type",
}

# More than a metre is in degrees of longitude up to a latitude of 85 degrees.
_DEGREES_PER_METRE = 1e-4


def find_fcd(root: Path) -> list[Path]:
    """The files of floating car data in the folder, or the one file that is named.

    Raises:
        MissingInputError: There is none.
        BadRecordingError: An XML file is none of SUMO's.
    """
    found = [root] if root.is_file() else sorted([*sorted_files(root)[0], *visible_files(root, TABLES)])
    if not found:
        wanted = "a file that `sumo --fcd-output` writes (.xml, .csv or .parquet), or a folder of them"
        raise recordings_missing("no floating car data", root, wanted, (*XML, *TABLES))
    return found


def recording_id(path: Path) -> str:
    """Name of the recording of a file, such as sumo_fcd."""
    return f"sumo_{stem_of(path)}"


def files_beside(root: Path) -> list[Path]:
    """The networks and the route and additional files in the same folder."""
    return sorted_files(root if root.is_dir() else root.parent)[1]


def read_recording(path: Path, beside: list[Path], policy: DataConfig) -> Recording:
    """The main road of one file; `beside` are the files of networks and of vehicle types in the same folder.

    Vehicles of a type that none of these files describes get `default_length`.

    Raises:
        BadRecordingError: The file is damaged, lacks a column, or a row breaks the schema.
    """
    losses = Losses()
    around = surroundings_of(beside)
    raw, layout = read_fcd(path, policy.on_bad)
    losses.count("broken_line", layout.n_broken)
    raw, notes = _with_metres(raw)
    link, lane = _edges_and_lanes(pd.Series(raw["lane"]))
    angle = raw["angle"].to_numpy()
    heading = np.deg2rad(np.where(np.isfinite(angle), angle, np.nan))  # clockwise from north
    rows = pd.DataFrame(
        {
            "time": raw["time"],
            "track_id": raw["id"].cat.codes.to_numpy().astype(np.int64),
            "link": link,
            "lane": lane,
            "front": raw["pos"],
            "speed": raw["speed"],
            "x": raw["x"],
            "y": raw["y"],
            "hx": np.sin(heading),
            "hy": np.cos(heading),
            "vehicle": raw["id"],
            "type": raw["type"],
        },
        index=raw.index,
    )
    rows.loc[raw["id"].isna().to_numpy(), "track_id"] = np.nan
    if "acceleration" in raw:
        rows["acceleration"] = raw["acceleration"]
    if "posLat" in raw and around.lane_width is not None:
        rows["aside"] = -raw["posLat"].to_numpy() / around.lane_width  # posLat is positive to the left
    if "leaderID" in raw:
        rows["leader_id"] = _numbers_of(pd.Series(raw["leaderID"]), raw["id"].cat.categories)
    del raw
    rows, of_types = _with_types(rows, around, policy)
    notes += of_types
    if layout.n_broken and layout.is_xml:
        notes.append("the file ends within an element: what came after is not known")
    low, high = SPEED_LIMITS
    sources = {name: name for name in layout.names} | _SPELLING
    columns = {canonical: layout.names.get(source, source) for canonical, source in sources.items()}
    info = info_of(path, recording_id(path), "SUMO", LABELS, notes, columns)
    limits = {edge: limit for edge, limit in around.limits.items() if low <= limit <= high}
    return recording_of(rows, Simulation(info, around.lanes, limits, around.lane_width), policy, losses)


def _with_metres(raw: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The rows with x, y in metres, also where they are longitude and latitude; and a note on that."""
    longitude, latitude = raw["x"].to_numpy(np.float64), raw["y"].to_numpy(np.float64)
    if not (np.nanmax(np.abs(longitude), initial=0.0) <= 180.0 and np.nanmax(np.abs(latitude), initial=0.0) <= 90.0):
        return raw, []
    order = np.lexsort((raw["time"].to_numpy(), raw["id"].cat.codes.to_numpy()))
    track, lane = (raw[name].cat.codes.to_numpy()[order] for name in ("id", "lane"))
    same = follows_row_before(track)[1:] & (np.diff(lane) == 0)
    moved = np.hypot(np.diff(longitude[order]), np.diff(latitude[order]))[same]
    with np.errstate(invalid="ignore", over="ignore"):  # the checks find values out of range
        driven = np.diff(raw["pos"].to_numpy(np.float64)[order])[same]
    ratios = moved[driven > 0.0] / driven[driven > 0.0]
    ratios = ratios[np.isfinite(ratios)]
    if not ratios.size or np.median(ratios) > _DEGREES_PER_METRE:
        return raw, []
    east, north = metres(latitude, longitude, (float(np.nanmedian(latitude)), float(np.nanmedian(longitude))))
    return raw.assign(x=east, y=north), ["x and y are longitude and latitude in the file"]


def _numbers_of(vehicles: pd.Series, ids: pd.Index) -> np.ndarray:
    """Track of each vehicle by its id; NaN for none, and for one that has no rows."""
    track = np.append(ids.get_indexer(vehicles.cat.categories), -1)[vehicles.cat.codes.to_numpy()]
    return np.where(track < 0, np.nan, track)


def _edges_and_lanes(lanes: pd.Series) -> tuple[pd.Categorical, np.ndarray]:
    """Edge and lane, counted from the right, from ids such as `exit_1`; both are unknown for other ids."""
    ids = [str(name) for name in lanes.cat.categories]
    parts = [name.rpartition("_") for name in ids]
    sound = [bool(edge) and number.isascii() and number.isdigit() for edge, _, number in parts]
    edges = sorted({edge for (edge, _, _), is_sound in zip(parts, sound, strict=True) if is_sound})
    code_of = {edge: code for code, edge in enumerate(edges)}
    of_id = np.array([code_of[e] if ok else -1 for (e, _, _), ok in zip(parts, sound, strict=True)] + [-1], np.int64)
    number = np.array([float(n) if ok else np.nan for (_, _, n), ok in zip(parts, sound, strict=True)] + [np.nan])
    codes = lanes.cat.codes.to_numpy()  # -1, for an unknown one, is the last
    return pd.Categorical.from_codes(of_id[codes], edges), number[codes]


def _with_types(rows: pd.DataFrame, around: Surroundings, policy: DataConfig) -> tuple[pd.DataFrame, list[str]]:
    """The rows with length, width and class of their types, and notes on what is assumed."""
    spelt = [str(name) for name in rows["type"].cat.categories]
    # A type that was changed for one vehicle is written as TYPE@VEHICLE.
    bases = [name if name in around.types else name.partition("@")[0] for name in spelt]
    names = list(dict.fromkeys(bases))
    if names != spelt:
        numbers = np.array([*(names.index(base) for base in bases), -1])[rows["type"].cat.codes.to_numpy()]
        rows = rows.assign(type=pd.Categorical.from_codes(numbers, names))
    types = [around.types.get(name, VehicleType(name, None, None)) for name in names]
    classes = [_class_of(name, around.types) for name in names]
    unknown = [name for name, kind in zip(names, types, strict=True) if kind.length is None]
    lengths = [policy.default_length if kind.length is None else kind.length for kind in types]
    widths = [np.nan if kind.width is None else kind.width for kind in types]
    codes = rows["type"].cat.codes.to_numpy()
    rows = rows.assign(
        length=np.array([*lengths, np.nan])[codes],
        width=np.array([*widths, np.nan])[codes],
        vehicle_class=np.array([*classes, None], object)[codes],
    )
    notes = []
    if names != spelt:
        notes.append("types that were changed for single vehicles, TYPE@VEHICLE, are read as TYPE")
    if unknown:
        text = f"no route or additional file states the length of the types {', '.join(unknown[:5])}: "
        notes.append(f"{text}{policy.default_length:g} m assumed, and the class by the name of the type")
    return rows, notes


def _class_of(name: str, types: dict[str, VehicleType]) -> str:
    if name in types:
        return CLASS.get(types[name].vehicle_class, "other")
    word = class_of(name)
    return word if word in CLASSES else "other"
