"""The progress of long work on standard error: a bar on a terminal, else a line now and then."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

_ESTIMATE_PERIOD = 600.0
"""Time span of past steps from which the remaining time is estimated [s]; some steps take minutes."""

QUIET = 15.0
"""Time before the first line where there is no terminal, and between lines of one stage [s]."""


class TimeLeftColumn(ProgressColumn):
    """Column with the remaining time of a line; empty if unknown."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        """The cell of one line."""
        left = task.time_remaining
        return Text("" if task.finished or left is None else f"{in_words(left)} left", style="progress.remaining")


def in_words(seconds: float) -> str:
    """A time in readable form, e.g. 40 s, 12 min, 3.5 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def shown(bar: Progress, title: str) -> Callable[[int, int], None]:
    """A function that shows the number of steps done and their total in a line of its own of the bar."""
    line = bar.add_task(title, total=None)
    return lambda done, total: bar.update(line, completed=done, total=total)


def silent() -> Progress:
    """A progress bar that is not displayed."""
    return Progress(disable=True)


class ProgressLines(Progress):
    """A bar for files and logs: a line where a stage begins, and every now and then while it lasts."""

    def __init__(self) -> None:
        super().__init__(disable=True)
        self._begin, self._written, self._stage = time.monotonic(), 0.0, ""

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """Changes a line of the bar, and writes it if that is due."""
        super().update(task_id, **changes)
        self._write(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Advances a line of the bar, and writes it if that is due."""
        super().advance(task_id, advance)
        self._write(task_id)

    def _write(self, task_id: TaskID) -> None:
        now, task = time.monotonic() - self._begin, self._tasks[task_id]
        if now < QUIET or (task.description == self._stage and now - self._written < QUIET):
            return
        self._written, self._stage = now, task.description
        steps = f", {task.completed:.0f} of {task.total:.0f}" if task.total else ""
        print(f"{in_words(now)}: {task.description}{steps}", file=sys.stderr, flush=True)


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A live progress bar on a terminal, with log messages above it; without a terminal `ProgressLines`."""
    if sys.stderr is None or not sys.stderr.isatty():
        with ProgressLines() as lines:
            yield lines
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeLeftColumn(),
    )
    bar = Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        speed_estimate_period=_ESTIMATE_PERIOD,
    )
    handlers = [
        handler
        for handler in logging.getLogger().handlers
        if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr
    ]
    with bar:
        # The bar has replaced standard error; the log handlers still refer to the old stream.
        old_streams = [handler.setStream(sys.stderr) for handler in handlers]
        try:
            yield bar
        finally:
            for handler, stream in zip(handlers, old_streams, strict=True):
                if stream is not None:  # None if the stream was the same
                    handler.setStream(stream)
