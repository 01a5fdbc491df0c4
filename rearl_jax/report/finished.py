"""The folder of a finished study: its configuration, its summary, its tables and figures."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from rearl_jax.config._schema import from_plain
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.document.document import DataSource, data_sources
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem
from rearl_jax.results import PROVENANCE, config_hash, path_inside, read_metadata
from rearl_jax.tasks import TASKS, Task


@dataclass(frozen=True)
class FinishedStudy:
    """A finished study.

    Attributes:
        path: Folder of the study.
        task: The task that wrote it.
        config: The task's record, as in config.json.
        provenance: Origin of the figures, as in every file.
        rows: The objects of summary.json; one for most tasks, one per row of the table for `evaluate`.
    """

    path: Path
    task: Task
    config: Any
    provenance: Mapping[str, Any]
    rows: tuple[Mapping[str, Any], ...]

    @property
    def generated(self) -> bool:
        """True if the recordings were generated, not measured."""
        return bool(self.provenance["generated"])

    @property
    def has_new_keys(self) -> bool:
        """True if the record has keys that did not exist when the study was made."""
        return config_hash(self.config) != self.provenance["config_hash"]

    @property
    def remedy(self) -> str:
        """Remedy for a study that this version cannot read."""
        return f"run it again with this version: rearl {self.task.words} study={self.config.study} ..."

    def table(self, name: str, columns: tuple[str, ...] = ()) -> pd.DataFrame:
        """The Parquet table of that name, which must have these columns.

        Raises:
            FileNotFoundError, ValueError: The file does not exist, is not a Parquet file, or lacks a column.
        """
        path = self.path / f"{name}.parquet"
        if not path.exists():
            raise MissingInputError(Problem("file-missing", "the file is missing", self.remedy, file=str(path)))
        try:
            table = pd.read_parquet(path)
        except (OSError, ValueError) as error:  # what pyarrow raises for a file that is not Parquet
            message = f"the file cannot be read ({error})"
            raise InvalidInputError(Problem("not-parquet", message, self.remedy, file=str(path))) from error
        self._require(table, columns, path.name)
        return table

    def has_table(self, name: str) -> bool:
        """True if there is a Parquet table of that name."""
        return (self.path / f"{name}.parquet").exists()

    def metadata(self, name: str) -> dict[str, str]:
        """Metadata of the Parquet table of that name, see `results.read_metadata`."""
        return read_metadata(self.path / f"{name}.parquet")

    def object(self, name: str, keys: tuple[str, ...]) -> Mapping[str, Any]:
        """The object in the JSON file `name`, with the required keys.

        Raises:
            FileNotFoundError, ValueError: The file does not exist, is no such object, or lacks a key.
        """
        content = _read_json(self.path / name, self.remedy)
        return self._with_keys([content], keys, name)[0]

    def objects(self, name: str, keys: tuple[str, ...]) -> Sequence[Mapping[str, Any]]:
        """The list of objects in the JSON file `name`, each with the required keys.

        Raises:
            FileNotFoundError, ValueError: As of `object`.
        """
        content = _read_json(self.path / name, self.remedy)
        return self._with_keys(content if isinstance(content, list) else [content], keys, name)

    def summary(self, keys: tuple[str, ...] = ()) -> Mapping[str, Any]:
        """The first object of summary.json, the only one of all tasks but `evaluate`, with the required keys.

        Raises:
            ValueError: It lacks a key.
        """
        self._require(self.rows[0], keys, "summary.json")
        return self.rows[0]

    @property
    def figures(self) -> dict[str, bytes]:
        """PNG files of the folder by name."""
        return {path.stem: path.read_bytes() for path in self.path.glob("*.png")}

    @property
    def sources(self) -> tuple[DataSource, ...]:
        """Data set of the first recording that the configuration names; empty for a task without recordings.

        Raises:
            OSError, ValueError: There is no recording, or it is invalid.
        """
        if not hasattr(self.config, "data"):
            return ()
        return data_sources([next(iterate_recordings(self.config.data)).info])

    def _with_keys(self, objects: list[Any], keys: tuple[str, ...], name: str) -> Sequence[Mapping[str, Any]]:
        """The objects in the file `name` after a check that they are objects and have the keys."""
        for content in objects:
            if not isinstance(content, dict):
                file = str(self.path / name)
                raise InvalidInputError(Problem("not-an-object", "must contain objects", self.remedy, file=file))
            self._require(content, keys, name)
        return objects

    def _require(self, content: Mapping[str, Any] | pd.DataFrame, names: tuple[str, ...], file_name: str) -> None:
        """Raise InvalidInputError if an object or a table lacks keys or columns, as those of an older version may."""
        for name in names:
            if name not in content:
                message = (
                    f"is missing: the study is of version {self.provenance['code_version']}, which wrote other figures"
                )
                file = str(self.path / file_name)
                raise InvalidInputError(Problem("key-missing", message, self.remedy, file=file, key=name))


def read_finished(root: str, name: str) -> FinishedStudy:
    """The study of that name below the folder of all studies.

    Raises:
        FileNotFoundError: There is no such study, or it is not finished.
        ValueError: The name leads out of the folder, or the study is of a version with other keys or tasks.
    """
    path = path_inside(Path(root), name, "study")
    if not path.is_dir():
        finished = sorted(file.parent.relative_to(root).as_posix() for file in Path(root).glob("*/summary.json"))
        known = f"finished studies there: {', '.join(finished[:10])}" if finished else "no study there is finished"
        message = f"must name a folder in {root}; {known} (results.root names the folder)"
        raise MissingInputError(Problem("study-missing", message, key="study", value=name))
    if not (path / "config.json").exists():
        message = "this is not a folder of a study, it has no config.json: set study or results.root"
        raise MissingInputError(Problem("no-study", message, file=str(path)))
    if not (path / "summary.json").exists():
        message = "the study is not finished, it has no summary.json, which is written last"
        raise MissingInputError(
            Problem("study-unfinished", message, "let it finish, or run its task again", file=str(path))
        )
    rerun = "run the study again with this version"
    summary = _read_json(path / "summary.json", rerun)
    rows = tuple(summary) if isinstance(summary, list) else (summary,)
    if not rows or not all(isinstance(row, dict) and row.keys() >= set(PROVENANCE) for row in rows):
        message = "the file does not state the origin of its figures"
        raise InvalidInputError(Problem("provenance-missing", message, rerun, file=str(path / "summary.json")))
    provenance = {key: rows[0][key] for key in PROVENANCE}
    task = next((task for task in TASKS if task.words == provenance["task"]), None)
    if task is None:
        message = f"is {provenance['task']!r}, which this version does not have"
        raise InvalidInputError(Problem("task-unknown", message, file=str(path / "summary.json"), key="task"))
    stored = _read_json(path / "config.json", rerun)
    try:
        config = from_plain(task.load_config(), stored)
    except InvalidInputError as error:
        remedy = f"the study is of version {provenance['code_version']}: {rerun}, rearl {task.words} study={name} ..."
        file = str(path / "config.json")
        raise InvalidInputError(replace(error.problem, file=file, remedy=remedy)) from error
    return FinishedStudy(path, task, config, provenance, rows)


def _read_json(path: Path, remedy: str) -> Any:
    if not path.exists():
        raise MissingInputError(Problem("file-missing", "the file is missing", remedy, file=str(path)))
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        message = f"the file is not JSON ({error})"
        raise InvalidInputError(Problem("not-json", message, remedy, file=str(path))) from error
