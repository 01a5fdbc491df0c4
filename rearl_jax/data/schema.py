"""The canonical trajectory table: its columns, and the function that enforces them.

One row is one vehicle in one frame, in SI units and seen by the driver: `position` grows while driving, `lane` 0 is
the leftmost lane, `lateral` grows to the right. Every reader ends in `validate`, so no other code sees bad rows.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks import column_checks, lateral_checks, placeholders, typed_table
from rearl_jax.data.checks.labels import labelled
from rearl_jax.data.checks.leaders import wrong_leader
from rearl_jax.data.checks.losses import Losses, reject, remove_fragments
from rearl_jax.data.checks.motion_checks import wrong_motion
from rearl_jax.data.problems import bad_recording, require_columns, source_row
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.vehicle_classes import CLASSES, classes_of

__all__ = ["COLUMNS", "Column", "Recording", "RecordingInfo", "validate"]


@dataclass(frozen=True)
class Column:
    """A column of the canonical table; a nullable one may be missing in a file and is then unknown."""

    name: str
    dtype: str
    unit: str
    meaning: str

    @property
    def nullable(self) -> bool:
        """The value may be unknown (NaN or NA)."""
        return self.name in typed_table.NULLABLE


COLUMNS = (
    Column("recording", "category", "", "id of the recording, such as highd_01"),
    Column("track_id", "int64", "", "vehicle, unique in the recording"),
    Column("frame", "int64", "", "frame number of the source"),
    Column("time", "float64", "s", "since the first frame of the recording"),
    Column("direction", "int8", "", "carriageway, 1 or 2 as in highD; 1 if there is only one"),
    Column("x", "float64", "m", "vehicle centre in the ground frame that both carriageways share"),
    Column("y", "float64", "m", "vehicle centre in the ground frame that both carriageways share"),
    Column("position", "float64", "m", "vehicle centre along its driving direction, from the upstream edge"),
    Column("lateral", "float64", "m", "vehicle centre from the left edge of the carriageway, positive to the right"),
    Column("lane", "Int8", "", "0 = leftmost lane in driving direction"),
    Column("speed", "float64", "m/s", "along the driving direction, not negative"),
    Column("acceleration", "float64", "m/s^2", "along the driving direction"),
    Column("length", "float64", "m", "vehicle length"),
    Column("width", "float64", "m", "vehicle width"),
    Column("vehicle_class", "category", "", f"one of {', '.join(CLASSES)}"),
    Column("leader_id", "Int64", "", "track_id of the leader if the source states it"),
)

_SET_HERE = ("recording", "time")
# Checked as 64-bit integers and narrowed last, so that a lane of 300 is reported and does not wrap around.
_WIDENED = {"int8": "int64", "Int8": "Int64"}
_MAX_EXACT_INTEGER = 2**53  # float64 does not represent all larger whole numbers
_ROW_CHECKS = (
    typed_table.unknown_class,
    typed_table.out_of_order,
    placeholders.unknown_size,
    placeholders.misplaced,
    placeholders.unavailable_acceleration,
    lateral_checks.stray_lane,
)
# Leaders are checked last, because this check needs sound positions; the gap check is repeated, because a row that is
# dropped for its leader leaves a gap.
_RANGE_CHECKS = (
    typed_table.wrong_time,
    typed_table.out_of_range,
    typed_table.wrong_lane,
    typed_table.changed_direction,
    typed_table.gap,
    wrong_motion,
    typed_table.jump,
    wrong_leader,
    typed_table.gap,
)
REQUIRED = tuple(c.name for c in COLUMNS if not c.nullable and c.name not in _SET_HERE)


def validate(
    table: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses | None = None
) -> tuple[pd.DataFrame, dict[str, int]]:
    """Canonical table of the recording and the counts of rows and tracks that were left out.

    The result has exactly COLUMNS and the labels of the recording, is sorted by (track_id, frame), unique, and no track
    has a gap. Under data.on_bad=drop_row a bad row is removed and the track cut there: the rest continues under a new
    id, and parts of cut tracks shorter than 1 s are removed. Under drop_track the vehicle is removed as a whole.

    Args:
        table: Columns of the schema, tracks in any order, the rows of a track in the order of time. The index
            holds the row numbers of the source, from 0; errors name them. `recording` is set to `info.id`,
            `time` is computed from the frames where it is missing, missing nullable columns and labels become unknown.
        info: The recording.
        policy: `on_bad` and `max_jump`.
        losses: Rows that the reader has already left out.

    Raises:
        BadRecordingError: A column is missing, the table is empty, a column is in a wrong unit; or a row
            breaks the schema and data.on_bad is stop.
    """
    losses = Losses() if losses is None else losses
    require_columns(list(table.columns), REQUIRED, info.file or info.id)
    if table.empty:
        text, remedy = "the recording has no rows", "remove the file or complete it"
        raise bad_recording("no-rows", text, remedy, info.file or info.id)

    def checked(table: pd.DataFrame, checks: tuple[Callable, ...]) -> pd.DataFrame:
        for check in checks:
            # Repeated after every removal, because the remaining rows may have the same problem in another column.
            while (finding := check(table, info, policy)) is not None:
                table = reject(table, finding, info, policy, losses)
        return table

    table = checked(labelled(_numbers(table, info), info), (typed_table.not_finite,))
    table = checked(_typed(table), _ROW_CHECKS)
    table["vehicle_class"] = table["vehicle_class"].cat.set_categories(list(CLASSES))
    impossible = placeholders.impossible_rows(table)
    _require_sound_columns(table.iloc[np.flatnonzero(~impossible)] if impossible.any() else table, info)
    n_found = -1
    # Repeated until no row is removed, because a part of a track may fail a check that the whole track has passed, and
    # the result must pass all checks when it is read again.
    while n_found != losses.counts.total():
        n_found = losses.counts.total()
        table = checked(table, _RANGE_CHECKS)
        if not losses.counts:
            break
    table = remove_fragments(table, info, losses)
    if losses.counts:
        _require_sound_columns(table, info)
    table = table.astype({c.name: c.dtype for c in COLUMNS if c.dtype in _WIDENED})
    return table.reset_index(drop=True), dict(losses.counts)


def _require_sound_columns(table: pd.DataFrame, info: RecordingInfo) -> None:
    """Raise BadRecordingError if a whole column has another unit, sign or origin than the schema requires."""
    finding = column_checks.wrong_columns(table, info)
    if finding is not None:
        raise finding.error(table, info, hint="")


def _numbers(table: pd.DataFrame, info: RecordingInfo) -> pd.DataFrame:
    """The columns of the schema, every numeric one as numbers; text that is not a number is an error with its row."""
    table = table.copy(deep=False)
    table["recording"] = pd.Categorical.from_codes(np.zeros(len(table), dtype=np.int8), [info.id])
    for column in COLUMNS:
        name = column.name
        if name not in table and name != "time":
            table[name] = pd.Series(pd.NA, index=table.index, dtype="Int64") if "Int" in column.dtype else np.nan
        elif column.dtype != "category" and name in table:
            table[name] = _number(pd.Series(table[name]), column, info)
    table["vehicle_class"] = classes_of(pd.Series(table["vehicle_class"]))
    if "time" not in table:
        table["time"] = (table["frame"] - table["frame"].min()) / info.frame_rate
    return table.reindex(columns=[*(column.name for column in COLUMNS), *info.labels])


def _number(values: pd.Series, column: Column, info: RecordingInfo) -> pd.Series:
    """A column as numbers; BadRecordingError for text that is not a number, and for fractions among integers."""
    if not pd.api.types.is_numeric_dtype(values.dtype):
        numbers = pd.Series(pd.to_numeric(values, errors="coerce"), index=values.index, name=values.name)
        _stop_at(np.asarray(numbers.isna() & values.notna()), values, "a number", info)
        values = numbers
    if not column.nullable and values.isna().any():
        # NaN for the missing values of every library, so that one check finds them.
        values = values.astype(np.float64)
    if column.dtype.lower().startswith("int"):
        array = values.to_numpy(dtype=np.float64, na_value=np.nan)
        unfit = (array != np.rint(array)) | (np.abs(array) > _MAX_EXACT_INTEGER)
        if column.nullable:  # -2^63, to which NumPy converts NaN, is reported later as a fault of its row
            unfit &= array != -(2.0**63)
        _stop_at(np.isfinite(array) & unfit, values, "a whole number below 2^53", info)
    return values


def _stop_at(bad: np.ndarray, values: pd.Series, expected: str, info: RecordingInfo) -> None:
    """Raise BadRecordingError for the first marked value, which is not what is expected."""
    if bad.any():
        value = values.iloc[int(np.argmax(bad))]
        text = f"{value!r} is not {expected}" if isinstance(value, str) else f"{value:g} is not {expected}"
        column = info.columns.get(str(values.name), str(values.name))
        remedy, file = f"write {expected}", info.file or info.id
        raise bad_recording("not-a-number", text, remedy, file, column=column, row=source_row(values, bad))


def _typed(table: pd.DataFrame) -> pd.DataFrame:
    """The table in the dtypes of COLUMNS, tracks together, rows of a track in the order of the source."""
    types = {c.name: _WIDENED.get(c.dtype, c.dtype) for c in COLUMNS}
    table = table.astype({name: dtype for name, dtype in types.items() if str(table[name].dtype) != dtype})
    track = table["track_id"].to_numpy()
    if np.all(track[1:] >= track[:-1]):
        return table
    return table.iloc[np.argsort(track, kind="stable")]
