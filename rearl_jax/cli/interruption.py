"""Signals that end a task in an orderly way: what is open is closed, and the user is told how to go on."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_ENDING = ("SIGTERM", "SIGHUP")
"""Signals that end a task as Ctrl-C does; the second one is not known everywhere."""


class Ended(KeyboardInterrupt):
    """A signal has ended the task; as with Ctrl-C, nothing but cleaning up is left to do."""

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
    # Whoever ignores a signal, as nohup does, wants it ignored.
    before = {one: was for one in known if (was := signal.getsignal(one)) is not signal.SIG_IGN}

    def end(number: int, frame: FrameType | None) -> NoReturn:
        for one in before:
            signal.signal(one, signal.SIG_DFL)
        raise Ended(number)

    for one in before:
        signal.signal(one, end)
    try:
        yield
    finally:
        for one, was in before.items():
            signal.signal(one, was)


def name_of(stop: KeyboardInterrupt) -> str:
    """What has ended the task, in words."""
    return str(stop) if isinstance(stop, Ended) else "Ctrl-C"


def exit_code(stop: KeyboardInterrupt) -> int:
    """128 and the number of the signal, as of a process that it ends."""
    return 128 + (stop.number if isinstance(stop, Ended) else signal.SIGINT)
