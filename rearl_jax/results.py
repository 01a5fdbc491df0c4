"""The folder of one study: Parquet tables with their provenance inside, `summary.json`, `config.json`.

Files are written atomically. Provenance contains everything that determines the figures, and nothing that changes
between equal runs (no time, no host, no environment variables), so that a resumed study equals an uninterrupted one.
"""

import hashlib
import json
import logging
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from rearl_jax.code_version import __version__, code_hash, git_sha
from rearl_jax.config._schema import as_plain
from rearl_jax.file_record import FileRecord
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import claim, remove_leftovers, replacing

if TYPE_CHECKING:
    import pandas

log = logging.getLogger(__name__)

UNHASHED = ("study", "results")
"""Keys of a task that do not change its results."""

SAME = ("task", "config_hash", "code_hash", "data_id")
"""Provenance that must be equal for results to belong to the same study."""

PROVENANCE = ("task", "study", "config_hash", "code_version", "code_hash", "git_sha", "data_id", "generated")
"""Keys of the provenance in every file of results."""

PREFIX = "rearl_jax."
"""Prefix of every key in the schema metadata of a Parquet file."""


class Study:
    """One folder of results, `root/name`.

    The metadata of each table contain `task`, `study`, `config_hash`, `config` (JSON), `code_version`, `code_hash`,
    `git_sha` (in a git checkout), `data_id` (if data were read), `generated` (`true` if any data were generated), and
    what the writer adds (seeds, definitions). `read_metadata` reads it back.
    """

    def __init__(
        self,
        root: str | Path,
        name: str,
        config: object,
        task: str,
        data_id: str | None = None,
        *,
        generated: bool = False,
    ) -> None:
        """Makes the folder.

        Args:
            root: Folder of all studies (`results.root`).
            name: Name of this one; `a/b` is a folder in a folder, as a multirun makes them.
            config: The task's configuration record.
            task: The task that writes, e.g. `evaluate`.
            data_id: Identity of the data read.
            generated: Whether any of the data were generated, not measured.

        Raises:
            ValueError: The name does not stay inside the root.
        """
        self.path = path_inside(Path(root), name, "study")
        self._config = as_plain(config)
        values = (task, name, config_hash(config), __version__, code_hash(), git_sha(), data_id, generated)
        self._claim: object = None
        self._files = FileRecord(self.path)
        self._provenance: dict[str, Any] = dict(zip(PROVENANCE, values, strict=True))
        self.path.mkdir(parents=True, exist_ok=True)
        remove_leftovers(self.path)

    def begin(self, *, resume: bool, reusable: Collection[str] = (), needed: Collection[str] = ()) -> Any:
        """The summary of a study that is finished and not to be repeated; else None, and config.json is written.

        Args:
            resume: Whether a finished study of the same task, configuration, data and code is skipped.
            reusable: As in `write_config`.
            needed: As in `finished_summary`.

        Raises:
            FolderInUseError: Another process writes to the folder.
            InvalidInputError: As in `write_config`.
        """
        if resume and (stored := self.finished_summary(needed)) is not None:
            log.info("finished before: %s", self.path)
            return stored
        self.write_config(reusable)
        return None

    def write_table(self, name: str, frame: "pandas.DataFrame", **metadata: str) -> Path:
        """Path of `name.parquet`, written with the provenance and `metadata` in its schema.

        Args:
            name: File name without its ending.
            frame: The table; its index must be the plain row number, since an index is not written.
            **metadata: What else the reader must know, e.g. `seeds="0,1,2"`, `mape_definition="A"`.

        Raises:
            ValueError: The frame has an index of its own, or `metadata` repeats a provenance key.
        """
        import pyarrow
        from pyarrow import parquet

        if frame.index.names != [None] or frame.index.nlevels != 1:
            message = f"the table has the index {frame.index.names}: call reset_index() first"
            raise InvalidInputError(Problem("table-with-index", message, file=name))
        provenance = {**self._provenance, "config": json.dumps(self._config, sort_keys=True)}
        _refuse_repeated(metadata, provenance, f"table {name!r}")
        texts = {key: _as_text(value) for key, value in (provenance | metadata).items() if value is not None}
        table = pyarrow.Table.from_pandas(frame, preserve_index=False)
        table = table.replace_schema_metadata(
            {**(table.schema.metadata or {}), **{PREFIX + key: text for key, text in texts.items()}}
        )
        return self._write(f"{name}.parquet", lambda path: parquet.write_table(table, path))

    def owns(self, name: str) -> bool:
        """True if the table `name` is there, whole, and of the same task, configuration, data and code."""
        path = path_inside(self.path, f"{name}.parquet", "file")
        try:
            metadata = read_metadata(path)
        except (OSError, ValueError):  # not there, or what pyarrow raises for a file that is not Parquet
            return False
        wanted = {key: self._provenance[key] for key in SAME if self._provenance[key] is not None}
        return all(metadata.get(key) == _as_text(value) for key, value in wanted.items())

    def unknown_files(self, name: str) -> list[str]:
        """Names of the files in a folder of the study that no study there has recorded and that are not its own."""
        recorded = self._files.names()
        found = sorted(path for path in (self.path / name).glob("*") if not path.name.startswith("."))
        unrecorded = [path for path in found if path.is_file() and f"{name}/{path.name}" not in recorded]
        return [path.name for path in unrecorded if path.suffix != ".parquet" or not self.owns(f"{name}/{path.stem}")]

    def finished_parts(self, name: str) -> set[int]:
        """Numbers of the parts of a table that need not be made again; all other files of the table are removed.

        Part 3 is written as the table `part_name(name, 3)`; together they are read as one table from the folder `name`.
        """
        kept = set()
        for path in sorted(path_inside(self.path, name, "table").glob("*")):
            number = re.fullmatch(r"part-(\d+)", path.stem)
            if number and path.suffix == ".parquet" and self.owns(f"{name}/{path.stem}"):
                kept.add(int(number[1]))
            else:
                path.unlink(missing_ok=True)
        return kept

    def finished_summary(self, needed: Collection[str] = ()) -> Any:
        """The summary, which is written last, if it is of the same task, configuration, data and code and if the files
        `needed` are there too; else None.
        """
        if not all((self.path / name).is_file() for name in needed):
            return None
        try:
            summary = read_summary(self.path)
        except (FileNotFoundError, ValueError):
            return None
        first = first_part(summary)
        is_same = isinstance(first, dict) and all(first.get(key) == self._provenance[key] for key in SAME)
        return summary if is_same else None

    def write_summary(self, summary: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> Path:
        """Path of `summary.json`: the provenance and the figures of the task under documented keys.

        Args:
            summary: Numbers, strings, booleans and None; a value may be one flat object or a list of flat
                objects, never deeper. A list of flat summaries (one per method) becomes a list of objects,
                each with the provenance.

        Raises:
            ValueError: A number is NaN or infinite (write None if there is no figure), a value is of
                another type or nested deeper, or a key repeats the provenance.
        """
        parts = [summary] if isinstance(summary, Mapping) else list(summary)
        for part in parts:
            _refuse_repeated(part, self._provenance, "summary")
        if isinstance(summary, Mapping):
            checked = {key: _summary_value(key, value) for key, value in summary.items()}
            whole: object = self._provenance | checked
        else:
            whole = [self._provenance | _flat_object(f"[{i}]", part) for i, part in enumerate(parts)]
        return self.write_text("summary.json", json.dumps(whole, indent=2, allow_nan=False) + "\n")

    def write_config(self, reusable: Collection[str] = ()) -> Path:
        """Path of `config.json`: every key of the task with the value that was used.

        From here on no other process may write to the folder, until this object is dropped, and the study is not
        finished: an earlier summary is removed, and so are the files of another task, configuration, data or code.

        Args:
            reusable: Beginnings of the names of files that stay, because the task checks by itself whether they can be
                used.

        Raises:
            FolderInUseError: Another process writes to it.
            InvalidInputError: The configuration names files in the folder that would be removed.
        """
        self._claim = claim(self.path)
        self._files.begin({key: self._provenance[key] for key in SAME}, self._config, reusable)
        (self.path / "summary.json").unlink(missing_ok=True)
        return self.write_text("config.json", json.dumps(self._config, indent=2, allow_nan=False) + "\n")

    def write_text(self, name: str, text: str) -> Path:
        """Path of the file `name` (with its ending) holding the text in UTF-8."""
        return self.write_bytes(name, text.encode("utf-8"))

    def write_bytes(self, name: str, content: bytes) -> Path:
        """Path of the file `name` (with its ending) holding the content."""
        return self._write(name, lambda path: path.write_bytes(content))

    def recorded_path(self, name: str) -> Path:
        """Path of a file of this study that the caller writes; with `/` at the end, of a study inside this one."""
        self._files.add(name)
        return path_inside(self.path, name, "file")

    def _write(self, name: str, write: Callable[[Path], object]) -> Path:
        path = self.recorded_path(name)
        with replacing(path) as unfinished:
            write(unfinished)
        return path


def cell_folder(folder: Path, keys: Mapping[str, str]) -> Path:
    """Folder of the results of one job of a multirun.

    Args:
        folder: Folder of the multirun.
        keys: Values of the swept keys in this job.
    """
    return folder.joinpath(*sorted(f"{key}={value}" for key, value in keys.items()))


def first_part(summary: Any) -> Any:
    """The first object of a `summary.json`, which may be a list of objects; each contains the provenance."""
    return summary[0] if isinstance(summary, list) and summary else summary


def read_summary(folder: Path) -> Any:
    """The content of the `summary.json` in a folder.

    Raises:
        FileNotFoundError, ValueError: There is none, or it is not JSON.
    """
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def without_provenance(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of an object of `summary.json`."""
    return {key: value for key, value in summary.items() if key not in PROVENANCE}


def part_name(table: str, number: int) -> str:
    """Name of one part of a table that is written piece by piece."""
    return f"{table}/part-{number:05d}"


def read_metadata(path: str | Path) -> dict[str, str]:
    """The provenance stored in a Parquet file by `Study.write_table`, without the prefix of its keys."""
    from pyarrow import parquet

    stored = parquet.read_schema(path).metadata or {}
    pairs = ((key.decode(), value.decode()) for key, value in stored.items())
    return {key.removeprefix(PREFIX): value for key, value in pairs if key.startswith(PREFIX)}


def shared_config(config: object) -> Any:
    """The part of a task's configuration that changes its results, as plain values."""
    plain = as_plain(config)
    return {key: value for key, value in plain.items() if key not in UNHASHED} if isinstance(plain, dict) else plain


def config_hash(config: object) -> str:
    """Sixteen hexadecimal digits that are equal if everything but `study` and `results` is equal."""
    text = json.dumps(shared_config(config), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def path_inside(root: Path, name: str, kind: str) -> Path:
    """Path of a study, file or table (`kind`, for the message) inside a folder.

    Raises:
        InvalidInputError: The name does not stay inside the folder.
    """
    parts = PurePosixPath(name).parts
    if not parts or name.startswith("/") or ".." in parts or "\\" in name:
        message = f"must be the name of a {kind} inside {root}: write letters, digits, - _"
        raise InvalidInputError(Problem("name-unusable", message, key=kind, value=repr(name)))
    return root.joinpath(*parts)


def _refuse_repeated(given: Mapping[str, Any], provenance: Mapping[str, Any], where: str) -> None:
    """Raise InvalidInputError if given keys belong to the provenance."""
    repeated = sorted(given.keys() & provenance.keys())
    if repeated:
        message = "belongs to the provenance, which is written automatically"
        raise InvalidInputError(Problem("provenance-repeated", message, key=repeated[0], file=where))


def _as_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _summary_value(key: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        return _flat_object(key, value)
    if isinstance(value, (list, tuple)):
        return [_flat_object(f"{key}[{index}]", item) for index, item in enumerate(value)]
    return _scalar(key, value)


def _flat_object(key: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        message = "must be an object: lists hold one per row"
        raise InvalidInputError(Problem("wrong-type", message, key=key, file="summary", value=type(value).__name__))
    return {name: _scalar(f"{key}.{name}", item) for name, item in value.items()}


def _scalar(key: str, value: Any) -> Any:
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # NumPy and JAX scalars
        value = value.item()
    if value is not None and not isinstance(value, (str, bool, int, float)):
        message = "must be a number, a text or None"
        raise InvalidInputError(Problem("wrong-type", message, key=key, file="summary", value=type(value).__name__))
    if isinstance(value, float) and not math.isfinite(value):
        message = "must be None if there is no figure"
        raise InvalidInputError(Problem("not-finite", message, key=key, file="summary", value=value))
    return value
