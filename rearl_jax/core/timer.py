"""Time to the next lane-change decision of a driver, in whole time steps (ticks).

highway-env adds 1/15 s to a float timer every tick and decides when the timer exceeds one second. In floating point
fifteen such additions give 0.9999999999999999, so the period is 16 ticks, not 15. Counted ticks reproduce this in any
precision; the count itself is determined once by the same additions, in float64 on the host.
"""

import numpy as np


def ticks_until_decision(timer: np.ndarray, delay: float, ticks_per_second: int) -> np.ndarray:
    """Ticks after which a timer that starts at `timer` first exceeds `delay`.

    Args:
        timer: Start values [s], any shape, float64.
        delay: Time between decisions [s].
        ticks_per_second: Clock of the simulation [1/s].

    Returns:
        Smallest k >= 0 with timer + k additions of 1/ticks_per_second > delay, int32.

    Source: highway-env 1.12.1, `IDMVehicle.change_lane_policy` and `IDMVehicle.step`.
    """
    elapsed = np.array(timer, np.float64)
    ticks = np.zeros(elapsed.shape, np.int32)
    waiting = ~(elapsed > delay)
    while waiting.any():
        elapsed = elapsed + 1.0 / ticks_per_second
        ticks += waiting
        waiting &= ~(elapsed > delay)
    return ticks


def decision_period(delay: float, ticks_per_second: int) -> int:
    """Ticks from one decision to the next [ticks]; 16 for one second at 15 Hz."""
    return int(ticks_until_decision(np.zeros(()), delay, ticks_per_second))
