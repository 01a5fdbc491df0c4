"""The progress bar of long work: on standard error, silent where that is no terminal."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


def shown(bar: Progress, title: str) -> Callable[[int, int], None]:
    """A line of the bar, as a function of the steps done and their total."""
    line = bar.add_task(title, total=None)
    return lambda done, total: bar.update(line, completed=done, total=total)


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A live progress bar; what is logged meanwhile appears above it."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True)
    handlers = [
        handler
        for handler in logging.getLogger().handlers
        if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr
    ]
    with bar:
        # The bar has put itself in the place of standard error; the handlers still hold the old one.
        before = [handler.setStream(sys.stderr) for handler in handlers]
        try:
            yield bar
        finally:
            for handler, stream in zip(handlers, before, strict=True):
                if stream is not None:  # None where the stream was the same
                    handler.setStream(stream)
