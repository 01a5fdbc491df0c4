"""Frame rate of a recording from the steps of its times; times in another unit are an error."""

from pathlib import Path

import numpy as np

from rearl_jax.data.checks import clock
from rearl_jax.data.problems import bad_recording

_TOLERANCE = 0.02
"""Largest relative difference between the median step and that of a usual frame rate [-]; times are rounded."""


def frame_rate_of(steps: np.ndarray, file: Path | str, column: str) -> float:
    """Frames per second [1/s]: the usual rate nearest to the median step.

    Args:
        steps: Times from one row of a vehicle to the next [s]; steps that are not positive are ignored.
        file: For messages.
        column: Name of the column of times, for messages.

    Raises:
        BadRecordingError: The times are not in seconds, or no vehicle has two rows.
    """
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not steps.size:
        text = "no vehicle has two rows with different times"
        raise bad_recording("frame-rate-unknown", text, "complete the times", file, column=column)
    period = float(np.median(steps))
    unit = clock.unit_of(period, None)
    is_other = unit not in (None, "s")
    rate = clock.rate_of(period, _TOLERANCE * period)
    if is_other or not clock.PLAUSIBLE_RATES[0] <= rate <= clock.PLAUSIBLE_RATES[1]:
        text = f"the times of a vehicle are {period:g} apart" + (f": they look like {unit}" if is_other else "")
        raise bad_recording("wrong-units", text, "give the times in s", file, column=column)
    return rate
