"""Small negative speeds, which errors of tracking and of satellite receivers give to standing vehicles."""

import numpy as np

MAX_BACKWARD = 1.0
"""Largest magnitude of such a speed [m/s]; that of noise of satellite receivers is 0.07 m/s in OpenACC."""


def standing(speed: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The speeds with 0 in place of small negative ones, and a note that states their number [m/s]."""
    backward = (speed < 0.0) & (speed >= -MAX_BACKWARD)
    notes = [f"{int(backward.sum())} speeds between -{MAX_BACKWARD:g} and 0 m/s set to 0"] if backward.any() else []
    return np.where(backward, 0.0, speed), notes
