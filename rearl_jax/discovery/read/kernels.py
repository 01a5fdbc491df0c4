"""Kernels with which positions are smoothed before a recording is released."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.ndimage import convolve1d
from scipy.stats import laplace, norm, triang, uniform

REACH = 5.0
"""Reach of a kernel, in standard deviations [-]."""


class Form(NamedTuple):
    """Form of a kernel: its weights as a distribution over time of standard deviation 1, and its transfer function of
    the frequency times the standard deviation [-].
    """

    distribution: Any
    transfer: Callable[[np.ndarray], np.ndarray]


def _sinc(angle: np.ndarray) -> np.ndarray:
    return np.sinc(angle / np.pi)


FORMS: Mapping[str, Form] = {
    "gaussian": Form(norm(), lambda x: np.exp(-0.5 * x**2)),
    "exponential": Form(laplace(scale=np.sqrt(0.5)), lambda x: 1.0 / (1.0 + 0.5 * x**2)),
    "moving average": Form(uniform(-np.sqrt(3.0), np.sqrt(12.0)), lambda x: _sinc(np.sqrt(3.0) * x)),
    "triangular": Form(triang(0.5, -np.sqrt(6.0), np.sqrt(24.0)), lambda x: _sinc(np.sqrt(1.5) * x) ** 2),
}
"""Forms by name. Exponential: the symmetric moving average in NGSIM studies (Thiemann, Treiber & Kesting, Transp. Res.
Rec. 2088 (2008) 90). Triangular: a moving average applied twice.
"""


@dataclass(frozen=True)
class Kernel:
    """A kernel: its name in FORMS, and its standard deviation [s]; 0 if positions were not smoothed."""

    name: str = "none"
    deviation: float = 0.0

    def share_beyond(self, time: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Share of the weights later than a time from the middle [s], where positions were smoothed."""
        return FORMS[self.name].distribution.sf(time / self.deviation)

    def smoothed(self, values: Float[np.ndarray, "steps *n"], dt: float) -> Float[np.ndarray, "steps *n"]:
        """Values at intervals of `dt` [s], smoothed; the first and the last value continue beyond the ends."""
        if not self.deviation:
            return values
        n = int(np.ceil(REACH * self.deviation / dt))
        weights = -np.diff(self.share_beyond(dt * (np.arange(-n, n + 2) - 0.5)))
        return convolve1d(values, weights / weights.sum(), axis=0, mode="nearest")


UNSMOOTHED = Kernel()
"""No kernel."""
