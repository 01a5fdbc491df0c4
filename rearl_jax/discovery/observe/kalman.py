"""The Kalman filter of a driver: gain, prediction and correction, once for all who run the observer.

State of a driver: position x, speed v, o, what the driver does beside the model (an Ornstein-Uhlenbeck process), and w,
the error of measured positions where it lasts from one time step to the next. The functions take NumPy and JAX arrays
alike, and tangents of a state as they take a state: both steps are linear in it but for the bound of the speed.

Source: Kalman, J. Basic Eng. 82 (1960) 35.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

GAIN_ITERATIONS = 600
"""Recursions of the covariance, after which gains are within 2e-6 of their limit for every noise that is tried, as
`scipy.linalg.solve_discrete_are` has it.
"""

MEASURED = np.array([1.0, 0.0, 0.0, 1.0])
"""Share of x, v, o, w in what is measured [-]."""

STIFFNESS, DAMPING = 0.075, 0.5
"""Response of a driver's acceleration to being ahead of its place [1/s^2] and too fast [1/s] in the observer:
IDM at 20 m/s, 30 m behind, with usual parameters. Without it, what drivers take back would count as less noise.
"""

ANEW = 0.01
"""Share of the variance of lasting errors that is measured anew in every time step [-]: none at all cannot be
inverted.
"""


class Gain(NamedTuple):
    """The filter in its steady state: numbers, or arrays of one shape.

    Attributes:
        x: Correction of the position per innovation [-].
        v: Correction of the speed [1/s].
        o: Correction of the acceleration beside the model [1/s^2].
        w: Correction of the lasting error of measured positions [-].
        kept_o: What is left of o after a time step [-].
        kept_w: What is left of w after a time step [-].
        variance: Variance of the innovations [m^2].
    """

    x: Any
    v: Any
    o: Any
    w: Any
    kept_o: Any
    kept_w: Any
    variance: Any


class State(NamedTuple):
    """State of the observer, or its derivatives, in arrays of one shape.

    Attributes:
        x: Position [m].
        v: Speed [m/s].
        o: Acceleration beside the model [m/s^2].
        w: Lasting error of measured positions [m].
    """

    x: Any
    v: Any
    o: Any
    w: Any


CLOSED_LOOP = Gain(0.0, 0.0, 0.0, 0.0, kept_o=0.0, kept_w=0.0, variance=1.0)
"""The gain that never corrects: a simulation behind the measured leader."""


@dataclass(frozen=True)
class Noise:
    """Noise of drivers and measurements, as the observer takes it.

    Attributes:
        acceleration: Standard deviation of what drivers do beside the model [m/s^2].
        time: Its correlation time [s].
        position: Standard deviation of measured positions [m].
        position_time: Correlation time of their errors [s]; 0 where every time step is measured anew.
        independent: Share of the innovations that are worth as much as all of them, which go together with those before
            where noise is not quite of this form [-].
        growth: Growth of the innovations' variance with the squared acceleration of the leader [s^4/m^2]; a driver who
            is made to accelerate or brake drives less evenly.
    """

    acceleration: float
    time: float
    position: float
    position_time: float = 0.0
    independent: float = 1.0
    growth: float = 0.0

    def gain(self, dt: float, stride: int = 1) -> Gain:
        """Gain in the steady state.

        Args:
            dt: Time of a step [s].
            stride: Steps from one correction to the next.
        """
        return steady_state(self, dt, stride).gain


class SteadyState(NamedTuple):
    """The observer after a long time.

    Attributes:
        gain: Gain of the filter.
        step: From x, v, o, w to those one step later.
        corrected: The same for the error of the prediction where it is corrected first.
        covariance: Covariance of x, v, o, w before each step of a period; the first is corrected.
    """

    gain: Gain
    step: Float[np.ndarray, "4 4"]
    corrected: Float[np.ndarray, "4 4"]
    covariance: list[Float[np.ndarray, "4 4"]]


@cache
def steady_state(noise: Noise, dt: float, stride: int) -> SteadyState:
    """The observer's steady state; arguments as of `Noise.gain`."""
    kept, lasting = np.exp(-dt / noise.time), np.exp(-dt / noise.position_time) if noise.position_time else 0.0
    step = np.diag([1.0, 1.0 - DAMPING * dt, kept, lasting])
    step[0, 1:3], step[1, 0], step[1, 2] = (dt, dt * dt / 2), -STIFFNESS * dt, dt
    position = max(noise.position, 1e-4) ** 2
    error, measured = (position * (1 - lasting**2), ANEW * position) if noise.position_time else (0.0, position)
    shock = np.diag([0.0, 0.0, noise.acceleration**2 * (1 - kept**2), error])
    variance, gain, covariance = np.diag([1.0, 1.0, 1.0, error]), np.zeros(4), []
    for _ in range(GAIN_ITERATIONS):
        covariance = []
        for _ in range(stride):
            variance = step @ variance @ step.T + shock
            covariance.append(variance)
        gain = variance @ MEASURED / (MEASURED @ variance @ MEASURED + measured)
        variance = variance - np.outer(gain, MEASURED @ variance)
    expected = MEASURED @ covariance[-1] @ MEASURED + measured
    # Numbers of NumPy, not of Python: beside them, arrays of single precision are computed with in double.
    found = Gain(*np.array([*gain, kept, lasting, expected]))
    corrected = step - step @ np.outer(gain, MEASURED)
    return SteadyState(found, step, corrected, [covariance[-1], *covariance[:-1]])


def correct(state: State, innovation: Any, gain: Gain) -> State:
    """The state corrected by an innovation [m], 0 where nothing new is measured."""
    return State(
        state.x + gain.x * innovation,
        state.v + gain.v * innovation,
        state.o + gain.o * innovation,
        state.w + gain.w * innovation,
    )


def halfway(state: State, last: Any, dt: float) -> tuple[Any, Any]:
    """Position [m] and speed [m/s] in the middle of the step, under the acceleration of the step before [m/s^2].

    The model is asked there, so that a step does not count as a reaction time.
    """
    return state.x + state.v * (dt / 2) + last * (dt * dt / 8), state.v + last * (dt / 2)


def predict(state: State, speed: Any, gain: Gain, dt: float) -> State:
    """The state one step later, at which the driver has this speed [m/s]."""
    return State(state.x + dt * (state.v + speed) / 2, speed, gain.kept_o * state.o, gain.kept_w * state.w)
