"""Requests that succeed or fail -> whether the next one may be sent.

After some failures in a row the server counts as down, and nothing is sent for a while. Then one request, the probe,
shows whether it is back.
"""

import time
from collections.abc import Callable


class Breaker:
    """Circuit breaker; not safe for several threads."""

    def __init__(self, failures: int, pause: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Closed at first.

        Args:
            failures: Failed requests in a row that open it.
            pause: Time it stays open before a probe [s].
            clock: Present time [s].
        """
        self._failures = failures
        self._pause = pause
        self._clock = clock
        self._in_a_row = 0
        self._open_until: float | None = None
        self._is_probing = False

    @property
    def refuses(self) -> bool:
        """Whether nothing may be sent now: the server counts as down and its pause is not over."""
        return self._open_until is not None and not self._is_probing and self._clock() < self._open_until

    @property
    def is_probing(self) -> bool:
        """Whether the probe is on its way: the others wait for what becomes of it."""
        return self._is_probing

    @property
    def is_open(self) -> bool:
        """Whether the server counts as down, its pause over or not."""
        return self._open_until is not None

    def begin(self) -> bool:
        """Whether the request that is sent now is the probe."""
        self._is_probing = self.is_open
        return self._is_probing

    def succeeded(self) -> bool:
        """Whether this answer, the probe's or a late one, closes it."""
        was_open = self.is_open
        self._in_a_row = 0
        self._open_until = None
        self._is_probing = False
        return was_open

    def failed(self, is_probe: bool) -> bool:
        """Whether this failure opens it, or opens it again.

        Args:
            is_probe: Whether the request was the probe.
        """
        self._in_a_row += 1
        if self.is_open and not is_probe:
            return False
        if self._in_a_row < self._failures:
            return False
        self._open_until = self._clock() + self._pause
        self._is_probing = False
        return True

    def given_up(self, is_probe: bool) -> None:
        """Takes note of a request that nobody waits for any more; the next one is the probe if it was."""
        if is_probe:
            self._is_probing = False
