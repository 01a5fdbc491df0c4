"""Faults of a recording: one finding, and the error that stops the reading.

A finding marks rows. `data.on_bad` decides whether it becomes an error, or the rows are dropped and counted. A fault of
the table as a whole (a missing column, a wrong unit) is always an error.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.data.records import RecordingInfo
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

DROP_HINT = ", or leave it out and have it counted with data.on_bad=drop_row or data.on_bad=drop_track"


class BadRecordingError(InvalidInputError):
    """A recording breaks the schema."""


def bad_recording(
    code: str,
    message: str,
    remedy: str,
    file: Path | str,
    *,
    column: str | None = None,
    row: int | None = None,
    line: int | None = None,
) -> BadRecordingError:
    """The error for a problem of a recording; fields as in `Problem`."""
    return BadRecordingError(Problem(code, message, remedy, file=str(file), column=column, row=row, line=line))


@dataclass(frozen=True)
class Finding:
    """Rows of a table that share one problem.

    Attributes:
        name: Key under which dropped rows are counted; with hyphens for underscores also the code of the problem.
        column: Column at fault, as named in the schema.
        rows: Mask over the rows of the table; for a step (gap, jump) the row after the step.
        message: Description of the fault in the first marked row.
        remedy: Advice to the user.
        is_step: True if the rows themselves are sound, but the step from the row before is not.
    """

    name: str
    column: str
    rows: np.ndarray
    message: str
    remedy: str
    is_step: bool = False

    def error(self, table: pd.DataFrame, info: RecordingInfo, hint: str = DROP_HINT) -> BadRecordingError:
        """The error for this finding; the index of the table holds the row numbers of the source, from 0."""
        n_rows = int(self.rows.sum())
        message = self.message if n_rows == 1 else f"{self.message} (and {n_rows - 1} more rows)"
        row, column = source_row(table, self.rows), info.columns.get(self.column, self.column)
        code, file = self.name.replace("_", "-"), info.file or info.id
        return bad_recording(code, message, f"{self.remedy}{hint}", file, column=column, row=row)


def source_row(rows: pd.DataFrame | pd.Series, marked: np.ndarray) -> int:
    """Number in the source, from 1, of the first marked row; the index holds the row numbers of the source, from 0."""
    return int(rows.index[int(np.argmax(marked))]) + 1


def without_value(table: pd.DataFrame, name: str) -> Finding:
    """The finding for rows that lack an identifying value, such as the vehicle's number."""
    return Finding("not_finite", name, table[name].isna().to_numpy(), "the value is missing", "complete the row")


def recording_unnamed(file: str, column: str, row: int) -> BadRecordingError:
    """The error for a row, from 1, that belongs to no recording."""
    text = "a row has no recording"
    return bad_recording("recording-unnamed", text, "complete it", file, column=column, row=row)


def require_columns(found: Collection[str], required: Iterable[str], file: Path | str) -> None:
    """Raise BadRecordingError if one of the required columns is missing."""
    for name in required:
        if name not in found:
            remedy = f"add it; found: {', '.join(found)}"
            raise bad_recording("column-missing", "the column is missing", remedy, file, column=name)


def file_missing(path: Path) -> MissingInputError:
    """The error for a file of a recording that is not there."""
    message = "the file is missing: complete the recording or correct data.root"
    return MissingInputError(Problem("file-missing", message, file=str(path)))
