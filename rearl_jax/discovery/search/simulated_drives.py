"""Drives simulated with a calibrated model and noise alone behind the measured leaders, and measured with errors."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.signal import bilinear, lfilter

from rearl_jax.core.following import HARDEST_BRAKING
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP, Noise
from rearl_jax.discovery.observe.observer import relative_variance
from rearl_jax.discovery.observe.residuals import smoothed_acceleration
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.lasting import lasting, smooth_lasting
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.smoothing import cut_off, low_pass, smoothed

AT_ONCE = 1200
"""Pieces that are simulated and fitted in one batch."""

FOLLOWER_GAINS = np.array([0.125, 0.5, 0.125, 0.0])
"""Usual response of a following driver to the gap [1/s^2], to the speed difference [1/s], by a time headway of 1 s to
the own speed [1/s], and to the acceleration of the vehicle ahead [-]. Source: Helly, Proc. Symp. Theory of Traffic Flow
(1959).
"""

LEAST_FOLLOWER_GAINS, MOST_FOLLOWER_GAINS = np.array([0.01, 0.05, 0.0, 0.0]), np.array([2.0, 3.0, 1.0, 0.9])
"""Bounds of the response: a driver with smaller gains falls behind for ever, one with larger gains overreacts."""

USUAL_FOLLOWERS = 0.01
"""Weight of FOLLOWER_GAINS in the estimate of the response [driver-minutes]."""


def driver_noise(
    noise: Noise, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of the acceleration residual [m/s^2]: a stationary Ornstein-Uhlenbeck process."""
    return lasting(noise.acceleration, noise.time, shape, dt, rng)


def position_errors(
    noise: Noise, shape: tuple[int, int], dt: float, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Realisations of the errors of measured positions [m]."""
    white = noise.position * rng.standard_normal(shape)
    series = smooth_lasting if noise.is_smooth else lasting
    return white + series(noise.lasting, noise.lasting_time, shape, dt, rng) if noise.lasting else white


def smoothed_alike(known: Float[np.ndarray, "steps pieces"], data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Acceleration residual smoothed with the kernel of the positions and rescaled to the same standard deviation. The
    model is nearly linear, so smoothed noise behind a smoothed leader produces a smoothed drive.
    """
    smooth = data.kernel.smoothed(known, data.dt)
    return smooth * (known.std() / max(float(smooth.std()), 1e-12))


def behind_noisy_drive(
    solver: Solver, state: FitState, noise: Noise, rng: np.random.Generator
) -> Float[np.ndarray, "steps pieces"]:
    """Measured positions minus positions simulated with each driver's own noise level behind the same leaders [m]."""
    data = state.data
    variance = (state.variances / state.variance)[data.driver] * relative_variance(data, noise)
    known = smoothed_alike(driver_noise(noise, data.y.shape, data.dt, rng), data) * np.sqrt(variance)
    (behind,) = solver.innovations([replace(state, pieces=replace(state.pieces, known=known))], CLOSED_LOOP)
    return behind


def simulate_again(
    solver: Solver, state: FitState, noise: Noise, rng: np.random.Generator, *, with_others: bool = True
) -> FitState:
    """The calibrated state with simulated drives: its model behind the same leaders, measured again with errors, as
    other vehicles are if `with_others`. The model that is fitted to them has a constant time gap.
    """
    driven = state.data.y - behind_noisy_drive(solver, state, noise, rng)
    errors = position_errors(noise, driven.shape, state.data.dt, rng)
    data = measured_again(state.data, driven, noise, rng, with_others=with_others)
    y = data.y + errors
    frequency = cut_off(data.noise, data.dt)
    x, v = np.empty_like(y), np.empty_like(y)
    for piece in range(y.shape[1]):
        x[:, piece], v[:, piece], _ = smoothed(y[:, piece], data.dt, frequency)
    pieces = replace(state.pieces, y=y, start=np.stack([x[0], v[0]]), seen=data.halfway(), varied=None)
    return replaced(state, data=replace(data, y=y, smooth=x, smooth_speed=v), pieces=pieces)


def measured_again(
    data: Measured,
    driven: Float[np.ndarray, "steps pieces"],
    noise: Noise,
    rng: np.random.Generator,
    *,
    with_others: bool = True,
) -> Measured:
    """Measured data if the drivers had driven to other positions [m]; `smooth` and `smooth_speed` are not changed.

    The vehicle behind responds to the changed drive. In a recording it responds to the driver, so its position contains
    information on the driver's position; simulated drives without this response would lack that information, and
    measured ones would then show false evidence for a response to the vehicle behind. Other vehicles are measured
    again with errors if `with_others`, provided that errors are correlated in time; white ones are removed by
    smoothing.
    """
    seen, farther = data.surroundings, response_of_follower(driven - data.smooth, data.dt, follower_gains(data))
    seen = replace(
        seen,
        follower_front=seen.follower_front + farther * seen.has_follower,
        follower_speed=seen.follower_speed + np.gradient(farther, data.dt, axis=0) * seen.has_follower,
    )
    if data.fused_errors is not None:
        driven = driven + data.fused_errors.drawn(driven.shape, data.dt, rng)
    if with_others and (data.fused_errors is not None or noise.lasting):
        leader, second, follower = (_lasting_errors(data, noise, rng) for _ in range(3))
        leader_speed, second_speed, follower_speed = (
            np.gradient(errors, data.dt, axis=0) for errors in (leader, second, follower)
        )
        leader_acceleration = seen.leader_acceleration + np.gradient(leader_speed, data.dt, axis=0) * seen.has_leader
        seen = replace(
            seen,
            leader_rear=seen.leader_rear + leader * seen.has_leader,
            leader_centre=seen.leader_centre + leader * seen.has_leader,
            leader_speed=seen.leader_speed + leader_speed * seen.has_leader,
            leader_acceleration=np.clip(leader_acceleration, HARDEST_BRAKING, -HARDEST_BRAKING),
            second_rear=seen.second_rear + second * seen.has_second,
            second_speed=seen.second_speed + second_speed * seen.has_second,
            follower_front=seen.follower_front + follower * seen.has_follower,
            follower_speed=seen.follower_speed + follower_speed * seen.has_follower,
        )
    return replace(data, y=driven, surroundings=seen)


def _lasting_errors(data: Measured, noise: Noise, rng: np.random.Generator) -> Float[np.ndarray, "steps pieces"]:
    """Errors of the smoothed positions of other vehicles [m]."""
    if data.fused_errors is not None:
        return data.fused_errors.drawn(data.y.shape, data.dt, rng)
    errors = position_errors(replace(noise, position=0.0), data.y.shape, data.dt, rng)
    return low_pass(errors, data.dt, cut_off(data.noise, data.dt))


def follower_gains(data: Measured) -> Float[np.ndarray, " four"]:
    """Mean response of the vehicles behind, as in `FOLLOWER_GAINS`, by least squares on their measured acceleration."""
    seen, dt = data.surroundings, data.dt
    rear = data.smooth - data.length / 2
    columns = np.stack(
        [
            rear - seen.follower_front,
            data.smooth_speed - seen.follower_speed,
            -seen.follower_speed,
            np.gradient(data.smooth_speed, dt, axis=0),
            np.gradient(seen.follower_speed, dt, axis=0),
        ]
    )
    # Not where the vehicle behind changes: its gap then jumps by more than either vehicle can move.
    same = np.abs(np.diff(columns[0], axis=0, prepend=columns[0, :1])) < data.smooth_speed * dt + 1.0
    counts = seen.has_follower * (data.weight > 0) * same
    share = counts / np.maximum(counts.sum(axis=0), 1.0)
    columns = (columns - (columns * share).sum(axis=1, keepdims=True)) * counts
    gram = np.einsum("itn,jtn->ij", columns, columns)
    minutes = max(float(counts.sum() * dt / 60), 1e-9)
    usual = np.diag(np.diag(gram)[:4]) * USUAL_FOLLOWERS / minutes + 1e-9 * np.eye(4)
    fitted = np.linalg.solve(gram[:4, :4] + usual, gram[:4, 4] + usual @ FOLLOWER_GAINS)
    return np.clip(fitted, LEAST_FOLLOWER_GAINS, MOST_FOLLOWER_GAINS)


def response_of_follower(
    displacement: Float[np.ndarray, "steps pieces"], dt: float, gains: Float[np.ndarray, " four"] = FOLLOWER_GAINS
) -> Float[np.ndarray, "steps pieces"]:
    """Displacement of the vehicle behind [m] if the vehicle ahead is displaced [m], by the linear car-following model
    with gains as of FOLLOWER_GAINS, discretised by the bilinear transform.
    """
    by_gap, by_approach, by_speed, by_acceleration = gains
    above, below = [by_acceleration, by_approach, by_gap], [1.0, by_approach + by_speed, by_gap]
    return np.asarray(lfilter(*bilinear(above, below, 1 / dt), displacement, axis=0))


def matched_noise(solver: Solver, state: FitState, noise: Noise, rng: np.random.Generator) -> Noise:
    """Noise of drivers for simulated drives in which positions have errors that are correlated in time.

    The fitted noise accounts for such errors of the leader too. Simulations draw them separately, so they must not
    count twice: the drivers' noise is reduced until the acceleration residual, with these errors, has the variance that
    the fitted noise gives it without them.
    """
    data, no_driver_noise = state.data, replace(noise, acceleration=0.0)
    if data.fused_errors is None and not noise.lasting:
        return noise
    exact = replace(state, data=replace(data, fused_errors=None))
    seed = int(rng.integers(2**32))

    def size(simulated: FitState) -> float:
        (innovation,) = solver.innovations([simulated])
        residual = smoothed_acceleration(innovation, data.weight, noise, data.dt, data.stride)
        return float((residual**2 * data.weight).sum())

    def again(state: FitState, noise: Noise, with_others: bool) -> FitState:
        return simulate_again(solver, state, noise, np.random.default_rng(seed), with_others=with_others)

    both, without, errors = (
        size(each)
        for each in (again(state, noise, True), again(exact, noise, False), again(state, no_driver_noise, True))
    )
    share = np.clip((without - errors) / max(both - errors, 1e-12), 0.0, 1.0)
    return replace(noise, acceleration=noise.acceleration * float(np.sqrt(share)))


def noise_alone(
    solver: Solver,
    state: FitState,
    noise: Noise,
    replicates: int,
    seed: int,
    varied: Callable[[np.random.Generator], Float[np.ndarray, "steps pieces"] | None] = lambda _: None,
) -> Iterator[list[FitState]]:
    """Data sets of simulated drives of a calibrated state without missing effects, with the noise as fitted, calibrated
    again in batches; `replicates` is their number. `varied` draws the logarithm of each driver's time gap over its mean
    one; by default the time gap is constant.
    """
    group = max(1, AT_ONCE // max(1, len(state.data.driver)))
    noise = matched_noise(solver, state, noise, np.random.default_rng([seed, replicates]))
    for first in range(0, replicates, group):
        states = []
        for replicate in range(first, min(first + group, replicates)):
            drivers = replace(
                state, pieces=replace(state.pieces, varied=varied(np.random.default_rng([seed, replicate, 2])))
            )
            states.append(simulate_again(solver, drivers, noise, np.random.default_rng([seed, replicate])))
        solver.solve(states, iterations=12, tolerance=0.1)
        yield states
