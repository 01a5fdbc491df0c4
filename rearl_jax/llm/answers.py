"""The answers of language models, stored in an SQLite file: a request that was answered is never sent again.

Several processes of one machine may share a file. The first answer to a request is stored and returned to all later
processes, so all runs with the same file use the same answers.
"""

import os
import sqlite3
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from rearl_jax.cache import kept_folder
from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.records import TEXTS, TOKEN_COUNTS, Cause, Reply
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

_FORMAT = 1
"""Version of the table's layout, stored as the file's user_version."""

_APPLICATION = 0x5245414C
"""Application id of a file of answers: the letters REAL in ASCII."""

_LOCK_TIMEOUT = 60.0
"""Longest wait for another process that is writing to the file [s]."""

_BATCH_SIZE = 500
"""Requests looked up in one statement."""

_FIELDS = (*TEXTS, *TOKEN_COUNTS)

_TABLE = f"""
CREATE TABLE IF NOT EXISTS answers (
    digest TEXT PRIMARY KEY, model TEXT NOT NULL, profile TEXT NOT NULL,
    {", ".join([f"{name} TEXT NOT NULL" for name in TEXTS] + [f"{name} INTEGER" for name in TOKEN_COUNTS])}
) WITHOUT ROWID
"""


def answers_path(config: LlmConfig) -> Path:
    """The file of the answers: `llm.cache`, or `answers.sqlite` in the cache folder."""
    return Path(config.cache) if config.cache else kept_folder("llm") / "answers.sqlite"


class Answers:
    """Open file of answers; used by one thread at a time."""

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        """Opens the SQLite file, or creates it; with `read_only` it must exist.

        Raises:
            MissingInputError: There is no file to read.
            InvalidInputError: The file is damaged, is not a file of answers, or cannot be written.
        """
        self._path = path
        if read_only and not path.is_file():
            remedy = "run with decision.policy=llm first, or name the file with llm.cache"
            raise MissingInputError(
                Problem("answers-missing", "there are no answers to replay", remedy, file=str(path))
            )
        try:
            if not read_only:
                path.parent.mkdir(parents=True, exist_ok=True)
            self._database = sqlite3.connect(
                _uri(path, read_only), uri=True, timeout=_LOCK_TIMEOUT, isolation_level=None, check_same_thread=False
            )
        except (OSError, sqlite3.Error) as error:
            message = f"answers cannot be stored there ({error})"
            problem = Problem("answers-not-kept", message, "name another file with llm.cache", file=str(path))
            raise InvalidInputError(problem) from None
        try:
            self._prepare(read_only)
        except (sqlite3.Error, ValueError) as error:
            self._database.close()
            raise self._unreadable(error) from None

    def find(self, digests: Iterable[str]) -> dict[str, Reply]:
        """Stored answers to the given requests, by digest; a request without a stored answer is left out.

        Raises:
            InvalidInputError: The file is damaged.
        """
        wanted = list(digests)
        replies: dict[str, Reply] = {}
        try:
            for start in range(0, len(wanted), _BATCH_SIZE):
                part = wanted[start : start + _BATCH_SIZE]
                marks = ",".join("?" * len(part))
                rows = self._database.execute(
                    f"SELECT digest, {', '.join(_FIELDS)} FROM answers WHERE digest IN ({marks})", part
                )
                for digest, *values in rows:
                    _check(values)
                    kept = dict(zip(_FIELDS, values, strict=True))
                    replies[digest] = Reply(cause=Cause.answered, from_cache=True, **kept)
        except (sqlite3.Error, ValueError) as error:
            raise self._unreadable(error) from None
        return replies

    def keep(self, replies: Mapping[str, Reply], model: str, profile: Profile) -> dict[str, Reply]:
        """The stored reply to each request by digest: the given reply, or an earlier one of another process.

        Raises:
            OSError: The file cannot be written.
        """
        marks = ", ".join("?" * (3 + len(_FIELDS)))
        rows = [
            (digest, model, profile.name, *(getattr(reply, field) for field in _FIELDS))
            for digest, reply in replies.items()
        ]
        before = self._database.total_changes
        try:
            self._database.execute("BEGIN IMMEDIATE")
            try:
                self._database.executemany(f"INSERT OR IGNORE INTO answers VALUES ({marks})", rows)
            except BaseException:
                self._database.rollback()
                raise
            self._database.execute("COMMIT")
        except sqlite3.Error as error:
            raise OSError(f"{self._path}: {error}") from None
        if self._database.total_changes - before == len(rows):
            return dict(replies)
        kept = self.find(replies)
        return {
            digest: reply
            if all(getattr(reply, field) == getattr(kept[digest], field) for field in _FIELDS)
            else replace(kept[digest], latency=reply.latency, tries=reply.tries, status=reply.status)
            for digest, reply in replies.items()
        }

    def sources(self) -> list[tuple[str, Profile]]:
        """Models with stored answers, each with the server profile that its requests were written for.

        Raises:
            InvalidInputError: The file is damaged.
        """
        try:
            rows = self._database.execute("SELECT DISTINCT model, profile FROM answers ORDER BY model, profile")
            return [(model, Profile[profile]) for model, profile in rows]
        except (sqlite3.Error, KeyError) as error:
            raise self._unreadable(error) from None

    def __len__(self) -> int:
        return self._database.execute("SELECT count(*) FROM answers").fetchone()[0]

    def close(self) -> None:
        """Closes the file."""
        self._database.close()

    def _prepare(self, read_only: bool) -> None:
        database = self._database
        database.execute("BEGIN")  # one snapshot of the file, which another process may be creating
        (application,) = database.execute("PRAGMA application_id").fetchone()
        (version,) = database.execute("PRAGMA user_version").fetchone()
        (tables,) = database.execute("SELECT count(*) FROM sqlite_schema").fetchone()
        database.execute("COMMIT")
        if tables and (application, version) != (_APPLICATION, _FORMAT):
            raise ValueError("another program's, or another version's")
        if read_only:
            if not tables:
                raise ValueError("empty")
            return
        _execute_unlocked(database, "PRAGMA journal_mode = WAL")
        # Answers survive a crash of the process; the last ones may be lost in a crash of the machine.
        database.execute("PRAGMA synchronous = NORMAL")
        database.execute("BEGIN IMMEDIATE")
        database.execute(_TABLE)
        database.execute(f"PRAGMA application_id = {_APPLICATION}")
        database.execute(f"PRAGMA user_version = {_FORMAT}")
        database.execute("COMMIT")

    def _unreadable(self, error: Exception) -> InvalidInputError:
        message = f"this is not a readable file of answers ({error})"
        remedy = "remove it, or name another with llm.cache"
        return InvalidInputError(Problem("answers-unreadable", message, remedy, file=str(self._path)))


def _check(values: Iterable[object]) -> None:
    """Check that stored values have their columns' types, because SQLite does not enforce them.

    Raises:
        ValueError: A text column contains no text, or a token count is not a whole number.
    """
    for name, value in zip(_FIELDS, values, strict=True):
        if not isinstance(value, str if name in TEXTS else int | None):
            raise ValueError(f"{name} is {value!r}")


def _uri(path: Path, read_only: bool) -> str:
    # In a read-only folder SQLite cannot create its lock files, so the file is declared unchanging.
    mode = "?mode=ro" + ("" if os.access(path.parent, os.W_OK) else "&immutable=1") if read_only else ""
    return path.resolve().as_uri() + mode


def _execute_unlocked(database: sqlite3.Connection, statement: str) -> None:
    """Executes a statement, waiting while another process locks the file (SQLite does not wait here by itself)."""
    end = time.monotonic() + _LOCK_TIMEOUT
    while True:
        try:
            database.execute(statement)
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > end:
                raise
            time.sleep(0.01)
