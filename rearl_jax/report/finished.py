"""The folder of a finished study: what it was asked for, what it found, its tables and figures."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import pandas as pd

from rearl_jax.config._schema import from_plain
from rearl_jax.results import PROVENANCE, config_hash
from rearl_jax.tasks import TASKS, Task


@dataclass(frozen=True)
class FinishedStudy:
    """A study that has come to its end.

    Attributes:
        path: Its folder.
        task: The task that wrote it.
        config: The task's record, as in config.json.
        provenance: What every file says about where it comes from.
        rows: The objects of summary.json; one for most tasks, one per row of the table for `evaluate`.
    """

    path: Path
    task: Task
    config: Any
    provenance: Mapping[str, Any]
    rows: tuple[Mapping[str, Any], ...]

    @property
    def generated(self) -> bool:
        """Whether the recordings are no measurements."""
        return bool(self.provenance["generated"])

    @property
    def has_new_keys(self) -> bool:
        """Whether the record has keys that did not exist when the study was made."""
        return config_hash(self.config) != self.provenance["config_hash"]

    @property
    def again(self) -> str:
        """What to do about a study this version cannot read."""
        return f"run it again with this version: rearl {self.task.words} study={self.config.study} ..."

    def table(self, name: str) -> pd.DataFrame:
        """The Parquet table of that name.

        Raises:
            FileNotFoundError, ValueError: It is not there, or is no Parquet file.
        """
        path = self.path / f"{name}.parquet"
        if not path.exists():
            raise FileNotFoundError(f"{path} is missing: {self.again}")
        try:
            return pd.read_parquet(path)
        except (OSError, ValueError) as error:  # what pyarrow raises for a file that is no Parquet
            raise ValueError(f"{path} cannot be read ({error}): {self.again}") from error

    def object(self, name: str) -> Any:
        """The content of the JSON file `name`.

        Raises:
            FileNotFoundError, ValueError: It is not there, or is no JSON.
        """
        return _read_json(self.path / name, self.again)

    def figures(self, first: Iterable[str]) -> dict[str, bytes]:
        """PNG files of the folder by name.

        Args:
            first: Names of those that come first, in their order.
        """
        there = sorted(path.stem for path in self.path.glob("*.png"))
        names = [name for name in first if name in there]
        names += [name for name in there if name not in names]
        return {name: (self.path / f"{name}.png").read_bytes() for name in names}

    def needs(self, found: Mapping[str, Any] | pd.DataFrame, names: tuple[str, ...], where: str) -> None:
        """Raise ValueError where keys or columns are not there, as in studies of an older version.

        Args:
            found: An object or a table of the study.
            names: Keys or columns that are needed.
            where: Name of its file.
        """
        for name in names:
            if name not in found:
                raise ValueError(
                    f"{self.path / where} has no {name}: the study is of version {self.provenance['code_version']}, "
                    f"which wrote other figures; {self.again}"
                )


def read_finished(root: str, name: str) -> FinishedStudy:
    """The study of that name.

    Args:
        root: Folder of all studies.
        name: Folder of the study in it.

    Raises:
        FileNotFoundError: There is no such study, or it did not come to its end.
        ValueError: The name does not stay inside the folder, or the study is of a version with other keys or tasks.
    """
    parts = PurePosixPath(name).parts
    if not parts or name.startswith("/") or ".." in parts:
        raise ValueError(f"study={name!r} is no name of a study inside {root}: write the folder's name, e.g. evaluate")
    path = Path(root).joinpath(*parts)
    if not path.is_dir():
        there = sorted(file.parent.relative_to(root).as_posix() for file in Path(root).glob("*/summary.json"))
        known = f"finished studies there: {', '.join(there[:10])}" if there else "no study there is finished"
        raise FileNotFoundError(f"study={name}: there is no folder {path}; {known} (results.root names the folder)")
    if not (path / "config.json").exists():
        raise FileNotFoundError(f"{path} is no folder of a study: it has no config.json; set study or results.root")
    if not (path / "summary.json").exists():
        raise FileNotFoundError(
            f"study={name} is not finished: {path} has no summary.json, which is written last; let it finish, or run "
            "its task again"
        )
    again = "run the study again with this version"
    summary = _read_json(path / "summary.json", again)
    rows = tuple(summary) if isinstance(summary, list) else (summary,)
    if not rows or not all(isinstance(row, dict) and row.keys() >= set(PROVENANCE) for row in rows):
        raise ValueError(f"{path / 'summary.json'} does not say where its figures come from: {again}")
    provenance = {key: rows[0][key] for key in PROVENANCE}
    task = next((task for task in TASKS if task.words == provenance["task"]), None)
    if task is None:
        raise ValueError(f"{path / 'summary.json'} is of a task {provenance['task']!r} that this version does not have")
    stored = _read_json(path / "config.json", again)
    try:
        config = from_plain(task.load_config(), stored)
    except ValueError as error:
        raise ValueError(
            f"{path / 'config.json'}: {error}; the study is of version {provenance['code_version']}: {again}, "
            f"rearl {task.words} study={name} ..."
        ) from error
    return FinishedStudy(path, task, config, provenance, rows)


def _read_json(path: Path, again: str) -> Any:
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: {again}")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no JSON ({error}): {again}") from error
