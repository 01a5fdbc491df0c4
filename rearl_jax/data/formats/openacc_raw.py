"""OpenACC's runs as published, one .csv each: five lines about the run above a table with a row for every 0.1 s.

The table has the columns Speed1, E1, N1 and so on of every vehicle, IVS1 for the gap between vehicles 1 and 2, and
in some campaigns Driver1. A vehicle may lack all of its columns. A name may have a unit in brackets, as Speed1 (km/h)
has; without one, values are in SI units. Positions are rebuilt as in `openacc`.

Source: notes beside the runs of the campaigns AstaZero, Vicolungo and JRC low speed, European Commission, Joint
Research Centre, Open ACC Database, DOI 10.2905/JRC.KMH3D00; they say that IVS is computed from satellite positions
"after bumper to bumper correction".
"""

import re
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses, stop_or_count
from rearl_jax.data.files.content import in_utf8
from rearl_jax.data.files.delimited import read_below, stem_of, text_endings
from rearl_jax.data.files.folder import is_visible, recordings_missing, visible_files
from rearl_jax.data.files.text_layout import first_lines, readable
from rearl_jax.data.formats import openacc
from rearl_jax.data.formats.openacc import FRAME_RATE, MAX_HOLE, MODEL, Platoon
from rearl_jax.data.formats.openacc_labels import ACC, INDEX_FILE
from rearl_jax.data.formats.published_names import split_unit, unit_stated
from rearl_jax.data.problems import Finding, bad_recording, require_columns
from rearl_jax.data.schema import Recording, RecordingInfo
from rearl_jax.data.units import to_si

SETTING = "setting"
"""Label of tracks: the distance that was set, in the words of the file; mixed where cars were set differently."""

_ENDINGS = text_endings(".csv")
_HEADER_KEYS = ("Vehicle_order", "ACC", "Distance_setting")
_MAX_HEADER_LINES = 20  # lines above the table; there are 6
# Beginning of the line with the names of the columns.
_COLUMNS = re.compile(r"Time\s*(?:[\[(][^\[\]()]*[\])]\s*)?([,;\t])")
_OF_VEHICLE = re.compile(r"(?:Speed|IVS|Driver|Lat|Lon|Alt|E|N|U)[ _]?(\d+)(?!\d)", re.IGNORECASE)
_KINDS = {"Time": "s", "Speed": "m/s", "IVS": "m", "E": "m", "N": "m"}  # SI units of the numbers that are read
_FIRST_CELL = re.compile(r"\s*[,;\t]")  # end of a first cell
_NOT_RUNS = ("specification", INDEX_FILE)
_DRIVER = {"acc": "1", "human": "0"}
_PAIR_TOLERANCE = 3.0  # m; more than the lengths of cars and the places of their receivers differ
_RECEIVER_TOLERANCE = 1.0  # m; gaps between bumpers are a car length shorter than distances between receivers


@dataclass(frozen=True)
class Header:
    """Header lines above the table of a run.

    Attributes:
        about: Values of the header lines, by the name of the line, such as Vehicle_order.
        columns: Names of the columns, without units.
        n_above: Lines above the first row.
        delimiter: Separator of fields: a comma, as published, or that of a copy.
        units: Unit of the columns of numbers that state one, by name.
    """

    about: dict[str, tuple[str, ...]]
    columns: list[str]
    n_above: int
    delimiter: str
    units: dict[str, str]

    def numbered(self, name: str) -> list[int]:
        """Numbers of the vehicles that have a column of this name."""
        found = [re.fullmatch(rf"{name}([1-9]\d*)", column) for column in self.columns]
        return sorted(int(match[1]) for match in found if match)


def find_runs(root: Path) -> list[Path]:
    """The runs in the folder and its subfolders, one for each campaign, or the one that is named.

    Raises:
        MissingInputError: There is none.
    """
    if root.is_file():
        return [root]
    folders = [root, *(folder for folder in sorted(root.glob("*")) if folder.is_dir() and is_visible(folder))]
    found = [path for folder in folders for path in visible_files(folder, _ENDINGS)]
    runs = [path for path in found if not any(word in path.name.lower() for word in _NOT_RUNS)]
    if not runs:
        wanted = "the folder of the one Parquet file of OpenACC platoons, or of the published runs (.csv)"
        raise recordings_missing("no .parquet and no .csv", root, wanted, (".parquet", *_ENDINGS))
    return runs


def is_run(path: Path) -> bool:
    """True if the first lines describe a platoon and a line below them names the columns."""
    lines = first_lines(path, _MAX_HEADER_LINES)
    first_cells = {_FIRST_CELL.split(line, maxsplit=1)[0] for line in lines}
    return set(_HEADER_KEYS) <= first_cells and any(map(_COLUMNS.match, lines))


def runs_of(path: Path) -> dict[str, Platoon]:
    """Recording id -> part of the platoon with two vehicles or more, from the columns of the file.

    Raises:
        BadRecordingError: The file is not a run.
    """
    header = read_header_of(path)
    speeds, gaps = header.numbered("Speed"), header.numbered("IVS")
    name = f"openacc_{path.absolute().parent.name}_{stem_of(path)}"
    platoons = openacc.platoons_of(name, stem_of(path), speeds, gaps, header.about["Vehicle_order"])
    if not platoons:
        text = "no two neighbours have the columns Speed and IVS"
        raise bad_recording("column-missing", text, "complete the columns", path, column="IVS1")
    return platoons


def read_run(path: Path, recording: str, platoon: Platoon, policy: DataConfig) -> Recording:
    """One part of a run.

    If the driver of a car switches, the car continues as another track, so that a track has one label `acc`. Rows are
    left out as by `openacc.read_platoon`. Rows with an unknown word for the driver are counted as `driver_unknown` and
    kept without a driver.

    Raises:
        BadRecordingError: The file is damaged or is not a run, or a row is bad and data.on_bad is stop.
    """
    header = read_header_of(path)
    places = [*range(platoon.first, platoon.last + 1), *platoon.unlinked]
    wanted = [f"{name}{k}" for k in places for name in ("Speed", "IVS", "Driver", "E", "N")]
    wanted = ["Time", *(column for column in wanted if column in header.columns)]
    kinds = {name: pa.string() if name.startswith("Driver") else pa.float64() for name in wanted}
    table, n_broken = read_below(path, header.columns, header.n_above, kinds, header.delimiter, policy.on_bad)
    wide = table.to_pandas(split_blocks=True, self_destruct=True)
    for name in header.units.keys() & set(wanted):
        wide[name] = to_si(wide[name].to_numpy(np.float64), header.units[name])
    wide["Time"] = openacc.on_frames(wide["Time"].to_numpy(np.float64))
    models = header.about["Vehicle_order"]
    campaign = path.absolute().parent.name
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: 1},
        road_length=0.0,
        source=f"OpenACC, {campaign}",
        licence=openacc.LICENCE,
        attribution=openacc.ATTRIBUTION,
        labels=(MODEL, ACC, SETTING),
        notes=(
            "single file, adaptive cruise control or human drivers; the road is straightened",
            f"positions rebuilt from speeds and gaps, vehicle length {policy.default_length:g} m assumed",
            *_on_receivers(wide, platoon),
        ),
        file=str(path),
        columns={"track_id": "Speed", "frame": "Time", "speed": "Speed", "position": "IVS", "x": "IVS", ACC: "Driver"},
    )
    losses = Losses()
    losses.count("broken_line", n_broken)
    labels = {MODEL: {k: models[k - 1] for k in places}, SETTING: _setting(header), ACC: _acc_of_run(header, path)}
    drivers = _drivers(wide, header, platoon, info, policy, losses)
    of_vehicles = [
        pd.DataFrame(
            {
                "t_s": wide["Time"],
                "pos": float(k),
                "speed_mps": wide[f"Speed{k}"],
                "gap_to_follower_m": wide[f"IVS{k}"] if f"IVS{k}" in wide else np.nan,
            }
        )
        for k in places
    ]
    return openacc.rebuilt(pd.concat(of_vehicles), platoon, info, labels, policy, drivers, losses)


def read_header_of(path: Path) -> Header:
    """The header lines above the table.

    Raises:
        BadRecordingError: The file is empty, damaged or not a run, does not name its vehicles, has an unknown unit, or
            has some columns of a vehicle and not its speed.
    """
    with readable(path), in_utf8(path) as file:
        lines = [line.decode("utf-8-sig", errors="replace").strip() for line in islice(file, _MAX_HEADER_LINES + 1)]
    if not lines:
        raise bad_recording("file-empty", "the file is empty", "remove the file or complete it", path)
    place, found = next(((n, _COLUMNS.match(line)) for n, line in enumerate(lines) if _COLUMNS.match(line)), (0, None))
    if found is None:
        text = "no line begins with Time, as the header of a run of OpenACC does"
        raise bad_recording("not-a-table", text, "move the file out of the folder", path)
    rows = [[cell.strip() for cell in line.split(found[1])] for line in lines[: place + 1]]
    about = {cells[0]: tuple(cell for cell in cells[1:] if cell) for cells in rows[:-1]}
    require_columns(about, _HEADER_KEYS, path)
    columns, units = [], {}
    for spelt in rows[-1]:
        name, _ = split_unit(spelt)
        columns.append(name)
        kind = _KINDS.get(name.rstrip("0123456789"))
        if kind is not None and (unit := unit_stated(spelt, kind, path)):
            units[name] = unit
    header = Header(about, columns, place + 1, found[1], units)
    _require_speeds(header, rows[-1], path)
    most = max(header.numbered("Speed"), default=0)
    if most > len(about["Vehicle_order"]):
        text = f"{len(about['Vehicle_order'])} vehicles are named, but there are columns of vehicle {most}"
        raise bad_recording("vehicle-unnamed", text, "name all vehicles", path, column="Vehicle_order")
    return header


def _require_speeds(header: Header, spelt: list[str], path: Path) -> None:
    """Raise BadRecordingError if a vehicle has columns, in the spelling of the file, and no speed."""
    of_vehicles: dict[int, list[str]] = {}
    for name in spelt:
        if found := _OF_VEHICLE.match(name):
            of_vehicles.setdefault(int(found[1]), []).append(name)
    for k in sorted(of_vehicles.keys() - set(header.numbered("Speed"))):
        text = f"vehicle {k} has the columns {', '.join(of_vehicles[k])} and no Speed{k}"
        remedy = f"name its speed Speed{k}, with numbers from 1, or remove all columns of the vehicle"
        raise bad_recording("column-missing", text, remedy, path, column=f"Speed{k}")


def _on_receivers(wide: pd.DataFrame, platoon: Platoon) -> tuple[str, ...]:
    """Notes on the differences between the distances of neighbouring receivers and the stated gaps: the median of all,
    and pairs of cars with another one.
    """
    differences, of_pairs = [], dict[int, float]()
    for k in range(platoon.first, platoon.last):
        names = [f"{name}{number}" for name in "EN" for number in (k, k + 1)]
        if set(names) <= set(wide.columns):
            east, east_behind, north, north_behind = (wide[name].to_numpy() for name in names)
            values = np.hypot(east - east_behind, north - north_behind) - wide[f"IVS{k}"].to_numpy()
            differences.append(values[np.isfinite(values)])
            if differences[-1].size:
                of_pairs[k] = float(np.median(differences[-1]))
    values = np.concatenate(differences) if differences else np.empty(0)
    if not values.size:
        return ()
    difference = round(float(np.median(values)), 1) + 0.0  # + 0.0 makes -0.0 positive
    bumpers, receivers = "the gaps are those between bumpers", "the gaps seem to be those of receivers, a car too long"
    reading = bumpers if difference > _RECEIVER_TOLERANCE else receivers
    notes = [f"receivers of neighbours are {difference:.1f} m further apart than the gaps (median): {reading}"]
    usual = float(np.median(list(of_pairs.values())))
    for k, of_pair in of_pairs.items():
        if abs(of_pair - usual) > _PAIR_TOLERANCE:
            text = f"receivers of vehicles {k} and {k + 1} are {of_pair + 0.0:.1f} m further apart than IVS{k}"
            notes.append(f"{text}, most others {usual + 0.0:.1f} m: its gap may be measured between other points")
    return tuple(notes)


def _acc_of_run(header: Header, path: Path) -> str | None:
    """Label `acc` of all cars of a run, if it is stated for the run and not for single cars; else None."""
    stated = tuple(word.removesuffix(".0") for word in header.about["ACC"])
    if stated not in ((), ("0",), ("1",), ("2",)):
        text = f"ACC is {','.join(stated)}, not 0, 1, 2 or nothing"
        raise bad_recording("label-unusable", text, "write 0, 1 or 2", path, column="ACC")
    return stated[0] if stated in (("0",), ("1",)) and not header.numbered("Driver") else None


def _setting(header: Header) -> str | None:
    """Label `setting` of all cars of a run; None if the file states none."""
    stated = [word for word in dict.fromkeys(header.about["Distance_setting"]) if word.lower() != "none"]
    if len(stated) > 1 or (stated and re.fullmatch("[SML]{2,}", stated[0])):
        return "mixed"
    return stated[0] if stated else None


def _drivers(
    wide: pd.DataFrame, header: Header, platoon: Platoon, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> pd.Series | None:
    """Driver by number in the platoon and frame, filled in where missing for 1 s or less; None if not stated."""
    found = []
    time = wide["Time"].to_numpy(np.float64)
    known = np.isfinite(time) & (np.abs(time) < openacc.MAX_TIME * 1e3)
    frame = np.rint(np.where(known, time, 0.0) * FRAME_RATE).astype(np.int64)
    for k in header.numbered("Driver"):
        if not platoon.first <= k <= platoon.last:
            continue
        words = wide[f"Driver{k}"].str.strip().str.lower()
        driver = words.map(_DRIVER)
        wrong = (driver.isna() & words.notna() & (words != "")).to_numpy()
        if wrong.any():
            text = f"the driver is {words.iloc[int(np.argmax(wrong))]}, not ACC or Human"
            finding = Finding("driver_unknown", ACC, wrong, text, "write ACC or Human")
            stop_or_count(wide, finding, info, policy, losses)
        index = pd.MultiIndex.from_arrays([np.full(len(wide), k), frame])
        found.append(pd.Series(driver.ffill(limit=MAX_HOLE).to_numpy(object), index=index)[known])
    if not found:
        return None
    drivers = pd.Series(pd.concat(found))
    return pd.Series(drivers.loc[~drivers.index.duplicated()])
