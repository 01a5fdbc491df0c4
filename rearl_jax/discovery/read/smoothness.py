"""Detection of smoothed positions, or smoothed measured speeds, from the power spectrum of the acceleration.

Power of drives falls with frequency; that of white errors of positions rises with its fourth power, that of correlated
errors with its second, and that of rounding again with its fourth; all powers are two lower for errors of speeds. A
kernel multiplies the power of everything before it by the square of its transfer function. The sizes of all these and
the width of the kernel are fitted to the spectrum for every kernel in use and for none, and the most likely explanation
is taken.

A tracker that smooths only the errors of positions cannot be told from one that smooths drives too, because at high
frequencies drives have less power than errors; drives then count as smoothed, and fewer effects can be seen.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from heapq import nsmallest

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from rearl_jax.discovery.read.kernels import FORMS, UNSMOOTHED, Kernel
from rearl_jax.discovery.read.smoothing import Thinned, track_bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

SPECTRUM_TIME = 10.0
"""Window of the spectrum [s]."""

LOWEST_FREQUENCY = 0.9
"""Frequency above which the spectrum of drives is a power law [rad/s]."""

HIGHEST_FREQUENCY = 0.93
"""Highest frequency that is used, as a share of the highest one that the time step resolves [-]."""

DEVIATIONS = np.geomspace(0.06, 1.2, 24)
"""Standard deviations of the kernel with which its estimation begins [s]; the spectrum of a moving average has so many
zeros that its width is found from near by only.
"""

MEMORIES = np.geomspace(0.02, 1.5, 6)
"""Correlation times of errors with which the fit without a kernel begins [s]."""

FIRST_STEPS = 15
"""Steps from each of these, after which only the best are continued."""

CONTINUED = 4
"""Number of fits that are continued."""

USUAL = {
    "slope": (2.0, 2.0),
    "errors": (-7.0, 2.0),
    "memory": (-2.5, 1.5),
    "rounding": (-12.0, 3.0),
    "deviation": (-1.05, 0.6),
}
"""Usual values and their spread, which decide what the spectrum does not show: exponent of the drives' power [-];
logarithms of the power density of errors, 0.1 m at 10 Hz [m^2 s], of their correlation time [s], of the density of
rounding, 0.01 m [m^2 s], and of the standard deviation of the kernel, 0.35 s [s].
"""

BOUNDS = {
    "level": (-30.0, 20.0),
    "slope": (0.0, 8.0),
    "errors": (-20.0, 8.0),
    "memory": (-6.0, 1.5),
    "rounding": (-25.0, -3.0),
    "deviation": (-3.2, 0.4),
}
"""Bounds of the same, and of the logarithm of the drives' power at 1 rad/s [m^2/s^3]."""

MODEL_ERROR = 0.1
"""Error of the logarithm of a spectrum of this form beside that of the measured one [-]."""

LARGE = 3.0
"""Departures from the spectrum above which their influence grows slowly, in standard deviations [-]."""

MEDIAN_OVER_MEAN = float(np.log(2.0))
"""Ratio of median to mean of a spectral power, which is exponentially distributed [-]."""

LEAST_POWER = 1e-6
"""Power that is added to the measured and to the expected spectrum, as a share of the largest one [-]: less than this
leaks through the window from other frequencies, and says nothing.
"""

HANN = np.array([1.0, 4.0, 1.0]) / 6.0
"""Shares of the power at a frequency that a Hann window leaves there and moves to its neighbours [-]."""


def smoothing_kernel(tables: Sequence[Thinned], frame_rate: float, *, is_of_speeds: bool = False) -> Kernel:
    """The kernel that the spectrum of the positions shows, or that of the speeds if motion within seconds is taken from
    them; all tables have the same time step, and were recorded at `frame_rate` [1/s].
    """
    column, order = ("speed", 1) if is_of_speeds else ("position", 2)
    spectrum = _acceleration_power(tables, round(frame_rate * tables[0][1]), column, order)
    if spectrum is None:
        return UNSMOOTHED
    without, fits = spectrum.fitted(None), {name: spectrum.fitted(form.transfer) for name, form in FORMS.items()}
    best = min(fits, key=lambda name: fits[name].cost)
    # A spectrum that no kernel explains is no evidence for one: likelihoods are compared relative to the misfit left.
    n_free = len(spectrum.power) - len(BOUNDS)
    misfit = max(1.0, 2.0 * fits[best].cost / max(1, n_free))
    if (without.cost - fits[best].cost) / misfit < THRESHOLDS.kernel_evidence:
        return UNSMOOTHED
    return Kernel(best, fits[best].deviation)


@dataclass(frozen=True)
class _Fit:
    """Fit of a kernel: negative log-likelihood [nats], and standard deviation of the kernel [s]."""

    cost: float
    deviation: float


@dataclass(frozen=True)
class _Spectrum:
    """Median power of accelerations.

    Attributes:
        frequency: Frequencies [rad/s].
        power: Power density [m^2/s^3].
        dt: Time step [s].
        n_averaged: Frames that were averaged to one time step.
        n_windows: Number of windows.
        order: Order of the derivative that makes an acceleration of what was measured: 2 of positions, 1 of speeds.
    """

    frequency: Float[np.ndarray, " frequencies"]
    power: Float[np.ndarray, " frequencies"]
    dt: float
    n_averaged: int
    n_windows: int
    order: int

    def fitted(self, kernel: Callable[[np.ndarray], np.ndarray] | None) -> _Fit:
        """The best fit with a kernel, or without one."""
        measured, usual = self._logarithm(self.power), np.array(list(USUAL.values()))
        # The logarithm of the median of n exponentially distributed powers has the variance 1 / (n log(2)^2).
        deviation = np.hypot(MODEL_ERROR, 1.0 / (MEDIAN_OVER_MEAN * np.sqrt(self.n_windows)))

        def residuals(values: np.ndarray) -> np.ndarray:
            departure = (self._expected(values, kernel) - measured) / deviation
            bounded = LARGE * np.sqrt(2.0 * (np.sqrt(1.0 + (departure / LARGE) ** 2) - 1.0))
            return np.concatenate([np.copysign(bounded, departure), (values[1:] - usual[:, 0]) / usual[:, 1]])

        bounds = np.array(list(BOUNDS.values())).T
        level = measured[0] + USUAL["slope"][0] * np.log(self.frequency[0])
        begin = np.clip([level, *usual[:, 0]], *bounds)
        varied, values = ("memory", MEMORIES) if kernel is None else ("deviation", DEVIATIONS)
        is_varied = np.array(list(BOUNDS)) == varied
        starts = [np.where(is_varied, np.log(value), begin) for value in values]
        by_cost = operator.attrgetter("cost")
        tried = [least_squares(residuals, start, bounds=bounds, max_nfev=FIRST_STEPS) for start in starts]
        found = [least_squares(residuals, fit.x, bounds=bounds) for fit in nsmallest(CONTINUED, tried, key=by_cost)]
        best = min(found, key=by_cost)
        return _Fit(float(best.cost), float(np.exp(best.x[-1])))

    def _expected(
        self, values: np.ndarray, kernel: Callable[[np.ndarray], np.ndarray] | None
    ) -> Float[np.ndarray, " frequencies"]:
        """Logarithm of the power that a Hann window shows."""
        level, slope, errors, memory, rounding, deviation = values
        # Frames were averaged and then left out, so that errors of higher frequencies appear at these ones.
        frame = self.dt / self.n_averaged
        angles = self.frequency + 2.0 * np.pi / self.dt * np.arange(self.n_averaged)[:, None]
        passed = (np.sin(0.5 * angles * self.dt) / (self.n_averaged * np.sin(0.5 * angles * frame))) ** 2
        if kernel is not None:
            passed = passed * kernel(angles * np.exp(deviation)) ** 2
        decay = np.exp(-frame / np.exp(memory))  # of first-order autoregressive errors from frame to frame
        noise = np.exp(errors) / (1.0 + decay * (2.0 * np.sin(0.5 * angles * frame) / (1.0 - decay)) ** 2)
        difference = (2.0 * np.sin(0.5 * self.frequency * self.dt) / self.dt) ** (2 * self.order)
        drives = passed[0] * np.exp(level) * self.frequency**-slope
        power = drives + difference * ((passed * noise).sum(axis=0) + np.exp(rounding))
        return self._logarithm(np.convolve(np.pad(power, 1, mode="edge"), HANN, mode="valid"))

    def _logarithm(self, power: Float[np.ndarray, " frequencies"]) -> Float[np.ndarray, " frequencies"]:
        """Logarithm of a power together with LEAST_POWER."""
        return np.log(power + LEAST_POWER * self.power.max())


def _acceleration_power(tables: Sequence[Thinned], n_averaged: int, column: str, order: int) -> _Spectrum | None:
    """The spectrum of all tracks, of whose frames `n_averaged` were averaged to one time step: that of the derivative
    of this order of a column. None if tracks are too short, or if no vehicle ever accelerates.
    """
    powers, dt = [], tables[0][1]
    n = 2 * int(SPECTRUM_TIME / dt / 2)
    window = np.hanning(n)
    for table, _ in tables:
        values = table[column].to_numpy()
        for start, stop in zip(*track_bounds(table), strict=True):
            acceleration = np.diff(values[start:stop], order) / dt**order
            for k in range(0, len(acceleration) - n + 1, n):
                piece = acceleration[k : k + n]
                powers.append(np.abs(np.fft.rfft((piece - piece.mean()) * window)) ** 2)
    if len(powers) < THRESHOLDS.least_spectrum_windows:
        return None
    power = np.median(powers, axis=0) * dt / (window**2).sum()
    frequency = 2 * np.pi * np.fft.rfftfreq(n, dt)
    used = (frequency > LOWEST_FREQUENCY) & (frequency < HIGHEST_FREQUENCY * np.pi / dt)
    if not power[used].any():
        return None
    return _Spectrum(frequency[used], power[used], dt, n_averaged, len(powers), order)
