"""Tables in Parquet or text files, with the columns of `schema.COLUMNS` or others that `data.columns` names.

A file may hold several recordings, distinguished by its column `recording`. The metadata (frame rate, lanes, licence)
are inside a Parquet file, or in `<file>.info.json` in the folder of a CSV file. For tables without metadata they are
derived from the rows, which a note states.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.labels import with_labels
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.checks.stray_rows import require_own_rows, without_blanks
from rearl_jax.data.files.columnar import column_names, is_parquet, is_text, read_columns, stored_text
from rearl_jax.data.files.delimited import read_csv, read_header, stem_of, text_endings
from rearl_jax.data.files.folder import named_files, recordings_missing, tables_of_study, tell_of_unfinished
from rearl_jax.data.files.text_layout import layout_of
from rearl_jax.data.problems import BadRecordingError, bad_recording, recording_unnamed, source_row
from rearl_jax.data.schema import COLUMNS, Recording, RecordingInfo, validate
from rearl_jax.data.tables.completion import completed
from rearl_jax.data.tables.row_info import info_of_rows, with_lanes_left
from rearl_jax.data.tables.spelling import ENDS, Spelling, on_unread, require_needed_columns, spelling_of
from rearl_jax.data.tables.track_names import IDS, MAX_EXACT_ID
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import replacing

METADATA = "recordings"
"""Name of the metadata with the RecordingInfo of every recording; rearl_jax.recordings in Parquet."""

_NAMES = tuple(column.name for column in COLUMNS)
_MOVING = {"position", "x", "speed", "frame", "time", *ENDS}
"""Columns by which a table of trajectories is recognised; it has at least one, also under another name."""
_ENDINGS = (".parquet", *text_endings(".csv"))
_TEXTS = tuple(column.name for column in COLUMNS if column.dtype == "category")


def find_tables(root: Path) -> list[Path]:
    """The Parquet and CSV files in the folder, or the one file that is named.

    Raises:
        FileNotFoundError: There is none.
    """
    wanted = (
        "a table, or a folder of tables, one row per vehicle and frame; `rearl prepare FILE` prints how to read one"
    )
    if (tables := tables_of_study(root)) is not None:
        raise recordings_missing(f"the results of a task, with the recordings in {tables}", root, wanted)
    tell_of_unfinished(root)
    return named_files(root, _ENDINGS, wanted, ".parquet or .csv")


class TableFile:
    """A file of canonical tables; rows are read when they are asked for."""

    def __init__(self, path: Path, policy: DataConfig) -> None:
        self.path = path
        self._policy = policy
        self._is_csv = not is_parquet(path)
        self._kept: dict[tuple[str, ...], tuple[pd.DataFrame, int]] = {}
        self._has_own_rows = False  # once it is known that no recording holds rows of another one

    def recordings(self) -> list[str]:
        """Ids of the recordings in the file."""
        self._require_table()
        column = self._spelling.columns.get("recording")
        if column is None:
            return [stem_of(self.path)]
        if self._is_csv:
            # Not through self._csv: a folder of many files is listed without keeping their rows.
            rows, _ = read_csv(self.path, {column: pa.string()}, self._policy.on_bad)
            names = rows[column].to_pandas()
        else:
            names = pd.Series(read_columns(self.path, (), (column,))[column])
        found = without_blanks(pd.Series(names.unique())).unique()
        if pd.isna(found).any():
            raise recording_unnamed(str(self.path), column, source_row(names, without_blanks(names).isna().to_numpy()))
        return [str(name) for name in found]

    def read(self, recording: str, labels: Sequence[str] = ()) -> Recording:
        """One recording of the file, checked; with columns that are labels of its tracks beside those that it states.

        Raises:
            BadRecordingError: The file or a row breaks the schema.
        """
        spelling = self._spelling
        self._require_table()
        require_needed_columns(list(spelling.columns), str(self.path))
        losses = Losses()
        stated = self.stated()
        further = [name for name in self._columns if name not in (*_NAMES, *spelling.columns.values())]
        of_file = [label for info in stated.values() for label in info.labels]
        texts = tuple(name for name in dict.fromkeys([*of_file, *labels]) if name in further)
        if self._is_csv:
            rows, n_broken = self._csv(texts)
            losses.count("broken_line", n_broken)
        else:
            rows = self._parquet_rows(recording, texts)
        rows = spelling.renamed(rows)
        if "recording" in rows:
            rows = rows.assign(recording=without_blanks(pd.Series(rows["recording"])))
            self._require_own_rows(rows)
            rows = rows.iloc[np.flatnonzero(rows["recording"].to_numpy() == recording)]
        if rows.empty:
            text = "the table has no rows" + (" that are whole" if losses.counts else "")
            raise bad_recording("no-rows", text, "remove the file or complete it", self.path)
        rows, notes, added = completed(rows, spelling, self._policy, str(self.path))
        info = stated.get(recording)
        if info is None:
            self._require_known(stated)
            source = str(self.path), self.path.name
            rows, info = info_of_rows(recording, rows, *source, is_in_seconds=spelling.has_clock)
        unread = on_unread(spelling, self._policy, [name for name in further if name not in texts])
        info = replace(info, notes=tuple(dict.fromkeys([*info.notes, *notes, *self._remarks, *unread])))
        info = replace(info, columns=spelling.foreign)
        info = with_labels(info, (*labels, *added), [*further, *added])
        found = Recording(info, *validate(rows, info, self._policy, losses))
        return found if recording in stated else with_lanes_left(found)

    def _require_known(self, stated: dict[str, RecordingInfo]) -> None:
        """Raises BadRecordingError if metadata are stated, but for none of the recordings of the file."""
        if stated and not set(stated) & (known := set(self.recordings())):
            text = f"it states the recordings {', '.join(stated)}, and the table holds {', '.join(sorted(known)[:5])}"
            file = sidecar(self.path) if self._is_csv else self.path
            raise bad_recording("metadata-unusable", text, "correct the id, or remove what is stated", file)

    def _require_table(self) -> None:
        """Raises BadRecordingError if the file is something else, such as a list of vehicles."""
        given = set(self._spelling.columns)
        if not given & _MOVING:
            text = f"the file is not a table of trajectories: its columns are {', '.join(self._columns[:8])}"
            remedy = "move it out of the folder, or name its columns with data.columns; `rearl prepare FILE` finds them"
            raise bad_recording("not-a-table", text, remedy, self.path)

    def _require_own_rows(self, rows: pd.DataFrame) -> None:
        """Raises BadRecordingError if rows of one recording have the name of another; of Parquet, `rows` is a part."""
        if self._has_own_rows:
            return
        columns = self._spelling.columns
        if not self._is_csv:
            further = [columns[name] for name in ("track_id", "frame", "time") if name in columns]
            rows = self._spelling.renamed(read_columns(self.path, (), (columns["recording"],), either=further))
            rows = rows.assign(recording=without_blanks(pd.Series(rows["recording"])))
        require_own_rows(rows, str(self.path), columns["recording"])
        self._has_own_rows = True

    @cached_property
    def _columns(self) -> list[str]:
        if self._is_csv:
            return read_header(self.path)
        return column_names(self.path)

    @cached_property
    def _spelling(self) -> Spelling:
        return spelling_of(self._policy, self._columns, str(self.path))

    @cached_property
    def _remarks(self) -> tuple[str, ...]:
        """Notes on properties of a text table that were guessed."""
        return layout_of(self.path).remarks if self._is_csv else ()

    def _csv(self, labels: tuple[str, ...]) -> tuple[pd.DataFrame, int]:
        """All rows of the file under its names, and the number of broken lines."""
        # Kept: several recordings may share the file, and CSV cannot be read in part.
        if labels not in self._kept:
            types = {
                source: pa.string() if name in _TEXTS else pa.float64()
                for name, source in self._spelling.columns.items()
            }
            types |= dict.fromkeys(labels, pa.string())
            rows, n_broken = self._read_csv(types)
            self._kept = {labels: (rows.to_pandas(), n_broken)}
        return self._kept[labels]

    def _read_csv(self, types: dict[str, pa.DataType]) -> tuple[pa.Table, int]:
        """The columns; ids and times become texts if they are not numbers. Ids also become texts if they lose digits as
        numbers, or if different ids are the same number, as 7 and 007 are.
        """
        columns = self._spelling.columns
        ids = [columns[name] for name in IDS if name in columns]
        try:
            rows, n_broken = read_csv(self.path, types, self._policy.on_bad)
        except BadRecordingError as error:
            if error.code != "value-unreadable" or error.problem.column not in (*ids, columns.get("time")):
                raise
            at_fault = ids if error.problem.column in ids else [columns["time"]]
            if types[at_fault[0]] == pa.string():
                raise
            return self._read_csv(types | dict.fromkeys(at_fault, pa.string()))
        if any(_loses_digits(rows[source]) for source in ids):
            return self._read_csv(types | dict.fromkeys(ids, pa.string()))
        if self._repeats_ids(rows):
            track = columns["track_id"]
            texts, n_broken_texts = self._read_csv(types | dict.fromkeys(ids, pa.string()))
            if len(texts[track].unique()) > len(rows[track].unique()):
                return texts, n_broken_texts
        return rows, n_broken

    def _repeats_ids(self, rows: pa.Table) -> bool:
        """True if an id that was read as a number occurs twice at the same time, as 7 and 007 do."""
        named = (self._spelling.columns.get(name) for name in ("recording", "track_id", "frame", "time"))
        key = [source for source in named if source in rows.column_names]
        track = self._spelling.columns["track_id"]
        if len(key) < 2 or not pa.types.is_floating(rows[track].type):
            return False
        return bool(rows.select(key).to_pandas().duplicated().any())

    def _parquet_rows(self, recording: str, labels: tuple[str, ...]) -> pd.DataFrame:
        """Rows of a recording under the names of the file; the index holds their numbers in the file."""
        columns = self._spelling.columns
        texts = [source for name, source in columns.items() if name in _TEXTS]
        time = columns.get("time")
        id_or_time = [columns[name] for name in IDS if name in columns]
        id_or_time += [time] if time is not None and is_text(self.path, time) else []
        numbers = [source for source in columns.values() if source not in (*texts, *id_or_time)]
        either = (*id_or_time, *labels)
        if "recording" not in columns:
            return read_columns(self.path, numbers, texts, either=either)
        column = columns["recording"]
        names = without_blanks(pd.Series(read_columns(self.path, (), (column,))[column])).to_numpy()
        rows = read_columns(self.path, numbers, texts, either=either, only=(column, recording))
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
            found = json.loads(stored or "[]")
            objects = [found] if isinstance(found, dict) else found
            infos = [RecordingInfo.from_json(info, file=str(self.path)) for info in objects]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
            text = f"its statements about the recordings cannot be used: {type(error).__name__}: {error}"
            remedy = "correct it, or remove it to have it derived from the rows"
            raise bad_recording("metadata-unusable", text, remedy, file) from None
        return {info.id: info for info in infos}


def _loses_digits(ids: pa.ChunkedArray) -> bool:
    """True if ids that were read as float64 may differ from those in the file."""
    return pa.types.is_floating(ids.type) and bool(np.nanmax(np.abs(ids.to_numpy()), initial=0.0) > MAX_EXACT_ID)


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
        with replacing(path) as unfinished, replacing(sidecar(path)) as described:  # both are whole before they replace
            described.write_text(text, encoding="utf-8")
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
