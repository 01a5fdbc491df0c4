"""The Kalman filter of a driver: gain, prediction and correction.

State of a driver: position x, speed v, acceleration residual o (the acceleration that the model does not explain, an
Ornstein-Uhlenbeck process), and w, the part of the position error that is correlated in time. w is an
Ornstein-Uhlenbeck process too; or it follows another one, u, with the same time constant, and is then smooth, as
trackers leave position errors.
The functions accept NumPy and JAX arrays, and also tangents of a state, because both steps are linear except for the
bound of the speed.

Source: Kalman, J. Basic Eng. 82 (1960) 35.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.read.lasting import SMOOTH_COVARIANCE, smooth_step

DOUBLINGS = 12
"""Doublings of the number of recursions of the covariance, whose gains are then within 1e-6 of their limits."""

MEASURED = np.array([1.0, 0.0, 0.0, 1.0, 0.0])
"""Measurement vector: coefficients of x, v, o, w, u in the measured position [-]."""

STIFFNESS, DAMPING = 0.075, 0.5
"""Deceleration that the gain assumes per position ahead of equilibrium [1/s^2] and per excess speed [1/s]: that of IDM
at 20 m/s and a gap of 30 m with default parameters. Without it, the corrections that drivers make would be mistaken for
lower noise.
"""


class Gain(NamedTuple):
    """Gain of the filter in its steady state: numbers, or arrays of one shape. Corrections are per innovation, the
    measured minus the predicted position.

    Attributes:
        x: Correction of the position [-].
        v: Correction of the speed [1/s].
        o: Correction of the acceleration residual [1/s^2].
        w: Correction of the correlated position error [-].
        u: Correction of the process that w follows [-].
        kept_o: Share of o that remains after a time step [-].
        kept_w: Share of w, and of u, that remains after a time step [-].
        fed_w: Share of u that is added to w in a time step [-].
        variance: Variance of the innovations [m^2].
    """

    x: Any
    v: Any
    o: Any
    w: Any
    u: Any
    kept_o: Any
    kept_w: Any
    fed_w: Any
    variance: Any


class State(NamedTuple):
    """State of the observer, or its derivatives, in arrays of one shape.

    Attributes:
        x: Position [m].
        v: Speed [m/s].
        o: Acceleration residual [m/s^2].
        w: Correlated position error [m].
        u: Process that the correlated position error follows if it is smooth [m].
    """

    x: Any
    v: Any
    o: Any
    w: Any
    u: Any


CLOSED_LOOP = Gain(0.0, 0.0, 0.0, 0.0, 0.0, kept_o=0.0, kept_w=0.0, fed_w=0.0, variance=1.0)
"""Zero gain: the observer becomes a simulation behind the measured leader."""


@dataclass(frozen=True)
class Noise:
    """Noise of drivers and measurements as assumed by the observer.

    Attributes:
        acceleration: Standard deviation of the acceleration residual [m/s^2].
        time: Its correlation time [s].
        position: Standard deviation of the white errors of measured positions [m].
        lasting: Standard deviation of their errors that are correlated in time [m].
        lasting_time: Time constant of these errors [s].
        is_smooth: Whether these errors are smooth and follow an Ornstein-Uhlenbeck process; otherwise they are one.
        independent: Effective share of independent innovations [-]; below 1 if innovations are correlated because the
            true noise differs from this model.
        growth: Relative growth of the innovations' variance with the squared acceleration of the leader [s^4/m^2],
            because drivers are less steady while they have to accelerate or brake.
        near_changes: Relative growth of the innovations' variance near changes of leader [-], because no model predicts
            drivers around lane changes as well as elsewhere.
    """

    acceleration: float
    time: float
    position: float
    lasting: float = 0.0
    lasting_time: float = 1.0
    is_smooth: bool = False
    independent: float = 1.0
    growth: float = 0.0
    near_changes: float = 0.0

    def gain(self, dt: float, stride: int = 1) -> Gain:
        """Gain in the steady state, with time steps `dt` [s] and `stride` steps from one correction to the next."""
        return steady_state(self, dt, stride).gain


class SteadyState(NamedTuple):
    """The steady state of the observer.

    Attributes:
        gain: Gain of the filter.
        step: Transition matrix of x, v, o, w, u over one step.
        corrected: Transition matrix of the prediction error when a correction precedes the step.
        covariance: Covariance of x, v, o, w, u before each step of a period; the first step includes a correction.
    """

    gain: Gain
    step: Float[np.ndarray, "5 5"]
    corrected: Float[np.ndarray, "5 5"]
    covariance: list[Float[np.ndarray, "5 5"]]


@cache
def steady_state(noise: Noise, dt: float, stride: int) -> SteadyState:
    """The observer's steady state, from the Riccati equation of a whole period; arguments as of `Noise.gain`.

    The model's acceleration is linearised with STIFFNESS and DAMPING for all drivers, so that one gain serves all.
    """
    kept = np.exp(-dt / noise.time)
    # Covariance of w and u, relative to the variance of w, and their transition matrix; without smooth errors u is 0.
    errors, error_step = SMOOTH_COVARIANCE, smooth_step(noise.lasting_time, dt)
    if not noise.is_smooth:
        errors, error_step = np.diag([1.0, 0.0]), np.diag(np.diag(error_step))
    step = np.zeros((5, 5))
    step[:2, :3] = [[1.0, dt, dt * dt / 2], [-STIFFNESS * dt, 1.0 - DAMPING * dt, dt]]
    step[2, 2], step[3:, 3:] = kept, error_step
    shock = np.diag([0.0, 0.0, noise.acceleration**2 * (1 - kept**2), 0.0, 0.0])
    shock[3:, 3:] = noise.lasting**2 * (errors - error_step @ errors @ error_step.T)  # keeps their covariance constant
    white_variance = max(noise.position, 1e-4) ** 2
    period, shocks = np.eye(5), np.zeros((5, 5))
    for _ in range(stride):
        period, shocks = step @ period, step @ shocks @ step.T + shock
    before_correction = _steady_covariance(period, shocks, white_variance)
    expected = MEASURED @ before_correction @ MEASURED + white_variance
    gain = before_correction @ MEASURED / expected
    covariance = [before_correction - np.outer(gain, MEASURED @ before_correction)]
    for _ in range(stride):
        covariance.append(step @ covariance[-1] @ step.T + shock)
    # NumPy numbers, unlike Python numbers, make single-precision arrays compute in double precision.
    steady_gain = Gain(*np.array([*gain, kept, *error_step[0], expected]))
    corrected = step - step @ np.outer(gain, MEASURED)
    return SteadyState(steady_gain, step, corrected, [before_correction, *covariance[1:-1]])


def _steady_covariance(
    step: Float[np.ndarray, "n n"], shock: Float[np.ndarray, "n n"], white_variance: float
) -> Float[np.ndarray, "n n"]:
    """Covariance of the prediction error before each correction, once it no longer changes. From one correction to the
    next, `step` is the transition matrix and `shock` the covariance of the added noise; `white_variance` is that of the
    white error of a measured position [m^2].

    Every iteration doubles the number of recursions of the covariance. `scipy.linalg.solve_discrete_are` solves the
    same equation, but fails where nearly all noise is that of drivers or that of measurements.

    Source: Chu, Fan, Lin & Wang, Int. J. Control 77 (2004) 767.
    """
    transposed, information, covariance = step.T, np.outer(MEASURED, MEASURED) / white_variance, shock
    for _ in range(DOUBLINGS):
        shrunk = np.linalg.inv(np.eye(len(step)) + information @ covariance)
        transposed, information, covariance = (
            transposed @ shrunk @ transposed,
            information + transposed @ shrunk @ information @ transposed.T,
            covariance + transposed.T @ covariance @ shrunk @ transposed,
        )
    return covariance


def correct(state: State, innovation: Any, gain: Gain) -> State:
    """The state corrected by an innovation [m]; the innovation is 0 without a new measurement."""
    return State(
        state.x + gain.x * innovation,
        state.v + gain.v * innovation,
        state.o + gain.o * innovation,
        state.w + gain.w * innovation,
        state.u + gain.u * innovation,
    )


def halfway(state: State, last: Any, dt: float) -> tuple[Any, Any]:
    """Position [m] and speed [m/s] in the middle of the step, under the acceleration `last` of the step before [m/s^2].

    The model is evaluated there, so that the time step does not act as an additional reaction time.
    """
    return state.x + state.v * (dt / 2) + last * (dt * dt / 8), state.v + last * (dt / 2)


def predict(state: State, speed: Any, gain: Gain, dt: float) -> State:
    """The state one step later, where the driver has the given speed [m/s]."""
    return State(
        state.x + dt * (state.v + speed) / 2,
        speed,
        gain.kept_o * state.o,
        gain.kept_w * state.w + gain.fed_w * state.u,
        gain.kept_w * state.u,
    )
