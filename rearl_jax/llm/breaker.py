"""Circuit breaker: decides from successful and failed requests whether the server counts as down.

After some failures in a row nothing is sent for a while. Then one request, the probe, shows whether the server is back.
"""

import time
from collections.abc import Callable


class Breaker:
    """Circuit breaker; not safe for several threads. Its user sends one probe at a time."""

    def __init__(self, failures: int, pause: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Closed at first; `failures` failed requests in a row open it, and after `pause` [s] a probe is sent."""
        self._failures = failures
        self._pause = pause
        self._clock = clock
        self._in_a_row = 0
        self._open_until: float | None = None

    @property
    def is_open(self) -> bool:
        """Whether the server counts as down, its pause over or not."""
        return self._open_until is not None

    @property
    def refuses(self) -> bool:
        """Whether nothing may be sent now: the server counts as down and its pause is not over."""
        return self._open_until is not None and self._clock() < self._open_until

    def succeeded(self) -> bool:
        """Whether this answer, the probe's or a late one, closes it."""
        was_open = self.is_open
        self._in_a_row = 0
        self._open_until = None
        return was_open

    def failed(self, is_probe: bool) -> bool:
        """Whether this failure, the probe's or another, opens it, or opens it again."""
        self._in_a_row += 1
        if self._in_a_row < self._failures or (self.is_open and not is_probe):
            return False
        self._open_until = self._clock() + self._pause
        return True
