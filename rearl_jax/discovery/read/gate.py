"""Data check before any model: agreement of the position and speed columns with each other, and noise of positions.

A disagreement found here is a measurement artefact, whatever drivers do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rearl_jax.discovery.read.kernels import Kernel
from rearl_jax.discovery.read.smoothing import Thinned, position_noise, smoothed, track_bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

CUT_OFF = 2.0
"""Angular frequency below which position and speed are compared [rad/s]: below those of noise, above those of drift.
"""


@dataclass(frozen=True)
class Finding:
    """An artefact, or a property of the measurement, that the columns show without any model.

    Attributes:
        name: Name as in verdict.json.
        is_artefact: Whether a column is wrong; otherwise a normal property of measurements, which the observer models.
        parameter: Name of the measured parameter.
        unit: Unit of the parameter.
        value: Value of the parameter.
        deviation: Standard deviation of the value.
        words: Description in one sentence.
    """

    name: str
    is_artefact: bool
    parameter: str
    unit: str
    value: float
    deviation: float
    words: str


def gate(tables: Sequence[Thinned]) -> list[Finding]:
    """Lags, scales and noise that the columns show."""
    noise = [position_noise(table["position"].to_numpy(), *track_bounds(table)) for table, _ in tables]
    lag, scale = _speed_against_position(tables)
    findings = []
    if lag is not None and abs(lag[0]) > max(THRESHOLDS.least_lag, THRESHOLDS.columns_z_score * lag[1]):
        delayed, other = ("speed", "position") if lag[0] > 0 else ("position", "speed")
        findings.append(
            Finding(
                name=f"{delayed}_lag",
                is_artefact=True,
                parameter="lag",
                unit="s",
                value=abs(lag[0]),
                deviation=lag[1],
                words=f"the {delayed} column is {abs(lag[0]):.2f} s late against the {other} column",
            )
        )
    if scale is not None and abs(scale[0]) > max(THRESHOLDS.least_scale_error, THRESHOLDS.columns_z_score * scale[1]):
        findings.append(
            Finding(
                name="speed_scale",
                is_artefact=True,
                parameter="factor",
                unit="-",
                value=1 + scale[0],
                deviation=scale[1],
                words=f"the speed column is {1 + scale[0]:.3f} times the derivative of the position column",
            )
        )
    typical = float(np.median(noise))
    if typical > THRESHOLDS.noisy_positions:
        spread = float(np.std(noise) / np.sqrt(len(noise))) if len(noise) > 1 else 0.05 * typical
        words = f"positions scatter by {typical:.2f} m, more than those of a motorway camera"
        findings.append(Finding("position_noise", False, "sd", "m", typical, spread, words))
    return findings


def smoothed_release(kernel: Kernel, *, is_of_speeds: bool) -> Finding:
    """Finding that positions, or speeds, were smoothed before they were released."""
    sd, what = kernel.deviation, "speeds" if is_of_speeds else "positions"
    words = f"{what} were smoothed before they were released: {kernel.name} kernel, standard deviation {sd:.2f} s"
    return Finding("smoothing", False, "time", "s", sd, 0.2 * sd, words)


def _speed_against_position(
    tables: Sequence[Thinned],
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Lag [s] and relative scale error [-] of the speed column against the derivative of the position, each with its
    standard deviation; None if there are fewer than three tracks of six seconds.

    A column with a scale error e and a lag L differs from the derivative v by about e v - L a, a the acceleration.
    """
    grams, products = [], []
    for table, dt in tables:
        position, speed = table["position"].to_numpy(), table["speed"].to_numpy()
        for start, stop in zip(*track_bounds(table), strict=True):
            if (stop - start) * dt < 6.0:
                continue
            _, v, a = smoothed(position[start:stop], dt, CUT_OFF)
            # The integral of the column is smoothed in the same way, so its derivative is attenuated like v.
            driven = np.concatenate([[0.0], np.cumsum((speed[start + 1 : stop] + speed[start : stop - 1]) / 2) * dt])
            _, column, _ = smoothed(driven, dt, CUT_OFF)
            inner = slice(int(1.5 / dt), -int(1.5 / dt))
            basis = np.stack([v[inner], -a[inner]], axis=1)
            grams.append(basis.T @ basis)
            products.append(basis.T @ (column - v)[inner])
    if len(grams) < 3:
        return None, None
    gram, product = np.array(grams), np.array(products)
    fitted = np.linalg.solve(gram.sum(axis=0) + 1e-9 * np.eye(2), product.sum(axis=0))
    scores = product - gram @ fitted
    inverse = np.linalg.inv(gram.sum(axis=0) + 1e-9 * np.eye(2))
    deviation = np.sqrt(np.diag(inverse @ (scores.T @ scores) @ inverse))
    return (float(fitted[1]), float(deviation[1])), (float(fitted[0]), float(deviation[0]))
