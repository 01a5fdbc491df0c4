"""Outcome of a fuzzed input: an error that a caller is told to expect, another one, or no end."""

import faulthandler
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path

import rearl_jax

_PACKAGE = str(Path(rearl_jax.__file__).parent) + os.sep


class Outcome(Enum):
    """Outcome of an input."""

    accepted = "accepted"
    refused = "refused"
    """With an error that the package raised itself, with a message."""
    crashed = "crashed"
    """With any other error, or a warning."""
    silent = "silent"
    """Accepted although a number was missing, a unit was wrong, or a value was none that is allowed."""


Result = tuple[Outcome, str]
"""The outcome of one input, and what there is to say about it."""


def judged(error: Exception, expected: tuple[type[Exception], ...] = (ValueError, FileNotFoundError)) -> Result:
    """Outcome of an error: refused if it is of an expected type, raised by the package and not empty; else crashed."""
    last = error.__traceback__
    ours = last
    while last is not None:
        if last.tb_frame.f_code.co_filename.startswith(_PACKAGE):
            ours = last
        if last.tb_next is None:
            break
        last = last.tb_next
    said = f"{type(error).__name__}: {error}"
    if isinstance(error, expected) and ours is last and str(error):
        return Outcome.refused, said
    place = "" if ours is None else f"{Path(ours.tb_frame.f_code.co_filename).name}:{ours.tb_lineno} "
    return Outcome.crashed, place + said


@contextmanager
def ended_in_time(what: str, limit: float = 120.0) -> Iterator[None]:
    """Ends the process with the stacks of its threads where the block hangs; compiled code hears no exception.

    Args:
        what: What is tried, for the message.
        limit: How long it may take [s].
    """

    def give_up() -> None:
        print(f"{what} has not ended after {limit:g} s", file=sys.stderr, flush=True)
        faulthandler.dump_traceback(sys.__stderr__)
        os._exit(2)

    watch = threading.Timer(limit, give_up)
    watch.daemon = True
    watch.start()
    try:
        yield
    finally:
        watch.cancel()
