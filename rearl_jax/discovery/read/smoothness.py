"""Detection of smoothed positions, from the fall of their power with frequency.

The power of the acceleration in recorded drives falls at most to a quarter per octave; white noise in positions makes
it rise sixteenfold. A much steeper fall indicates a smoothing kernel. If the power rises at lower frequencies, noise
dominates there, and only the errors of positions are smooth, as trackers leave them.

Errors that were smoothed with the drives dominate at frequencies where drives have hardly any power, and the kernel
seems shorter there than it is; so its width is estimated together with the sizes of errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from rearl_jax.discovery.read.smoothing import Thinned, track_bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

BANDS = (1.1, 1.6, 2.2, 3.2, 4.5, 6.4, 9.0, 12.8)
"""Edges of frequency bands, half an octave each [rad/s]."""

DRIVING, NOISE = 0.25, 16.0
"""Ratio of the acceleration's power an octave apart, for drives and for white noise in positions [-]."""

SPECTRUM_TIME = 10.0
"""Window of the spectrum [s]."""

KERNELS = (0.1, 0.4, 0.8)
"""Standard deviations of the kernel with which its estimation begins [s]."""

USUAL_ERRORS, USUAL_ROUNDING = np.exp(-8.0), np.exp(-12.0)
"""Usual power density of errors before and after smoothing, 0.05 m and 0.01 m at 10 Hz [m^2 s]."""

USUAL_WEIGHT = 0.02
"""Weight of usual values beside that of a frequency band [-]: they decide only what the spectrum does not show."""

MEDIAN_OVER_MEAN = float(np.log(2.0))
"""Ratio of median to mean of a spectral power, which is exponentially distributed [-]."""


@dataclass(frozen=True)
class Smoothness:
    """Detected Gaussian kernels of smoothing.

    Attributes:
        drives: Standard deviation of the kernel that smoothed positions [s]; 0 for none.
        errors: Standard deviation of the kernel that smoothed only the errors [s]; 0 for none.
        size: Standard deviation of the white errors before smoothing [m].
    """

    drives: float = 0.0
    errors: float = 0.0
    size: float = 0.0

    def complement(self, steps: int, dt: float, rng: np.random.Generator) -> Float[np.ndarray, " steps"]:
        """Noise that makes the errors of one track white again [m]."""
        if not self.errors:
            return np.zeros(steps)
        frequency = 2 * np.pi * np.fft.rfftfreq(2 * steps, dt)
        missing = np.sqrt(-np.expm1(-((frequency * self.errors) ** 2)))
        drawn = np.fft.rfft(self.size * rng.standard_normal(2 * steps))
        return np.fft.irfft(missing * drawn, 2 * steps)[:steps]


def smoothness(tables: Sequence[Thinned]) -> Smoothness:
    """Kernels that the spectrum of the positions shows; all tables have the same time step."""
    spectrum = _acceleration_power(tables)
    if spectrum is None:
        return Smoothness()
    frequency, power, dt = spectrum
    edges = [edge for edge in BANDS if edge < np.pi / dt / 2]
    bands = list(zip(edges[:-1], edges[1:], strict=True))
    middle = [np.sqrt(low * high) for low, high in bands]
    # Per octave, the power of drives changes by the factor DRIVING, that of noise by NOISE. A Gaussian kernel of
    # standard deviation s multiplies the power at the frequency f by exp(-(f s)^2), which gives s.
    level = [power[(frequency >= low) & (frequency < high)].mean() for low, high in bands]
    if not min(level, default=0.0) > 0.0:
        return Smoothness()  # no vehicle has ever accelerated
    ratio = [higher / lower for lower, higher in zip(level[:-2], level[2:], strict=True)]
    if not ratio or min(ratio) > THRESHOLDS.steepest_power_ratio:
        return Smoothness()
    k = int(np.argmin(ratio))
    difference = middle[k + 2] ** 2 - middle[k] ** 2  # of f^2 over the octave
    if max(ratio[:k], default=0.0) < THRESHOLDS.rising_power_ratio:
        without_errors = float(np.sqrt(np.log(DRIVING / ratio[k]) / difference))
        # The larger one, because a kernel that is assumed too short gives false evidence.
        return Smoothness(drives=max(without_errors, _kernel_of_drives_and_errors(np.array(middle), np.array(level))))
    kernel = float(np.sqrt(np.log(NOISE / ratio[k]) / difference))
    top = int(np.argmax(level))
    density = level[top] / middle[top] ** 4 * np.exp((middle[top] * kernel) ** 2) / MEDIAN_OVER_MEAN
    return Smoothness(errors=kernel, size=float(np.sqrt(density / dt)))


def _kernel_of_drives_and_errors(frequency: Float[np.ndarray, " bands"], power: Float[np.ndarray, " bands"]) -> float:
    """Standard deviation of the Gaussian kernel that smoothed drives and white errors of positions [s], by least
    squares on the logarithm of the acceleration's power [m^2/s^3] in frequency bands [rad/s]. Errors made after
    smoothing, such as rounding, are estimated too.
    """
    log_frequency, log_power = np.log(frequency), np.log(power)
    usual = np.log([USUAL_ERRORS, USUAL_ROUNDING, 1.0])

    def residuals(values: np.ndarray) -> np.ndarray:
        drives, errors, rounding, log_kernel = values
        smoothed = np.logaddexp(drives - 2 * log_frequency, errors + 4 * log_frequency)
        smoothed = smoothed - (frequency * np.exp(log_kernel)) ** 2
        departure = np.logaddexp(smoothed, rounding + 4 * log_frequency) - log_power
        return np.concatenate([departure, USUAL_WEIGHT * (values[1:] - usual)])

    drives, rounding = log_power[0] + 2 * log_frequency[0], log_power[-1] - 4 * log_frequency[-1]
    found = [least_squares(residuals, [drives, usual[0], rounding, np.log(kernel)]) for kernel in KERNELS]
    return float(np.exp(min(found, key=lambda fit: fit.cost).x[-1]))


def _acceleration_power(
    tables: Sequence[Thinned],
) -> tuple[Float[np.ndarray, " frequencies"], Float[np.ndarray, " frequencies"], float] | None:
    """Frequencies [rad/s], the median power density of accelerations [m^2/s^3], and the time step [s]; None if tracks
    are too short.
    """
    powers, window, dt = [], np.empty(0), 0.1
    for table, dt in tables:
        position = table["position"].to_numpy()
        n = 2 * int(SPECTRUM_TIME / dt / 2)
        window = np.hanning(n)
        for start, stop in zip(*track_bounds(table), strict=True):
            acceleration = np.diff(position[start:stop], 2) / dt**2
            for k in range(0, len(acceleration) - n + 1, n):
                piece = acceleration[k : k + n]
                powers.append(np.abs(np.fft.rfft((piece - piece.mean()) * window)) ** 2)
    if len(powers) < THRESHOLDS.least_spectrum_windows:
        return None
    power = np.median(powers, axis=0) * dt / (window**2).sum()
    return 2 * np.pi * np.fft.rfftfreq(len(window), dt), power, dt
