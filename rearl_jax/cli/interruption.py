"""Signals that end a task in an orderly way: open files are closed, and a message gives the command that continues."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_ENDING = ("SIGTERM", "SIGHUP")
"""Signals that end a task as Ctrl-C does; Windows does not have SIGHUP."""


class Ended(KeyboardInterrupt):
    """A signal has ended the task; as after Ctrl-C, the program only cleans up."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Inside the block the signals raise `Ended`; a second one ends the process at once."""
    known = [signal.Signals[name] for name in _ENDING if name in signal.Signals.__members__]
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # A signal that is ignored already, as under nohup, stays ignored.
    previous = {number: handler for number in known if (handler := signal.getsignal(number)) is not signal.SIG_IGN}

    def end(number: int, frame: FrameType | None) -> NoReturn:
        for handled in previous:
            signal.signal(handled, signal.SIG_DFL)
        raise Ended(number)

    for handled in previous:
        signal.signal(handled, end)
    try:
        yield
    finally:
        for handled, handler in previous.items():
            signal.signal(handled, handler)


def name_of(stop: KeyboardInterrupt) -> str:
    """Name of the signal that ended the task."""
    return str(stop) if isinstance(stop, Ended) else "Ctrl-C"


def exit_code(stop: KeyboardInterrupt) -> int:
    """128 plus the number of the signal, the exit code of a process that the signal ends."""
    return 128 + (stop.number if isinstance(stop, Ended) else signal.SIGINT)
