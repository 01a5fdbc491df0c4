"""Canonical tables in files: Parquet or CSV in the columns of `schema.COLUMNS`, read and written.

A file may hold several recordings, told apart by its column `recording`. What is known besides the rows
(frame rate, lanes, licence) stands in the metadata of a Parquet file, or beside a CSV file in
`<file>.info.json`; for tables without it, it is worked out from the rows and a note says so.
"""

import json
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.config.data import DataConfig
from rearl_jax.data.columnar import column_names, read_columns, stored_text
from rearl_jax.data.delimited import read_csv, read_header, stem_of, text_endings
from rearl_jax.data.folder import recordings_missing, visible_files
from rearl_jax.data.labels import with_labels
from rearl_jax.data.losses import Losses
from rearl_jax.data.problems import bad_recording, recording_unnamed, require_columns
from rearl_jax.data.row_info import info_of_rows
from rearl_jax.data.schema import COLUMNS, REQUIRED, Recording, RecordingInfo, validate
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import replacing

METADATA = "recordings"
"""Name of the metadata with the RecordingInfo of every recording; rearl_jax.recordings in Parquet."""

_NAMES = tuple(column.name for column in COLUMNS)
_ENDINGS = (".parquet", *text_endings(".csv"))
_TEXTS = tuple(column.name for column in COLUMNS if column.dtype == "category")


def find_tables(root: Path) -> list[Path]:
    """The Parquet and CSV files in the folder, or the one file that is named.

    Raises:
        FileNotFoundError: There is none.
    """
    found = [root] if root.name.lower().endswith(_ENDINGS) and root.is_file() else visible_files(root, _ENDINGS)
    if not found:
        wanted = f"a table, or a folder of tables, with the columns {', '.join(REQUIRED)}, as `rearl prepare` writes"
        raise recordings_missing("no .parquet or .csv", root, wanted, _ENDINGS)
    return found


class TableFile:
    """A file of canonical tables; rows are read when they are asked for."""

    def __init__(self, path: Path, policy: DataConfig) -> None:
        self.path = path
        self._policy = policy
        self._is_csv = path.suffix.lower() != ".parquet"
        self._kept: dict[tuple[str, ...], tuple[pd.DataFrame, int]] = {}

    def recordings(self) -> list[str]:
        """Ids of the recordings in the file."""
        if "recording" not in self._columns:
            return [stem_of(self.path)]
        if self._is_csv:
            # Not through self._csv: a folder of many files is listed without keeping their rows.
            rows, _ = read_csv(self.path, {"recording": pa.string()}, self._policy.on_bad)
            names = rows["recording"].unique().to_pandas()
        else:
            names = pd.Series(read_columns(self.path, (), ("recording",))["recording"].unique())
        if names.isna().any():
            raise recording_unnamed(str(self.path))
        return [str(name) for name in names]

    def read(self, recording: str, labels: Sequence[str] = ()) -> Recording:
        """One recording of the file, checked.

        Args:
            recording: Its id.
            labels: Columns that are labels of its tracks, beside those that the file states itself.

        Raises:
            BadRecordingError: The file or a row breaks the schema.
        """
        if not set(self._columns) & set(REQUIRED):
            text = f"the file is no table of trajectories: its columns are {', '.join(self._columns[:8])}"
            remedy = f"move it out of the folder, or give it the columns {', '.join(REQUIRED)}"
            raise bad_recording("not-a-table", text, remedy, self.path)
        require_columns(self._columns, REQUIRED, str(self.path))
        losses = Losses()
        stated = self.stated()
        further = [name for name in self._columns if name not in _NAMES]
        of_file = [label for info in stated.values() for label in info.labels]
        texts = tuple(name for name in dict.fromkeys([*of_file, *labels]) if name in further)
        if self._is_csv:
            rows, n_broken = self._csv(texts)
            if n_broken:
                losses.counts["broken_line"] = n_broken
        else:
            rows = self._parquet_rows(recording, texts)
        if "recording" in rows:
            rows = rows.iloc[np.flatnonzero(rows["recording"].to_numpy() == recording)]
        info = stated.get(recording)
        if info is None:
            rows, info = info_of_rows(recording, rows, str(self.path), self.path.name)
        info = with_labels(info, labels, further)
        table, dropped = validate(rows, info, self._policy, losses)
        return Recording(info, table, dropped)

    @cached_property
    def _columns(self) -> list[str]:
        if self._is_csv:
            return read_header(self.path)
        return column_names(self.path)

    def _csv(self, labels: tuple[str, ...]) -> tuple[pd.DataFrame, int]:
        # Kept: several recordings may share the file, and CSV cannot be read in part.
        if labels not in self._kept:
            wanted = [column for column in COLUMNS if column.name in self._columns]
            types = {c.name: pa.string() if c.name in _TEXTS else pa.float64() for c in wanted}
            types |= dict.fromkeys(labels, pa.string())
            rows, n_broken = read_csv(self.path, types, self._policy.on_bad)
            self._kept = {labels: (rows.to_pandas(), n_broken)}
        return self._kept[labels]

    def _parquet_rows(self, recording: str, labels: tuple[str, ...]) -> pd.DataFrame:
        texts = [name for name in _TEXTS if name in self._columns]
        numbers = [name for name in _NAMES if name in self._columns and name not in _TEXTS]
        if "recording" not in self._columns:
            return read_columns(self.path, numbers, texts, either=labels)
        names = read_columns(self.path, (), ("recording",))["recording"].to_numpy()
        rows = read_columns(self.path, numbers, texts, either=labels, only=("recording", recording))
        return rows.set_axis(np.flatnonzero(names == recording), axis=0)

    def stated(self) -> dict[str, RecordingInfo]:
        """Metadata of the recordings that the file states, by id."""
        if self._is_csv:
            file = sidecar(self.path)
            stored = file.read_bytes() if file.is_file() else None
        else:
            file = self.path
            stored = stored_text(file, f"rearl_jax.{METADATA}")
        try:
            infos = [RecordingInfo.from_json(info, file=str(self.path)) for info in json.loads(stored or "[]")]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
            text = f"its statements about the recordings cannot be used: {type(error).__name__}: {error}"
            raise bad_recording(
                "metadata-unusable", text, "correct it, or remove it to have it derived from the rows", file
            ) from None
        return {info.id: info for info in infos}


def describe(infos: Iterable[RecordingInfo]) -> str:
    """The metadata of recordings as JSON, to be stored beside their rows under METADATA."""
    return json.dumps([info.to_json() for info in infos], allow_nan=False)


def write_recording(recording: Recording, path: Path) -> Path:
    """Path of the canonical table, written whole or not at all, as .parquet or .csv by its ending.

    Raises:
        ValueError: Another ending.
    """
    if path.suffix not in (".parquet", ".csv"):
        raise InvalidInputError(Problem("ending-unknown", "the name must end in .parquet or .csv", file=str(path)))
    text = describe([recording.info])
    if path.suffix == ".csv":
        with replacing(sidecar(path)) as unfinished:
            unfinished.write_text(text, encoding="utf-8")
        with replacing(path) as unfinished:
            recording.table.to_csv(unfinished, index=False)
    else:
        table = pa.Table.from_pandas(recording.table, preserve_index=False)
        metadata = {**(table.schema.metadata or {}), f"rearl_jax.{METADATA}": text}
        with replacing(path) as unfinished:
            pq.write_table(table.replace_schema_metadata(metadata), unfinished)
    return path


def sidecar(path: Path) -> Path:
    """Optional file with the metadata of a CSV table, which a Parquet file holds itself."""
    return path.with_name(f"{path.name}.info.json")
