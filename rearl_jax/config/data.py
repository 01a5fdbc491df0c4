"""Configuration of the recordings: format, folder, treatment of bad rows."""

import pkgutil
from dataclasses import dataclass
from enum import Enum, EnumMeta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rearl_jax.config._key import key, mapping_key
from rearl_jax.config._ranges import check_finite, check_positive, check_within
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

_DATA = Path(__file__).resolve().parents[1] / "data"


class _Formats(EnumMeta):
    """Metaclass that lets type checkers accept any format name, because the names are known at run time only."""

    if TYPE_CHECKING:

        def __getattr__(cls, name: str) -> "DataFormat": ...


class DataFormat(Enum, metaclass=_Formats):
    """Format of the recordings: the name of a module in rearl_jax/data/readers."""

    _ignore_ = ["module"]
    for module in pkgutil.iter_modules([str(_DATA / "readers")]):
        vars()[module.name] = module.name

    @property
    def shipped(self) -> Path | None:
        """Folder of the recordings in this format that come with the package, None if none do.

        It is the folder in rearl_jax/data/shipped that bears the name of the format and holds the recordings' licence.
        """
        folder = _DATA / "shipped" / self.name
        return folder if (folder / "LICENSE").is_file() else None


class BadRows(Enum):
    """Treatment of rows that violate the schema of canonical tables."""

    stop = "stop"
    drop_track = "drop_track"
    drop_row = "drop_row"


TABLE_KEYS = ("columns", "units", "classes")
"""Keys of DataConfig that describe the columns of data=table, a user's own table with its own names and units."""


@dataclass(unsafe_hash=True)
class DataConfig:
    """Recordings to read."""

    format: DataFormat = key(
        DataFormat.us101, "format of the recordings; data=NAME sets it together with the keys that usually belong to it"
    )
    root: str | None = key(
        None,
        "folder of the recordings; not needed for those that are shipped: us101, i80, i80_slice, i80_lateral, openacc, "
        "fhwa",
    )
    recordings: str = key("*", "shell pattern of the recording id, such as highd_0? or us101_0750; * = all")
    on_bad: BadRows = key(
        BadRows.stop,
        "treatment of rows that violate the schema: stop with an error, drop_track (the vehicle is dropped) or "
        "drop_row (the row is dropped and the track cut there); dropped rows are counted",
    )
    max_jump: float = key(
        20.0,
        "largest difference between the speed that follows from two consecutive positions and the recorded speed "
        "[m/s]; a larger one is a jump, treated by data.on_bad; clean recordings stay below 6 m/s (NGSIM US-101, I-80)",
    )
    default_length: float = key(
        4.5, "vehicle length if the source has none [m]; the median leader of the NGSIM I-80 pairs has 4.54 m"
    )
    window: float | None = key(
        300.0, "length of the windows that hours-long recordings (i24) are cut into [s]; null = one window"
    )
    section: float | None = key(
        1000.0, "length of the sections that miles-long recordings (i24) are cut into [m]; null = one section"
    )
    stretch: tuple[float, ...] | None = key(
        None,
        "straight part of a street (pneuma), six numbers: latitude and longitude [deg] of the middle of the "
        "carriageway where the part begins, the same where it ends, its width [m], its number of lanes",
    )
    ring: float | None = key(
        None,
        "with data=table, length of one lap of a single-lane ring road [m]; null = a road with two ends; `rearl "
        "prepare FILE` finds it where positions begin anew with every lap",
    )
    columns: dict[str, Any] = mapping_key(
        "with data=table, the table's own column names by canonical name, as in "
        "'data.columns={track_id: Vehicle ID, position: x_m}'; null for a column to ignore; `rearl prepare FILE` finds "
        "them"
    )
    units: dict[str, Any] = mapping_key(
        "with data=table, units of the columns by canonical name, as in 'data.units={speed: km/h, time: ms}'; columns "
        "not named are in SI units. Further values: `time: 0.1 s`, a multiple of a unit; `lateral: -m`, a reversed "
        "axis; `frame: 25/s`, the frame rate; `lane: from 1`, the leftmost lane has the number 1"
    )
    classes: dict[Any, Any] = mapping_key(
        "with data=table, vehicle classes by the table's own code or word, as in 'data.classes={1: car, 2: truck}'"
    )

    def check(self) -> None:
        if not self.root and not self.format.shipped:
            name = self.format.name
            message = f"must name the folder of the recordings for data.format={name}"
            raise InvalidInputError(Problem("root-missing", message, key="root"))
        if not self.recordings:
            raise out_of_range("recordings", "must be a shell pattern such as *", repr(self.recordings))
        check_positive(self, "max_jump")
        check_within(self, 1.0, 30.0, "default_length")
        check_positive(self, "window", "section", "ring")
        check_finite(self, "ring", "stretch")
