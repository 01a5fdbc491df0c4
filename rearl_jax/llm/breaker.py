"""Circuit breaker: determines from successful and failed requests whether the server is down.

After several consecutive failures no requests are sent for some time. Then one request, the probe, tests whether the
server responds again.
"""

import time
from collections.abc import Callable


class Breaker:
    """Circuit breaker; not thread-safe. Its user sends one probe at a time."""

    def __init__(self, failures: int, pause: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Closed at first; `failures` failed requests in a row open it, and after `pause` [s] a probe is sent."""
        self._failures = failures
        self._pause = pause
        self._clock = clock
        self._in_a_row = 0
        self._open_until: float | None = None

    @property
    def is_open(self) -> bool:
        """True while the server counts as down, during and after the pause."""
        return self._open_until is not None

    @property
    def refuses(self) -> bool:
        """True if no request may be sent now, because the server counts as down and the pause is not over."""
        return self._open_until is not None and self._clock() < self._open_until

    def succeeded(self) -> bool:
        """Records an answer, to the probe or to a request sent before the pause; True if it closes the breaker."""
        was_open = self.is_open
        self._in_a_row = 0
        self._open_until = None
        return was_open

    def failed(self, is_probe: bool) -> bool:
        """Records a failure, of the probe or another request; True if it opens the breaker, or opens it again."""
        self._in_a_row += 1
        if self._in_a_row < self._failures or (self.is_open and not is_probe):
            return False
        self._open_until = self._clock() + self._pause
        return True
