"""The three files of a recording, written at once or not at all."""

from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from rearl_jax.data.generator.highd_tables import Table
from rearl_jax.whole_files import replacing

PARTS = ("tracks", "tracksMeta", "recordingMeta")
ROWS_AT_ONCE = 100_000


def recording_files(root: Path, recording_id: int) -> list[Path]:
    """Paths of a recording's three files, named as in highD."""
    return [root / f"{recording_id:02d}_{part}.csv" for part in PARTS]


def write_recording(root: Path, recording_id: int, tables: tuple[Table, Table, Table]) -> None:
    """Write the three tables of a recording; files in place are replaced."""
    for path, table in zip(recording_files(root, recording_id), tables, strict=True):
        _write_csv(path, table)


def _write_csv(path: Path, table: Table) -> None:
    n_rows = len(next(iter(table.values())))
    options = csv.WriteOptions(include_header=False, quoting_style="none", batch_size=8192)
    with replacing(path) as temporary, pa.OSFile(str(temporary), "wb") as file:
        file.write((",".join(table) + "\n").encode())
        for start in range(0, n_rows, ROWS_AT_ONCE):
            part = {name: _column(values[start : start + ROWS_AT_ONCE]) for name, values in table.items()}
            csv.write_csv(pa.table(part), file, options)


def _column(values: np.ndarray) -> pa.Array:
    """An Arrow array; floats as decimals, so that exactly two digits after the point are written."""
    if values.dtype.kind != "f":
        return pa.array(values)
    # A 128-bit decimal is its count of hundredths in two's complement, low half first.
    words = np.empty((len(values), 2), dtype="<i8")
    words[:, 0] = np.rint(100.0 * values)
    words[:, 1] = words[:, 0] >> 63
    return pa.Array.from_buffers(pa.decimal128(16, 2), len(values), [None, pa.py_buffer(words)])
