"""Reader of pNEUMA: vehicles in a city, one vehicle per row.

A row begins with track_id, type, traveled_d and avg_speed; then lat, lon [deg], speed [km/h], lon_acc, lat_acc [m/s^2]
and time [s] repeat for every 0.04 s. Rows are read one by one; only the parts on the straight stretch that the user
names are kept. The source states neither lanes nor lengths of vehicles.

Source: Barmpounakis and Geroliminis, On the new era of urban traffic monitoring with massive drone data: The pNEUMA
large-scale field experiment, Transportation Research Part C 111 (2020) 50-71; open-traffic.epfl.ch.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.frame_rates import frame_rate_of, frames_of
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.checks.typed_table import MAX_MAGNITUDE
from rearl_jax.data.files.content import in_utf8
from rearl_jax.data.files.delimited import read_header, stem_of, text_endings
from rearl_jax.data.files.folder import named_files
from rearl_jax.data.files.text_layout import Layout, first_names, layout_of
from rearl_jax.data.problems import DROP_HINT, BadRecordingError, bad_recording, require_columns
from rearl_jax.data.roads.stretch import Stretch, stretch_of
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.data.units import to_si

LICENCE = "stated at open-traffic.epfl.ch, free for research with attribution"
ATTRIBUTION = "Barmpounakis and Geroliminis (2020), pNEUMA, Transportation Research Part C 111; open-traffic.epfl.ch"
VEHICLE_COLUMNS = ("track_id", "type", "traveled_d", "avg_speed")
REPEATED_COLUMNS = ("lat", "lon", "speed", "lon_acc", "lat_acc", "time")
# Type -> class and typical length [m], which the source does not state; None for data.default_length.
_TYPES: dict[str, tuple[str, float | None]] = {
    "Car": ("car", None),
    "Taxi": ("car", None),
    "Motorcycle": ("motorcycle", 2.2),
    "Medium Vehicle": ("truck", 6.0),
    "Heavy Vehicle": ("truck", 10.0),
    "Bus": ("truck", 12.0),
}
# Columns of the file by canonical name, for messages.
_SPELLING = {
    "track_id": "track_id",
    "frame": "time",
    "x": "lat",
    "position": "lat",
    "y": "lon",
    "lateral": "lon",
    "acceleration": "lon_acc",
    "vehicle_class": "type",
}
_EXCURSION_ROWS = 25  # rows, 1 s
_MIN_MOVED = 5.0  # m; the direction of a vehicle that moves less is unknown

_WANTED = "the folder with the files of pNEUMA, such as 20181024_d1_0830_0900.csv"
find_files = partial(named_files, endings=text_endings(".csv"), wanted=_WANTED, usual=".csv")
"""The .csv files in the folder, or the one file that is named; FileNotFoundError if there is none."""


@dataclass(frozen=True)
class _Vehicle:
    """A row of the file: track_id, type as in _TYPES, and a row per time step, in the columns of REPEATED_COLUMNS."""

    number: int
    kind: str
    values: np.ndarray


def is_one(path: Path) -> bool:
    """True if the first line names the columns of pNEUMA."""
    return tuple(name for name in first_names(path) if name) == (*VEHICLE_COLUMNS, *REPEATED_COLUMNS)


def recording_id(path: Path) -> str:
    """Id of the recording, such as pneuma_20181024_d1_0830_0900."""
    return f"pneuma_{stem_of(path)}"


def read_recording(path: Path, policy: DataConfig) -> Recording:
    """The vehicles that drive along the stretch `data.stretch` in its direction.

    Left out and counted: time steps beside the stretch (`outside_stretch`), of vehicles that cross it (`crossing`) and
    of vehicles that drive in the opposite direction (`oncoming`).

    Raises:
        InvalidInputError: data.stretch names no stretch.
        BadRecordingError: The file has another layout, no vehicle passes, or a row breaks the schema.
    """
    stretch = stretch_of(policy.stretch)
    losses = Losses()
    parts, steps = [], []
    for row, vehicle in _vehicles(path, policy.on_bad, losses):
        steps.append(float(np.median(np.diff(vehicle.values[:, -1]))) if len(vehicle.values) > 1 else np.nan)
        parts += _on_stretch(row, vehicle, stretch, losses)
    if not steps:
        raise bad_recording("no-rows", "the file has no vehicle", "remove the file or complete it", path)
    frame_rate = frame_rate_of(np.array(steps), path, "time")
    if not parts:
        text = "no vehicle drives along data.stretch"
        raise bad_recording("no-rows", text, "name a stretch within the area of the file", path)
    table, notes = _table(parts, stretch, frame_rate, policy.default_length)
    info = RecordingInfo(
        id=recording_id(path),
        frame_rate=frame_rate,
        lane_count={1: stretch.n_lanes},
        road_length=stretch.length,
        source="pNEUMA",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        notes=(
            "streets of Athens, with traffic lights: only what drives from "
            + " to ".join(f"{latitude:.6f}, {longitude:.6f}" for latitude, longitude in (stretch.begin, stretch.end)),
            f"lanes are {stretch.n_lanes} equal parts of {stretch.width:g} m, the source has none",
            "the source has no lengths: usual ones of each type are assumed",
            *notes,
        ),
        file=str(path),
        columns=_SPELLING,
    )
    return Recording(info, *validate(table, info, policy, losses))


def _vehicles(path: Path, on_bad: BadRows, losses: Losses) -> Iterator[tuple[int, _Vehicle]]:
    """Row number, from 0, and vehicle of each row of the file."""
    header = read_header(path)
    if not {*VEHICLE_COLUMNS, *REPEATED_COLUMNS} & set(header):
        text = f"{path.name} is not a file of pNEUMA: its columns are {', '.join(header[:8])}"
        raise bad_recording("not-a-table", text, "move it out of the folder", path)
    require_columns(header, (*VEHICLE_COLUMNS, *REPEATED_COLUMNS), path)
    if tuple(name for name in header if name) != (*VEHICLE_COLUMNS, *REPEATED_COLUMNS):
        text = f"the columns are {', '.join(header[:12])}"
        remedy = f"give {', '.join((*VEHICLE_COLUMNS, *REPEATED_COLUMNS))}, the last six repeated"
        raise bad_recording("columns-unordered", text, remedy, path)
    layout = layout_of(path)
    with in_utf8(path) as file:
        lines = islice(file, layout.header_lines, None)
        for row, line in enumerate(line for line in lines if line.strip()):
            try:
                yield row, _vehicle(line, path, row, layout)
            except BadRecordingError:
                if on_bad is BadRows.stop:
                    raise
                losses.count("broken_line", 1)


def _vehicle(line: bytes, path: Path, row: int, layout: Layout) -> _Vehicle:
    """The vehicle that a line describes; BadRecordingError if the line is broken."""
    delimiter = layout.delimiter
    if not line.endswith(b"\n") and not line.strip(b" \r").endswith(delimiter.encode()):
        raise _broken("the line ends within a number", path, row)
    try:
        # Spreadsheets fill short lines with empty fields.
        text = line.decode().rstrip(f"{delimiter} \t\r\n")
    except UnicodeDecodeError as error:
        raise _broken(f"the line is not UTF-8 text ({error.reason})", path, row) from None
    if layout.decimal_point != ".":
        text = text.replace(layout.decimal_point, ".")
    fields = text.split(delimiter, len(VEHICLE_COLUMNS))
    n_further = fields[-1].count(delimiter) + 1 if len(fields) > len(VEHICLE_COLUMNS) else 0
    if n_further % len(REPEATED_COLUMNS) or not n_further:
        whole = f"{len(VEHICLE_COLUMNS)} and a multiple of {len(REPEATED_COLUMNS)}"
        raise _broken(f"the line has {len(VEHICLE_COLUMNS)} and {n_further} fields instead of {whole}", path, row)
    try:
        # By Arrow, which parses millions of numbers per second.
        parts = pc.call_function("split_pattern", [pa.array([fields[-1]])], pc.SplitPatternOptions(delimiter)).flatten()
        values = pc.call_function("utf8_trim_whitespace", [parts]).cast(pa.float64()).to_numpy()
        number = float(fields[0])
        if not number.is_integer():
            raise ValueError(f"track_id is {fields[0].strip()}, not a whole number")
    except (pa.ArrowInvalid, ValueError) as error:
        fault = str(error).partition("\n")[0]
        raise bad_recording("value-unreadable", fault, f"write a number there{DROP_HINT}", path, row=row + 1) from None
    if not abs(number) < 2**53:
        raise bad_recording("value-unreadable", f"track_id is {number:g}", "correct it", path, row=row + 1)
    values = np.where(np.abs(values) <= MAX_MAGNITUDE, values, np.nan)
    return _Vehicle(int(number), fields[1].strip().title(), values.reshape(-1, len(REPEATED_COLUMNS)))


def _broken(text: str, path: Path, row: int) -> BadRecordingError:
    remedy = f"the file is cut off or damaged: copy it again{DROP_HINT}"
    return bad_recording("line-broken", text, remedy, path, row=row + 1)


def _on_stretch(row: int, vehicle: _Vehicle, stretch: Stretch, losses: Losses) -> list[pd.DataFrame]:
    """The parts of a vehicle's path on the stretch, in the order of time."""
    along, lateral = stretch.places(vehicle.values[:, 0], vehicle.values[:, 1])
    inside = (along >= 0.0) & (along <= stretch.length) & (lateral >= 0.0) & (lateral <= stretch.width)
    inside = _without_excursions(inside)
    losses.count("outside_stretch", int((~inside).sum()))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
    parts = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        ahead, aside = along[end - 1] - along[begin], lateral[end - 1] - lateral[begin]
        if abs(aside) > max(abs(ahead), _MIN_MOVED):
            losses.count("crossing", int(end - begin))
        elif ahead < -_MIN_MOVED:
            losses.count("oncoming", int(end - begin))
        else:
            values = vehicle.values[begin:end]
            parts.append(
                pd.DataFrame(
                    {
                        "row": row,
                        "track_id": vehicle.number,
                        "type": vehicle.kind,
                        "along": along[begin:end],
                        "lateral": lateral[begin:end],
                        **{name: values[:, column] for column, name in enumerate(REPEATED_COLUMNS[2:], 2)},
                    }
                )
            )
    return parts


def _without_excursions(inside: np.ndarray) -> np.ndarray:
    """The mask, extended by rows that are outside for less than a second between two parts inside.

    No vehicle leaves a street for so short a time: the position is wrong or unknown, which the checks report.
    """
    known = np.flatnonzero(inside)
    gaps = np.diff(known)
    short = np.flatnonzero((gaps > 1) & (gaps <= _EXCURSION_ROWS))
    filled = inside.copy()
    for gap in short:
        filled[known[gap] : known[gap + 1]] = True
    return filled


def _table(
    parts: list[pd.DataFrame], stretch: Stretch, frame_rate: float, default_length: float
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Columns of the schema, and notes on times; a vehicle that comes back to the stretch gets a new track_id.

    A track_id in two rows of the file is a fault and stays, so that the schema check finds it.
    """
    numbers = np.array([part["track_id"].iloc[0] for part in parts], np.int64)
    again = pd.Series(numbers).duplicated().to_numpy() & (
        np.diff([part["row"].iloc[0] for part in parts], prepend=-1) == 0
    )
    ids = np.where(again, numbers.max() + np.cumsum(again), numbers)
    rows = pd.concat(parts, ignore_index=True)
    kind = pd.Series(rows["type"])
    lateral = rows["lateral"].to_numpy(np.float64)
    lane = np.clip(np.floor(lateral / stretch.width * stretch.n_lanes), 0, stretch.n_lanes - 1)
    counts = np.array([len(part) for part in parts])
    frame, notes = frames_of(rows["time"].to_numpy(np.float64), np.cumsum(counts) - counts, frame_rate)
    table = pd.DataFrame(
        {
            "track_id": np.repeat(ids, counts),
            "frame": frame,
            "direction": 1,
            "x": rows["along"].to_numpy(np.float64),
            "y": lateral,
            "position": rows["along"].to_numpy(np.float64),
            "lateral": lateral,
            "lane": lane,
            "speed": to_si(rows["speed"].to_numpy(np.float64), "km/h"),
            "acceleration": rows["lon_acc"].to_numpy(np.float64),
            "length": kind.map({name: length or default_length for name, (_, length) in _TYPES.items()})
            .fillna(default_length)
            .to_numpy(np.float64),
            "vehicle_class": kind.map({name: which for name, (which, _) in _TYPES.items()})
            .fillna(kind)
            .to_numpy(object),
        },
        index=rows["row"].to_numpy(),
    )
    return table, notes
