"""Response of the innovations (prediction errors of the observer) to an additional acceleration, and estimates of its
size.

The observer maps an additional acceleration b(t) to a change of the innovations. The part that the driver's mean
acceleration and own parameters could imitate is projected out. Least squares on the remaining white innovations gives
the size of b, without bias (b does not depend on the future) and with minimum variance. One small matrix and one vector
per driver are sufficient for all estimates, so drivers can be resampled or left out at no cost.

Source: score test, Rao (1948); partial regression, Frisch & Waugh, Econometrica 1 (1933) 387.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.following import begin_effects, follow
from rearl_jax.discovery.observe.candidates import effects_at
from rearl_jax.discovery.observe.closed_loop import FARTHEST
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.kalman import Gain, State, correct, halfway, predict
from rearl_jax.discovery.observe.residuals import Residuals, smoothed_acceleration
from rearl_jax.discovery.observe.solver import Solver

AT_ONCE = 64
"""Number of accelerations that are passed through the observer in one batch."""

NEGLIGIBLE = 1e-12
"""Absolute innovation [m] or acceleration [m/s^2] below which a value is set to zero."""


@dataclass(frozen=True)
class DriverScores:
    """Scores of each driver for the size of each acceleration, with its mean acceleration and own parameters projected
    out. A column is the derivative of the innovations by the size of one acceleration that the model lacks.

    Attributes:
        gram: Sums over time of products of two columns.
        score: Sums over time of products of a column with the innovation.
        square: Sum of squared innovations [m^2].
        variance: Mean squared innovation over the share of independent innovations [m^2], because correlated ones
            contain less information than their number suggests, see `Noise.independent`.
    """

    gram: Float[np.ndarray, "drivers columns columns"]
    score: Float[np.ndarray, "drivers columns"]
    square: Float[np.ndarray, " drivers"]
    variance: float

    def of(self, columns: Sequence[int] | np.ndarray | slice) -> "DriverScores":
        """Scores of the given columns."""
        return DriverScores(self.gram[:, columns][:, :, columns], self.score[:, columns], self.square, self.variance)


@dataclass(frozen=True)
class AccelerationDerivatives:
    """Derivatives of the model's acceleration in every time step.

    Attributes:
        x: Derivative by the own position [1/s^2].
        v: Derivative by the own speed [1/s].
        own: Derivatives by the logarithms of the driver's own parameters [m/s^2].
    """

    x: Float[np.ndarray, "steps pieces"]
    v: Float[np.ndarray, "steps pieces"]
    own: Float[np.ndarray, "own steps pieces"]


def wanted_acceleration(residuals: Residuals) -> Float[np.ndarray, "steps pieces"]:
    """Acceleration of the drivers' car-following models at the states predicted by the observer [m/s^2]; without added
    effects.
    """
    driver, dt = _driver_rows(residuals.state), residuals.state.data.dt
    return np.asarray(_wanted(residuals.prior, driver, residuals.stimulus(), dt), float)


def acceleration_derivatives(residuals: Residuals) -> AccelerationDerivatives:
    """Derivatives of the car-following model at the states predicted by the observer; added effects change them little
    and are ignored.
    """
    driver, dt = _driver_rows(residuals.state), residuals.state.data.dt
    x, v, own = _wanted_derivatives(residuals.prior, driver, residuals.stimulus(), residuals.x, residuals.v, dt)
    return AccelerationDerivatives(np.asarray(x, float), np.asarray(v, float), np.asarray(own, float))


def _driver_rows(state: FitState) -> tuple[Float[np.ndarray, "own pieces"], Float[np.ndarray, " pieces"]]:
    """Standardised parameters of the drivers, and 1 for truck drivers, else 0."""
    return state.z[state.data.driver].T, state.data.is_truck.astype(float)


# Compiled as a whole, because an operation that is compiled alone takes a tenth of a second, and there are a hundred.
@partial(jax.jit, static_argnames=("prior", "dt"))
def _wanted(prior: Prior, driver: tuple[Array, Array], stimuli: Stimulus, dt: float) -> Float[Array, "steps pieces"]:
    """As `wanted_acceleration`, of drivers given by `_driver_rows`."""
    none_before = jnp.zeros_like(stimuli.speed)  # without effects, the last acceleration is not used
    return follow(stimuli, prior.drivers(*driver).full(stimuli.speed.shape), (), (), none_before, dt)[0]


@partial(jax.jit, static_argnames=("prior", "dt"))
def _wanted_derivatives(
    prior: Prior,
    driver: tuple[Array, Array],
    stimuli: Stimulus,
    x: Float[Array, "steps pieces"],
    v: Float[Array, "steps pieces"],
    dt: float,
) -> tuple[Array, Array, Array]:
    """As `acceleration_derivatives`, at the states x [m], v [m/s]."""
    calibrated = prior.drivers(*driver).full(x.shape)

    def wanted(x: Array, v: Array, logs: Array) -> Array:
        changed = prior.model(*(value * jnp.exp(log) for value, log in zip(calibrated.rows(), logs, strict=True)))
        moved = replace(stimuli, gap=stimuli.gap - (x - stimuli.position), speed=v)
        return follow(moved, changed, (), (), jnp.zeros_like(v), dt)[0]

    _, pullback = jax.vjp(wanted, x, v, jnp.zeros((prior.size, *x.shape), x.dtype))
    return pullback(jnp.ones(x.shape, x.dtype))


def innovation_change(
    accelerations: Float[np.ndarray, "columns steps pieces"], residuals: Residuals, derivatives: AccelerationDerivatives
) -> Float[np.ndarray, "columns steps pieces"]:
    """Change of the innovations [m] by additional accelerations [m/s^2]."""
    data = residuals.state.data
    gain = residuals.noise.gain(data.dt, data.stride)
    parts = [
        _innovation_change(
            accelerations[first : first + AT_ONCE], derivatives.x, derivatives.v, data.is_corrected(), gain, data.dt
        )
        for first in range(0, len(accelerations), AT_ONCE)
    ]
    return _without_denormals(np.concatenate([np.asarray(part, np.float32) for part in parts]))


@partial(jax.jit, static_argnames="dt")
def _innovation_change(
    accelerations: Float[Array, "columns steps pieces"],
    by_x: Float[Array, "steps pieces"],
    by_v: Float[Array, "steps pieces"],
    is_corrected: Float[Array, " steps"],
    gain: Gain,
    dt: float,
) -> Float[Array, "columns steps pieces"]:
    """As `innovation_change`, for one batch: the observer linearised about its states, with the derivatives `by_x` and
    `by_v` of the model's acceleration.
    """

    def step(carry: tuple[State, Array], now: tuple) -> tuple[tuple[State, Array], Array]:
        (change, last), (added, slope_x, slope_v, is_corrected_now) = carry, now
        slope = -change.x - change.w
        change = correct(change, is_corrected_now * slope, gain)
        x, v = halfway(change, last, dt)
        last = slope_x * x + slope_v * v + added + change.o
        change = predict(change, change.v + dt * last, gain, dt)
        # Bounded, because the linear response diverges behind a leader that is measured too close.
        x, v = (jnp.clip(values, -FARTHEST, FARTHEST) for values in (change.x, change.v))
        return (change._replace(x=x, v=v), last), slope

    rows = jnp.moveaxis(jnp.asarray(accelerations, float), 1, 0)
    nothing = jnp.zeros_like(rows[0])
    begin = (State(*[nothing] * 5), nothing)
    return jnp.moveaxis(lax.scan(step, begin, (rows, by_x[:, None], by_v[:, None], is_corrected))[1], 0, 1)


def driver_scores(
    accelerations: Float[np.ndarray, "columns steps pieces"], residuals: Residuals, derivatives: AccelerationDerivatives
) -> DriverScores:
    """Scores of all drivers for the size of accelerations, which are given at size 1 [m/s^2]."""
    columns, n_imitating = _columns(accelerations, residuals, derivatives)
    return _scores(columns, residuals.innovation, n_imitating, residuals)


def innovation_and_acceleration_scores(
    accelerations: Float[np.ndarray, "columns steps pieces"], residuals: Residuals, derivatives: AccelerationDerivatives
) -> tuple[DriverScores, DriverScores]:
    """Scores on the innovations, and scores on the acceleration residual, from which shares of its variance follow."""
    columns, n_imitating = _columns(accelerations, residuals, derivatives)
    data, smoothed = residuals.state.data, np.empty_like(columns)
    for first in range(0, len(columns), AT_ONCE):
        part = np.moveaxis(columns[first : first + AT_ONCE], 1, 0)  # [steps, columns, pieces]
        weight = np.broadcast_to(data.weight[:, None], part.shape).reshape(len(part), -1)
        smooth = smoothed_acceleration(part.reshape(len(part), -1), weight, residuals.noise, data.dt, data.stride)
        smoothed[first : first + AT_ONCE] = np.moveaxis(smooth.reshape(part.shape), 0, 1)
    return (
        _scores(columns, residuals.innovation, n_imitating, residuals),
        _scores(_without_denormals(smoothed), residuals.acceleration, n_imitating, residuals),
    )


def _columns(
    accelerations: np.ndarray, residuals: Residuals, derivatives: AccelerationDerivatives
) -> tuple[np.ndarray, int]:
    """Derivatives of the innovations by the sizes of accelerations that the model lacks, and the number of the first
    ones, by which the driver could imitate others: a constant acceleration, then the driver's own parameters.
    """
    own = np.concatenate([np.ones((1, *residuals.x.shape)), derivatives.own])
    return -np.concatenate(
        [innovation_change(own, residuals, derivatives), innovation_change(accelerations, residuals, derivatives)]
    ), len(own)


def _without_denormals(values: np.ndarray) -> np.ndarray:
    """Values with tiny numbers set to zero, because processors are slow with denormal numbers."""
    return np.where(np.abs(values) < NEGLIGIBLE, np.float32(0), values)


def plain_scores(
    target: Float[np.ndarray, "steps pieces"],
    accelerations: Float[np.ndarray, "columns steps pieces"],
    residuals: Residuals,
    derivatives: AccelerationDerivatives,
) -> DriverScores:
    """Scores of a regression of one acceleration, `target`, on the others, without the observer."""
    own = np.concatenate([np.ones((1, *residuals.x.shape)), derivatives.own])
    return _scores(np.concatenate([own, accelerations]).astype(np.float32), target, len(own), residuals)


def model_acceleration(
    solver: Solver, state: FitState, stimuli: Stimulus, *, of_effects: bool = False
) -> Float[np.ndarray, "steps pieces"]:
    """Acceleration of each driver's model at given stimuli, or the part of it `of_effects`, that is of the added
    candidates [m/s^2].
    """
    data, layout = state.data, solver.layout
    driver = layout.prior.drivers(*_driver_rows(state))
    theta = jnp.repeat(jnp.asarray(state.theta)[:, None], len(data.driver), axis=1)
    effects = effects_at(layout.by_name(theta), jax.tree.map(jnp.asarray, layout.knots), state.active)
    return np.asarray(_model_acceleration(driver, effects, stimuli, data.dt, of_effects), float)


@partial(jax.jit, static_argnames=("dt", "of_effects"))
def _model_acceleration(
    driver: CarFollowing, effects: tuple[Effect, ...], stimuli: Stimulus, dt: float, of_effects: bool
) -> Float[Array, "steps pieces"]:
    """As `model_acceleration`, of given drivers and effects."""

    def step(carry: tuple, now: Stimulus) -> tuple[tuple, Array]:
        memory, last = carry
        wanted, memory = follow(now, driver, effects, memory, last, dt)
        without = follow(now, driver, (), (), last, dt)[0] if of_effects else 0.0
        return (memory, wanted), wanted - without

    memory = begin_effects(effects, jax.tree.map(lambda values: values[0], stimuli), driver, dt)
    return lax.scan(step, (memory, jnp.zeros_like(stimuli.speed[0])), stimuli)[1]


def _scores(
    columns: Float[np.ndarray, "columns steps pieces"],
    target: Float[np.ndarray, "steps pieces"],
    n_imitating: int,
    residuals: Residuals,
) -> DriverScores:
    """Scores of the columns on a target driver by driver, with the first `n_imitating` columns projected out."""
    data = residuals.state.data
    counts, target = (data.weight > 0).astype(np.float32), target.astype(np.float32)
    products = []
    for driver in range(data.n_drivers):
        pieces = np.flatnonzero(data.driver == driver)
        rows = (columns[:, :, pieces] * counts[:, pieces]).reshape(len(columns), -1)
        products.append(_products(rows, (target[:, pieces] * counts[:, pieces]).ravel(), n_imitating))
    gram, score, square = (np.stack([np.asarray(product[k], float) for product in products]) for k in range(3))
    variance = float(square.sum() / max(counts.sum(), 1.0)) / residuals.noise.independent
    return DriverScores(gram, score, square, variance)


@partial(jax.jit, static_argnums=2)
def _products(
    rows: Float[Array, "columns moments"], target: Float[Array, " moments"], n_imitating: int
) -> tuple[Float[Array, "others others"], Float[Array, " others"], Float[Array, ""]]:
    """Gram matrix, score and sum of squares of one driver: products of the rows after the first `n_imitating` with each
    other and with the target, and of the target with itself. The first rows are projected out (QR decomposition).
    """
    own_rows, other_rows = rows[:n_imitating], rows[n_imitating:]
    size = jnp.sqrt(jnp.mean(own_rows**2, axis=1, keepdims=True)) + 1e-12
    basis = jnp.linalg.qr((own_rows / size).T)[0]
    other_rows, target = other_rows - (other_rows @ basis) @ basis.T, target - basis @ (basis.T @ target)
    return other_rows @ other_rows.T, other_rows @ target, target @ target
