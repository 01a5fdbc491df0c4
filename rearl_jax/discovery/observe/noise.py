"""Estimation of driver and measurement noise by maximum likelihood of the innovations (prediction errors of the
observer).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.fit_state import FitState, new_state, replaced, with_noise
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.observer import far_from_changes, relative_variance, squared_leader_acceleration
from rearl_jax.discovery.observe.residuals import autocorrelation
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.observe.starts import from_best_start
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.smoothing import lasting_noise
from rearl_jax.discovery.thresholds import THRESHOLDS

ACCELERATIONS = (0.03, 0.05, 0.07, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.45, 0.7, 1.0)
"""Tested standard deviations of the acceleration residual [m/s^2]."""

NOISELESS = 0.05
"""Standard deviation of the acceleration residual [m/s^2] up to which it comes from the time discretisation; that of
the steadiest people is 0.1.
"""

TIMES = (0.6, 1.5, 4.0)
"""Tested correlation times of the acceleration residual [s]. Source of the middle value: Zhang & Sun, arXiv:2210.03571
(highD, about 1.4 s).
"""

USUAL = Noise(acceleration=0.15, time=1.5, position=0.1)
"""Noise from which the estimation begins."""

MOST_GROWTH = 3.0
"""Bound of the growth of noise with the squared acceleration of the leader [s^4/m^2]."""

SPREAD_ITERATIONS = 3
"""Alternating estimates of the spread between drivers and of the drivers' parameters."""

USUAL_DRIVERS = 10.0
"""Weight of the prior spread, as a number of drivers."""

SPREADS = (0.5, 4.0)
"""Bounds of the spread between drivers as a multiple of the prior spread [-]."""

INDEPENDENT_AFTER = 4.0
"""Time after which innovations are uncorrelated [s]."""

BEHAVIOUR_FREQUENCIES = np.linspace(0.05, 2.0, 40)
"""Angular frequencies of driver behaviour [rad/s], periods of 3 s to 2 min."""

SIGNIFICANT = 3.5
"""Standard deviations above which an autocorrelation counts [-]; smaller ones among many lags occur by chance."""

POSITION_TIMES = (0.2, 0.5, 1.0)
"""Tested correlation times of position errors [s], as trackers and filters cause them; white errors are tested too."""

WHITE_SHARE = 0.1
"""Standard deviation of the white part of correlated position errors over that of all [-]; without a white part their
covariance is singular.
"""

SMOOTH_ERRORS = (0.03, 0.05, 0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.4, 0.5)
"""Tested standard deviations of smooth position errors [m]. Their size does not follow from fourth differences, to
which they hardly contribute.
"""

SMOOTH_TIMES = (0.2, 0.35, 0.5, 0.65, 0.8, 1.0)
"""Tested time constants of smooth position errors [s]; slower errors cannot be distinguished from driving."""

SMOOTH_STARTS = (0.08, 0.2), (0.2, 0.5, 0.8)
"""Sizes [m] and time constants [s] of smooth errors from which the search for the most likely ones begins."""

NOISE_SHARES = (1.0, 0.5, 0.25)
"""Shares of the drivers' noise that is most likely without smooth errors with which searches for them begin [-]."""

MOST_CLIMBS = 6
"""Largest number of alternations between the search for drivers' noise and the search for position errors."""


def best_noise(solver: Solver, state: FitState, tried: Sequence[Noise]) -> tuple[Noise, float]:
    """The most likely of the tried noises, given a state's innovations and parameters, and its log-likelihood [nats].

    The drivers' own parameters are integrated out, because their fit has absorbed part of the noise, and more of it the
    smaller the assumed noise is.

    Source: restricted likelihood, Patterson & Thompson, Biometrika 58 (1971) 545.
    """
    log_likelihoods = noise_likelihoods(solver, state, tried)
    best = int(np.argmax(log_likelihoods))
    return tried[best], log_likelihoods[best]


def noise_likelihoods(solver: Solver, state: FitState, tried: Sequence[Noise]) -> list[float]:
    """The log-likelihood [nats] of a state's innovations under each noise, as in `best_noise`."""
    # S is the variance that each observer expects, not the best fit, because the errors' size determines the noise.
    trials = [_far_from_changes(with_noise(state, noise)) for noise in tried]
    solver.sums(trials)
    return [float(trial.log_likelihood().sum()) - 0.5 * float(trial.log_width().sum()) for trial in trials]


def _far_from_changes(state: FitState) -> FitState:
    """The state with data far from changes of leader only; unchanged if these are few.

    Near changes no model predicts drivers well. Such episodes would make the drivers' noise seem larger than it is, and
    parameters calibrated under too large noise are biased.
    """
    return replaced(state, pieces=replace(state.pieces, weight=far_from_changes(state.data, state.pieces.weight)))


def under_best_noise(
    solver: Solver,
    state: FitState,
    noise: Noise,
    levels: Sequence[float] = ACCELERATIONS,
    *,
    iterations: int = 20,
) -> tuple[FitState, Noise]:
    """The state solved again under the noise that is most likely at its present parameters, and that noise; under the
    given noise, from which the search begins, if it is one of the levels and more likely at its own parameters than the
    new one at the new ones.

    `levels` are the tested standard deviations of the acceleration residual, ascending [m/s^2]; `iterations` as in
    `Solver.solve`.
    """
    found = _climbed(solver, state, noise, {"acceleration": levels, "time": TIMES})
    noises = [found] if found == noise or noise.acceleration not in levels else [noise, found]
    states = [with_noise(state, each) for each in noises]
    solver.solve(states, iterations=iterations, tolerance=0.05)
    return _most_likely(solver, states, noises)


def _climbed(solver: Solver, state: FitState, noise: Noise, levels: Mapping[str, Sequence[float]]) -> Noise:
    """The most likely noise, by steps on a grid from a given noise to the most likely neighbour, until no neighbour is
    more likely; `levels` are the tested values of two fields of the noise. The likelihood has one maximum, so most of
    the grid need not be computed.
    """
    (first, rows), (second, columns) = ((name, sorted({*values})) for name, values in levels.items())
    columns = sorted({*columns, getattr(noise, second)})
    log_likelihoods: dict[tuple[int, int], float] = {}

    def noise_at(place: tuple[int, int]) -> Noise:
        return replace(noise, **{first: rows[place[0]], second: columns[place[1]]})

    here = int(np.argmin(np.abs(np.asarray(rows) - getattr(noise, first)))), columns.index(getattr(noise, second))
    while True:
        near_rows, near_columns = (
            range(max(place - 1, 0), min(place + 2, len(values)))
            for place, values in zip(here, (rows, columns), strict=True)
        )
        around = [(row, column) for row in near_rows for column in near_columns]
        new = [place for place in around if place not in log_likelihoods]
        if new:
            log_likelihoods |= dict(
                zip(new, noise_likelihoods(solver, state, [noise_at(place) for place in new]), strict=True)
            )
        best = max(around, key=log_likelihoods.__getitem__)
        if log_likelihoods[best] <= log_likelihoods[here]:
            return noise_at(here)
        here = best


def under_best_time(solver: Solver, state: FitState, tried: Sequence[Noise]) -> tuple[FitState, Noise]:
    """The state under the most likely of some noises with different correlation times, and that noise.

    For each correlation time the state is solved again under its most likely noise before likelihoods are compared,
    because parameters found under one noise favour that noise.
    """
    chosen = []
    for time in dict.fromkeys(noise.time for noise in tried):
        chosen.append(best_noise(solver, state, [noise for noise in tried if noise.time == time])[0])
    states = [with_noise(state, noise) for noise in chosen]
    solver.solve(states, iterations=20, tolerance=0.05)
    return _most_likely(solver, states, chosen)


def _most_likely(solver: Solver, states: Sequence[FitState], noises: Sequence[Noise]) -> tuple[FitState, Noise]:
    """The most likely of some states, each solved under a noise of its own, and its noise."""
    log_likelihoods = [
        noise_likelihoods(solver, solved, [noise])[0] for solved, noise in zip(states, noises, strict=True)
    ]
    best = int(np.argmax(log_likelihoods))
    return states[best], noises[best]


def noise_levels(noise: Noise) -> list[Noise]:
    """Noise with each of ACCELERATIONS at every correlation time of TIMES; other values as given."""
    return [replace(noise, acceleration=sd, time=time) for sd in ACCELERATIONS for time in TIMES]


def levels_up_to(noise: Noise) -> list[float]:
    """Tested noise levels of drivers up to the present one [m/s^2], because an added effect can only reduce noise."""
    return [sd for sd in ACCELERATIONS if sd <= noise.acceleration] or [ACCELERATIONS[0]]


def calibrate(solver: Solver, data: Measured) -> tuple[FitState, Noise]:
    """Joint calibration of drivers, population and noise, without candidates."""
    start = replace(USUAL, position=data.noise)
    state = from_best_start(solver, new_state(data, solver.layout, start), iterations=8)
    noise, log_likelihood = best_noise(solver, state, noise_levels(start))
    with_correlated_errors = [
        replace(noise, acceleration=sd, position=WHITE_SHARE * size, lasting=size, lasting_time=time)
        for time in POSITION_TIMES
        for size in [lasting_noise(data.noise, time, data.dt)]  # one value per time
        for sd in ACCELERATIONS
    ]
    other_noise, other_log_likelihood = best_noise(solver, state, with_correlated_errors)
    if other_log_likelihood > log_likelihood + THRESHOLDS.lasting_noise_gain:
        noise, log_likelihood = other_noise, other_log_likelihood
    smooth = _with_smooth_errors(solver, state, replace(noise, position=data.noise), log_likelihood)
    if smooth is not None:
        state, noise = smooth
    state, noise = under_best_time(solver, state, noise_levels(noise))
    state = with_spread(solver, state)
    noise = with_growth_and_independence(solver, state, noise)
    state = with_noise(state, noise)
    solver.solve([state], iterations=10)
    return state, noise


def _with_smooth_errors(solver: Solver, state: FitState, noise: Noise, least: float) -> tuple[FitState, Noise] | None:
    """The state solved again under the most likely noise with smooth position errors, and that noise; None if
    its log-likelihood is not clearly above `least`, that without such errors [nats].

    The likelihood has several maxima, because noisy drivers and small errors resemble steady drivers and large errors.
    Each search begins with another noise of the drivers, and the maxima are compared.
    """
    sizes, times = SMOOTH_STARTS
    best, most = None, least + THRESHOLDS.lasting_noise_gain
    for share in NOISE_SHARES:
        steadier = replace(noise, acceleration=share * noise.acceleration, is_smooth=True)
        starts = [replace(steadier, lasting=size, lasting_time=time) for size in sizes for time in times]
        found = _under_smooth_errors(solver, state, best_noise(solver, state, starts)[0], least)
        if found is None:
            continue
        (log_likelihood,) = noise_likelihoods(solver, found[0], [found[1]])
        if log_likelihood > most:
            best, most = found, log_likelihood
    return best


def _under_smooth_errors(solver: Solver, state: FitState, noise: Noise, least: float) -> tuple[FitState, Noise] | None:
    """The state and the noise at the maximum of the likelihood near a noise with smooth errors; None if the
    log-likelihood under that noise is below `least` [nats].

    Parameters that were estimated without such errors make them seem unlikely, so noise and parameters are estimated
    alternately.
    """
    state = with_noise(state, noise)
    solver.solve([state], iterations=8, tolerance=1.0)
    if noise_likelihoods(solver, state, [noise])[0] < least:
        return None
    for _ in range(MOST_CLIMBS):
        before = noise
        noise = _climbed(solver, state, noise, {"lasting": SMOOTH_ERRORS, "lasting_time": SMOOTH_TIMES})
        noise = _climbed(solver, state, noise, {"acceleration": ACCELERATIONS, "time": TIMES})
        state = with_noise(state, noise)
        solver.solve([state], iterations=8, tolerance=1.0)
        if noise == before:
            break
    return state, noise


def with_spread(solver: Solver, state: FitState) -> FitState:
    """The state solved with the spread between its drivers."""
    for _ in range(SPREAD_ITERATIONS):
        state = replaced(state, spread=spread_of(state))
        solver.solve([state], iterations=5, tolerance=0.3)
    return state


def spread_of(state: FitState) -> Float[np.ndarray, " own"]:
    """Standard deviations of standardised parameters between the drivers of a solved state.

    Estimation errors of drivers count as spread, so that drivers with little data do not look alike; the prior spread
    has the weight of USUAL_DRIVERS drivers. The spread is estimated once, for the calibrated base model, and kept for
    every candidate, because a spread that shrank under one candidate only would give false evidence.

    Source: expectation maximisation, Dempster, Laird & Rubin, J. R. Stat. Soc. B 39 (1977) 1.
    """
    square = (USUAL_DRIVERS + (state.away**2 + state.own_variance).sum(axis=0)) / (USUAL_DRIVERS + len(state.z))
    return np.clip(np.sqrt(square), *SPREADS)


def with_growth_and_independence(solver: Solver, state: FitState, noise: Noise) -> Noise:
    """The noise with its growth and its share of independent innovations, estimated from the innovations of a fitted
    state.

    Correlated innovations contain less information. For a score whose derivative varies at some frequency, the loss is
    the spectral density of the innovations there, relative to white noise; the largest density over the frequencies of
    driver behaviour is used.

    Source: long-run variance, Newey & West, Econometrica 55 (1987) 703.
    """
    data = state.data
    (innovation,) = solver.innovations([state])
    variance = state.variances[data.driver]
    relative = innovation**2 / (variance * relative_variance(data, replace(noise, growth=0.0)))
    counts, squared = data.weight, squared_leader_acceleration(data)
    squared_mean, mean = (float((values * counts).sum() / counts.sum()) for values in (squared, relative))
    # Regression of the squared relative innovations on the squared acceleration of the leader.
    centred = squared - squared_mean
    slope = float((relative * centred * counts).sum() / max(float((centred**2 * counts).sum()), 1e-9))
    level = mean - slope * squared_mean
    growth = min(max(slope, 0.0) / max(level, 0.1 * mean), MOST_GROWTH)
    scaled = innovation / np.sqrt(variance * relative_variance(data, replace(noise, growth=growth)))
    correlations = autocorrelation(scaled, counts, data.stride, round(INDEPENDENT_AFTER / data.dt))
    correlations[np.abs(correlations) < SIGNIFICANT / np.sqrt(counts.sum())] = 0.0
    phase = BEHAVIOUR_FREQUENCIES[:, None] * data.dt * data.stride * np.arange(1, len(correlations) + 1)
    largest_density = float((1 + 2 * np.cos(phase) @ correlations).max())
    return replace(noise, growth=growth, independent=1.0 / max(largest_density, 1.0))
