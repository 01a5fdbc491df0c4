"""What can be wrong with a recording: one finding, and the error that stops the reading.

A finding marks rows. `data.on_bad` decides whether it becomes an error or a counted loss; what concerns the
table as a whole (a missing column, a wrong unit) is always an error.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.data.records import RecordingInfo

DROP_HINT = ", or leave it out and have it counted with data.on_bad=drop_row or data.on_bad=drop_track"


class BadRecordingError(ValueError):
    """A recording breaks the schema.

    Attributes:
        file: File the row comes from.
        column: Column at fault, as named in the file; None for the table as a whole.
        row: First row at fault, 1 = first row of data; None for the table as a whole.
        problem: What is wrong, in words.
        remedy: What to do about it.
    """

    def __init__(self, file: str, problem: str, remedy: str, column: str | None = None, row: int | None = None):
        self.file, self.column, self.row, self.problem, self.remedy = file, column, row, problem, remedy
        place = [file]
        if column is not None:
            place.append(f"column {column}")
        if row is not None:
            place.append(f"data row {row}")
        super().__init__(f"{', '.join(place)}: {problem}. Remedy: {remedy}.")


@dataclass(frozen=True)
class Finding:
    """Rows of a table that share one problem.

    Attributes:
        name: Key under which dropped rows are counted.
        column: Column at fault, as named in the schema.
        rows: Mask over the rows of the table; for a step (gap, jump) the row after the step.
        problem: What is wrong with the first marked row, in words.
        remedy: What to do about it.
        is_step: The rows are sound, the step from the row before is not.
    """

    name: str
    column: str
    rows: np.ndarray
    problem: str
    remedy: str
    is_step: bool = False

    def error(self, table: pd.DataFrame, info: RecordingInfo, hint: str = DROP_HINT) -> BadRecordingError:
        """The error this finding becomes; the index of the table holds the rows of the source, from 0."""
        n_rows = int(self.rows.sum())
        problem = self.problem if n_rows == 1 else f"{self.problem} (and {n_rows - 1} more rows)"
        row = int(table.index[int(np.argmax(self.rows))]) + 1
        column = info.columns.get(self.column, self.column)
        return BadRecordingError(info.file or info.id, problem, f"{self.remedy}{hint}", column, row)


def require_columns(found: list[str], required: tuple[str, ...], file: str) -> None:
    """Raise BadRecordingError if one of the required columns is missing."""
    for name in required:
        if name not in found:
            raise BadRecordingError(file, "the column is missing", f"add it; found: {', '.join(found)}", name)
