"""Record of the files that a study has written into its folder, so that the next study there can remove them.

Without removal, files of two studies in one folder would be read as one study. The record and the lock are stored next
to the folder: a line of JSON that identifies the study, then one file name per line. Files outside the record, such as
a user's own, are kept.
"""

import json
import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path, PurePath
from typing import Any

from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import naming, remove_leftovers, replacing

_NOT_READ = ("study", "results")
"""Keys of a task that name the folder itself."""


class FileRecord:
    """Names of the files of the study in one folder."""

    def __init__(self, folder: Path) -> None:
        """Prepares the record; nothing is read yet."""
        self._folder = folder
        self._file = folder.with_name(f".{folder.name}.files")
        self._names: set[str] | None = None

    def begin(self, identity: Mapping[str, Any], config: Any, reusable: Collection[str] = ()) -> None:
        """Removes the files of another study and starts the record; the same study continues its own.

        Args:
            identity: Values that are equal in two runs of the same study.
            config: Plain values of its configuration.
            reusable: Prefixes of names of files that the study itself checks before it reads them.

        Raises:
            InvalidInputError: A key of the configuration names a file of the other study, which would be removed.
        """
        header, names = self._read()
        wanted = json.dumps(identity, sort_keys=True)
        stale = [] if header == wanted else [name for name in names if not name.startswith(tuple(reusable))]
        self._refuse_inputs(stale, config)
        # The summary first, because what is left of a study without it counts as unfinished.
        self._remove(sorted(stale, key=lambda name: PurePath(name).name != "summary.json"))
        self._names = set(names) - set(stale)
        remove_leftovers(self._file.parent, below=False)
        # Also for the same study, because a full disk can have cut the last line.
        with replacing(self._file) as unfinished:
            unfinished.write_text("".join(f"{line}\n" for line in (wanted, *sorted(self._names))), encoding="utf-8")

    def names(self) -> list[str]:
        """Names of the files that are recorded for this or an earlier study in the folder."""
        return self._read()[1]

    def add(self, name: str) -> None:
        """Records a file, or with `/` at its end the folder of a study inside; nothing without `begin`."""
        if self._names is None or name in self._names:
            return
        self._names.add(name)
        with naming(self._file), self._file.open("a", encoding="utf-8") as file:
            file.write(f"{name}\n")

    def _read(self) -> tuple[str, list[str]]:
        """Identity of the recorded study and the names of its files; empty without a record."""
        try:
            lines = self._file.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):
            return "", []
        # A record that somebody has changed must not lead to files elsewhere.
        return (lines[0], [name for name in lines[1:] if _is_inside(name)]) if lines else ("", [])

    def _remove(self, names: Collection[str]) -> None:
        for name in names:
            path = self._folder / name
            if name.endswith("/"):
                inside = FileRecord(path)
                inside._remove(inside._read()[1])
                inside._file.unlink(missing_ok=True)
            else:
                path.unlink(missing_ok=True)
            for parent in (path, *path.parents):
                if parent == self._folder or self._folder not in parent.parents:
                    break
                if parent.is_dir() and not any(parent.iterdir()):
                    parent.rmdir()

    def _refuse_inputs(self, stale: Collection[str], config: Any) -> None:
        files = [path.resolve() for name in stale if (path := self._folder / name).exists()]
        folder = self._folder.resolve()
        for key, text in _texts(config) if files else ():
            # Unlike Path.exists, this is false for a text that cannot be a path.
            if not os.path.exists(text):
                continue
            path = Path(text).resolve()
            if folder in (path, *path.parents) and any(path in (file, *file.parents) for file in files):
                fault = "names results in the folder of this study, which removes those of an earlier one"
                remedy = "choose another folder with study=NAME"
                raise InvalidInputError(Problem("input-in-study", fault, remedy, file=str(folder), key=key, value=text))


def _is_inside(name: str) -> bool:
    return not PurePath(name).is_absolute() and ".." not in PurePath(name).parts


def _texts(config: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Every text of a configuration with its full key."""
    if isinstance(config, str):
        yield key, config
    elif isinstance(config, Mapping):
        for name, value in config.items():
            if key or name not in _NOT_READ:
                yield from _texts(value, f"{key}.{name}" if key else str(name))
    elif isinstance(config, (list, tuple)):
        for value in config:
            yield from _texts(value, key)
