"""The progress bar of long work: on standard error, shown only if that is a terminal."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

_MEMORY = 600.0
"""Time span of past steps from which the remaining time is estimated [s]; some steps take minutes."""


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
    """A line of the bar, as a function of the steps done and their total."""
    line = bar.add_task(title, total=None)
    return lambda done, total: bar.update(line, completed=done, total=total)


def silent() -> Progress:
    """A progress bar that is not displayed."""
    return Progress(disable=True)


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A live progress bar; what is logged meanwhile appears above it."""
    done = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeLeftColumn())
    bar = Progress(
        *done,
        console=Console(stderr=True),
        disable=sys.stderr is None or not sys.stderr.isatty(),
        transient=True,
        speed_estimate_period=_MEMORY,
    )
    handlers = [
        handler
        for handler in logging.getLogger().handlers
        if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr
    ]
    with bar:
        # The bar has replaced standard error; the log handlers still refer to the old stream.
        before = [handler.setStream(sys.stderr) for handler in handlers]
        try:
            yield bar
        finally:
            for handler, stream in zip(handlers, before, strict=True):
                if stream is not None:  # None if the stream was the same
                    handler.setStream(stream)
