"""Noise of drives and measurements: the observer under which errors are most likely."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.autocorrelation import autocorrelation
from rearl_jax.discovery.observe.fit_state import FitState, copied, new_state, with_noise
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import unrest
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.smoothing import lasting_noise
from rearl_jax.discovery.thresholds import THRESHOLDS

ACCELERATIONS = (0.03, 0.05, 0.07, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.45, 0.7, 1.0)
"""Standard deviations of what drivers do beside the model that are tried [m/s^2]."""

EXACT = 0.05
"""Standard deviation [m/s^2] below which it is the steps in time that are seen; the most even of people have 0.1."""

TIMES = (0.6, 1.5, 4.0)
"""Correlation times that are tried [s]. Source of the middle: Zhang & Sun, arXiv:2210.03571 (highD, about 1.4 s)."""

USUAL = Noise(0.15, 1.5, 0.1)

MOST_GROWTH = 3.0
"""Bound of the growth of noise with the squared acceleration of the leader [s^4/m^2]."""

SPREAD_ITERATIONS = 3
"""Times that the spread between drivers is found and the drivers with it."""

USUAL_DRIVERS = 10.0
"""Drivers that what is usual of the spread is worth."""

SPREADS = (0.5, 4.0)
"""Bounds of the spread as a share of the usual one [-]."""

INDEPENDENT_AFTER = 4.0
"""Time after which innovations have nothing to do with each other [s]."""

SLOW = np.linspace(0.05, 2.0, 40)
"""Angular frequencies at which drivers do things [rad/s]."""

CERTAIN = 3.5
"""Standard deviations from which a correlation of innovations counts [-]: most of many are there by chance."""

LASTING = (0.2, 0.5, 1.0)
"""Correlation times of position errors that are tried beside none [s]: of trackers and filters."""


def best_noise(solver: Solver, state: FitState, tried: Sequence[Noise]) -> tuple[Noise, float]:
    """The noise under which what a state, as it is, fails to predict is most likely, and how likely it is then [nats].

    The drivers' own parameters are integrated out: they have taken in part of the noise, the more of it the less there
    is taken to be.

    Source: restricted likelihood, Patterson & Thompson, Biometrika 58 (1971) 545.
    """
    # S is what each observer expects, not what fits best: the errors' size says how large the noise is.
    trials = [with_noise(state, noise) for noise in tried]
    solver.sums(trials)
    likely = [float(trial.log_likelihood().sum()) - 0.5 * float(trial.log_width().sum()) for trial in trials]
    best = int(np.argmax(likely))
    return tried[best], likely[best]


def under_best_noise(
    solver: Solver, state: FitState, tried: Sequence[Noise], *, iterations: int = 20, tolerance: float = 0.05
) -> tuple[FitState, Noise]:
    """A state solved anew under the noise that is most likely for it as it is, and that noise."""
    noise, _ = best_noise(solver, state, tried)
    state = with_noise(state, noise)
    solver.solve([state], iterations=iterations, tolerance=tolerance)
    return state, noise


def under_best_time(solver: Solver, state: FitState, tried: Sequence[Noise]) -> tuple[FitState, Noise]:
    """The same where nothing is known of the correlation time: of each, the most likely noise of the state as it is, is
    asked again at its own optimum, for parameters that were found under one noise favour it.
    """
    chosen = []
    for time in dict.fromkeys(noise.time for noise in tried):
        chosen.append(best_noise(solver, state, [noise for noise in tried if noise.time == time])[0])
    states = [with_noise(state, noise) for noise in chosen]
    solver.solve(states, iterations=20, tolerance=0.05)
    likely = [best_noise(solver, one, [noise])[1] for one, noise in zip(states, chosen, strict=True)]
    best = int(np.argmax(likely))
    return states[best], chosen[best]


def is_exact(solver: Solver, data: Measured) -> bool:
    """True if drivers do nothing beside the model, as nobody but a simulation does."""
    _, noise = calibrate(solver, data)
    return noise.acceleration <= EXACT


def noises(like: Noise, accelerations: Sequence[float]) -> list[Noise]:
    """Noises of drivers, with the measurement's as it is."""
    return [replace(like, acceleration=sd, time=time) for sd in accelerations for time in TIMES]


def no_larger(noise: Noise) -> list[float]:
    """Sizes of the drivers' noise up to the present one [m/s^2]: an addition can only lower what is left to chance."""
    return [sd for sd in ACCELERATIONS if sd <= noise.acceleration] or [ACCELERATIONS[0]]


def calibrate(solver: Solver, data: Measured) -> tuple[FitState, Noise]:
    """Drivers, their population and the noise, jointly, with nothing added to the model."""
    usual = replace(USUAL, position=data.noise)
    state = new_state(data, solver.layout, usual)
    solver.solve([state], iterations=8, tolerance=1.0)
    noise, likely = best_noise(solver, state, noises(usual, ACCELERATIONS))
    lasting = [
        replace(noise, acceleration=sd, position=lasting_noise(data.noise, time, data.dt), position_time=time)
        for time in LASTING
        for sd in ACCELERATIONS
    ]
    other, with_lasting = best_noise(solver, state, lasting)
    if with_lasting > likely + THRESHOLDS.lasting_noise_gain:
        noise = other
    state, noise = under_best_time(solver, state, noises(noise, ACCELERATIONS))
    for _ in range(SPREAD_ITERATIONS):
        state = copied(state, spread=spread_of(state))
        solver.solve([state], iterations=5, tolerance=0.3)
    noise = _as_innovations_are(solver, state, noise)
    state = with_noise(state, noise)
    solver.solve([state], iterations=10)
    return state, noise


def spread_of(state: FitState) -> Float[np.ndarray, " own"]:
    """Standard deviations of standardised parameters between the drivers of a state that has been solved.

    What is not known of a driver counts as spread, so that drivers who show little do not look alike; the usual spread
    counts as much as some drivers do. It is found once, for the calibrated model, and every candidate is held against
    it: a spread that shrank under one candidate only would be false evidence.

    Source: expectation maximisation, Dempster, Laird & Rubin, J. R. Stat. Soc. B 39 (1977) 1.
    """
    assert state.sums is not None
    n_own = state.z.shape[1]
    own = state.sums.gram[:, :n_own, :n_own] / state.variances[:, None, None] + state.precision
    unknown = np.einsum("dii->di", np.linalg.inv(own))
    square = (USUAL_DRIVERS + (state.away**2 + unknown).sum(axis=0)) / (USUAL_DRIVERS + len(state.z))
    return np.clip(np.sqrt(square), *SPREADS)


def _as_innovations_are(solver: Solver, state: FitState, noise: Noise) -> Noise:
    """The noise with its growth and with the share of innovations that are independent, from those of a fitted state.

    A score that varies at some frequency scatters by the spectral density of the innovations there; the largest of the
    frequencies at which drivers do things counts.

    Source: long-run variance, Newey & West, Econometrica 55 (1987) 703.
    """
    data = state.data
    (innovation,) = solver.innovations([state])
    relative = innovation**2 / state.variances[data.driver]
    counts, size = data.weight, unrest(data)
    size_mean, mean = (float((values * counts).sum() / counts.sum()) for values in (size, relative))
    slope = float(
        (relative * (size - size_mean) * counts).sum() / max(float(((size - size_mean) ** 2 * counts).sum()), 1e-9)
    )
    level = mean - slope * size_mean
    growth = min(max(slope, 0.0) / max(level, 0.1 * mean), MOST_GROWTH)
    even = innovation / np.sqrt(state.variances[data.driver] * (1 + growth * size))
    correlated = autocorrelation(even, counts, data.stride, round(INDEPENDENT_AFTER / data.dt))
    correlated[np.abs(correlated) < CERTAIN / np.sqrt(counts.sum())] = 0.0
    phase = SLOW[:, None] * data.dt * data.stride * np.arange(1, len(correlated) + 1)
    loudest = float((1 + 2 * np.cos(phase) @ correlated).max())
    return replace(noise, growth=growth, independent=1.0 / max(loudest, 1.0))
