"""Reader of Vissim's vehicle records (.fzp), one recording per file.

A record states the position of the front on a link or connector, and counts lanes from the right, from 1. Two layouts
are read: that of Vissim 6 and later, whose columns follow `$VEHICLE:` (`$FAHRZEUG:` and German names in the German
edition), and the older one with a column `VehNr`. Numbers may have a decimal comma.

Source: PTV Vissim manual, Saving vehicle record to a file or database; VISSIM 5.30 manual, Vehicle Record; German
names of attributes: PTV Vissim 2025, Hilfe, Fahrzeuge im Netz in einer Liste anzeigen.
"""

import re
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.files.content import in_utf8
from rearl_jax.data.files.delimited import read_below, stem_of, text_endings
from rearl_jax.data.files.folder import named_files
from rearl_jax.data.files.text_layout import first_lines, readable
from rearl_jax.data.formats.simulated import Simulation, info_of, recording_of
from rearl_jax.data.problems import bad_recording, require_columns
from rearl_jax.data.records import Recording
from rearl_jax.data.units import UNITS, to_si, unit_named
from rearl_jax.data.vehicle_classes import CLASSES, class_of

LANE_WIDTH = 3.5
"""Width of a lane [m]; Vissim's default, the records do not state it."""
LABEL = "type"
"""Label of tracks: the number of the vehicle type."""

_HEADERS = ("$VEHICLE:", "$FAHRZEUG:")
_MAX_HEADER_LINES = 1000  # lines above the table, which explain one column each
# Columns by their names without case: in English, in German (umlauts also as AE), last those of the older layout.
_NAMES = {
    "time": ("SIMSEC", "SIMSEK", "T"),
    "vehicle": ("NO", "NR", "VEHNR"),
    "link": (r"LANE\LINK\NO", r"FS\STRECKE\NR", "LINK"),
    "lane": (r"LANE\INDEX", r"FS\INDEX", "LANE"),
    "front": ("POS", "POS", "X"),
    "speed": ("SPEED", "GESCHW", "VMS", "V"),
    "length": ("LENGTH", "LÄNGE", "LAENGE"),
    "type": ("VEHTYPE", r"VEHTYPE\NO", "FZTYP", r"FZTYP\NR", "TYPE"),
    "aside": ("POSLAT",),
    "acceleration": ("ACCELERATION", "BESCHLEUNIGUNG", "A"),
    "width": ("WIDTH", "BREITE"),
}
_REQUIRED = ("time", "vehicle", "link", "lane", "front", "speed")
# Units of columns whose unit the file does not state.
_UNSTATED = {"front": "m", "speed": "km/h", "length": "m", "acceleration": "m/s^2", "width": "m"}
# Types of a new network; users define the meaning of others. Source: PTV Vissim manual, Vehicle types.
_CLASS = {100: "car", 200: "truck", 300: "truck", 400: "other"}

_WANTED = "a vehicle record of Vissim, or a folder of them"
find_records = partial(named_files, endings=text_endings(".fzp"), wanted=_WANTED, usual=".fzp")
"""The .fzp files in the folder, or the one file that is named; MissingInputError if there is none."""


@dataclass(frozen=True)
class _Header:
    """The header lines above the table.

    Attributes:
        n_above: Lines above the first row.
        layout: Index of the layout's names in _NAMES; -1 for the older layout, whose names are last.
        columns: All columns, as the file spells them.
        units: Unit of a column by its name in capitals.
    """

    n_above: int
    layout: int
    columns: list[str]
    units: dict[str, str] = field(default_factory=dict)

    def spelling(self) -> dict[str, str]:
        """Name in the file of every known column."""
        by_name = {name.upper(): name for name in self.columns}
        found = {canonical: [by_name[name] for name in names if name in by_name] for canonical, names in _NAMES.items()}
        return {canonical: names[0] for canonical, names in found.items() if names}


def is_record(path: Path) -> bool:
    """True if a line names the columns of a vehicle record."""
    return any(line.startswith(_HEADERS) or _names_old_columns(line) for line in first_lines(path, _MAX_HEADER_LINES))


def recording_id(path: Path) -> str:
    """Name of the recording of a file, such as vissim_run_001."""
    return f"vissim_{stem_of(path)}"


def read_record(path: Path, policy: DataConfig) -> Recording:
    """The main road of one file.

    Raises:
        BadRecordingError: The file is not a vehicle record, lacks a column, or has an unknown unit, or a row breaks the
            schema.
    """
    losses = Losses()
    header = _header_of(path)
    names = header.spelling()
    for name in _REQUIRED:
        if name not in names:
            require_columns(header.columns, (_NAMES[name][header.layout],), path)
    kinds = {spelt: pa.string() if canonical == "type" else pa.float64() for canonical, spelt in names.items()}
    table, n_broken = read_below(path, header.columns, header.n_above, kinds, ";", policy.on_bad)
    losses.count("broken_line", n_broken)
    canonical = {spelt: name for name, spelt in names.items()}
    raw = table.rename_columns([canonical[spelt] for spelt in table.column_names])
    rows, notes = _rows_of(raw.to_pandas(split_blocks=True, self_destruct=True), header, names, path, policy)
    labels = (LABEL,) if "type" in names else ()
    columns = {**names, "track_id": names["vehicle"], "frame": names["time"], "position": names["front"]}
    columns["lateral"] = names.get("aside", "lateral")
    info = info_of(path, recording_id(path), "Vissim", labels, notes, columns)
    return recording_of(rows, Simulation(info, {}, {}, LANE_WIDTH), policy, losses)


def _header_of(path: Path) -> _Header:
    """The columns and their units.

    Raises:
        BadRecordingError: The file is empty, damaged, or no vehicle record.
    """
    units: dict[str, str] = {}
    number = 0
    with readable(path), in_utf8(path) as file:
        for number, content in enumerate(file, 1):
            line = _decoded(content).strip()
            layout = next((place for place, begin in enumerate(_HEADERS) if line.startswith(begin)), -1)
            if layout >= 0 or _names_old_columns(line):
                named = line.removeprefix(_HEADERS[layout]) if layout >= 0 else line
                return _Header(number, layout, [name.strip() for name in named.split(";")], units)
            explained = re.match(r"[*\s]*([\w\\]+)\s*:.*\[([^\[\]]+)\]", line)
            if explained:
                units[explained[1].upper()] = explained[2].strip()
            if number > _MAX_HEADER_LINES:
                break
    if not number:
        raise bad_recording("file-empty", "the file is empty", "remove the file or complete it", path)
    text = f"no line begins with {' or '.join(_HEADERS)} or has the column VehNr"
    remedy = "name the vehicle record that Vissim writes, with English or German names of columns"
    raise bad_recording("not-a-table", text, remedy, path)


def _decoded(line: bytes) -> str:
    """The characters of a line in UTF-8, or in Windows-1252 if it is not valid UTF-8."""
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")


def _names_old_columns(line: str) -> bool:
    """True if the line names the columns of the older layout."""
    names = [name.strip() for name in line.split(";")]
    return "VehNr" in names and len(names) > 2


def _rows_of(
    raw: pd.DataFrame, header: _Header, names: dict[str, str], path: Path, policy: DataConfig
) -> tuple[pd.DataFrame, list[str]]:
    """The rows in the columns of `simulated.FIELDS`, in SI units, and notes on what is assumed."""
    notes, unstated = [], []
    for name in _UNSTATED:
        if name in names:
            unit, is_stated = _unit_of(name, header, names, path)
            if not is_stated and name in ("front", "speed"):
                unstated.append(unit)
            raw[name] = to_si(raw[name].to_numpy(), unit)
    if unstated:
        notes.append(f"the file states no units of places and speeds: {' and '.join(unstated)} assumed")
    rows = raw.assign(
        track_id=raw["vehicle"], link=_links(raw["link"].to_numpy()), lane=raw["lane"].to_numpy() - 1.0
    ).drop(columns="vehicle")
    notes.append("lanes are counted from the right, as for right-hand traffic")
    if "length" not in rows:
        rows["length"] = policy.default_length
        notes.append(f"the file has no lengths: {policy.default_length:g} m assumed")
    if "aside" in rows:
        # 0 is the right edge of the lane, 1 the left one.
        rows["aside"] = 0.5 - rows["aside"].to_numpy()
        notes.append(f"lanes {LANE_WIDTH:g} m wide assumed")
    if "type" not in rows:
        notes.append("the file has no types of vehicles: cars assumed")
        return rows.assign(vehicle_class="car"), notes
    rows["type"] = rows["type"].str.strip().astype("category")
    kinds = [str(kind) for kind in rows["type"].cat.categories]
    classes = [_class_of(kind) for kind in kinds]
    unknown = [kind for kind, name in zip(kinds, classes, strict=True) if name is None]
    if unknown:
        notes.append(f"types {', '.join(unknown[:5])} are none of Vissim's own: class other")
    found = np.array([*(name or "other" for name in classes), None], object)
    return rows.assign(vehicle_class=found[rows["type"].cat.codes.to_numpy()]), notes


def _unit_of(name: str, header: _Header, names: dict[str, str], path: Path) -> tuple[str, bool]:
    """Unit of a column, and whether the file states it."""
    spelt = names[name].upper()
    if spelt == "VMS":
        return "m/s", True
    stated = header.units.get(spelt)
    if stated is None:
        return _UNSTATED[name], False
    kind = "m/s" if name == "speed" else _UNSTATED[name]
    unit = unit_named(stated, kind)
    if unit is None:
        text = f"the unit {stated} of the column is not known"
        remedy = f"let Vissim write one of {', '.join(UNITS[kind])}"
        raise bad_recording("unit-unknown", text, remedy, path, column=names[name])
    return unit, True


def _links(numbers: np.ndarray) -> pd.Categorical:
    """Links by their numbers; a number that cannot be that of a link becomes unknown."""
    sound = np.isfinite(numbers) & (numbers == np.rint(numbers)) & (np.abs(numbers) < 2**31)
    links, inverse = np.unique(np.where(sound, numbers, np.nan), return_inverse=True)
    found = links[np.isfinite(links)].astype(np.int64)
    codes = np.where(sound, inverse, -1)
    return pd.Categorical.from_codes(codes, [str(link) for link in found])


def _class_of(kind: str) -> str | None:
    """Class of a type such as 100, 100: Car or 1001: HGV; None for a number or word that is not known."""
    number = re.match(r"\s*(\d+)", kind)
    word = class_of(kind[number.end() if number else 0 :].strip(" :"))
    return (_CLASS.get(int(number[1])) if number else None) or (word if word in CLASSES else None)
