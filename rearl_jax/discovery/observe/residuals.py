"""Residuals of a calibrated model: innovations (prediction errors of the observer), acceleration residual, gap error.

The acceleration residual is the smoothed state o of the observer: the part of the measured acceleration that the model
does not explain, estimated from the whole drive. It has the smallest error of the available estimates. The filtered o
is late and underestimates persistent residuals; o plus the speed correction per step is unbiased but contains all
measurement noise; the derivative of the speed minus the model's acceleration needs its own cut-off frequency. The
smoothed o has no delay, keeps everything slower than a second, and follows from the innovations alone, so it is valid
for every effect in the observer.

It is meant for figures. Drivers' noise changes speed and gap, so the residual is correlated with both even if no effect
is missing. Dependences are therefore estimated from the innovations (`forcing`), which are independent of the past.

Source: fixed-interval smoother by backward recursion of the innovations, de Jong, Ann. Stat. 17 (1989) 1073.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.observe.candidates import LENS, lens_at
from rearl_jax.discovery.observe.closed_loop import FARTHEST
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit_state import FitState
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP, MEASURED, Gain, Noise, State, correct, predict, steady_state
from rearl_jax.discovery.observe.observer import stimulus, straightened
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Surroundings, is_new

LAGS_FOR = 3.0
"""Longest lag of the autocorrelations [s]."""


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fitted model.

    Attributes:
        state: State of the fitted model.
        prior: Prior distribution of its drivers' parameters.
        noise: Noise of its observer.
        innovation: Measured minus predicted position [m].
        acceleration: Acceleration residual [m/s^2].
        gap: Gap in the closed-loop simulation with the same parameters, minus measured gap [m].
        x, v: Centre [m] and speed [m/s] of the driver halfway to the next time step, predicted from earlier
            measurements.
        surroundings: Measured surroundings halfway to the next time step, as in the observer.
    """

    state: FitState
    prior: Prior
    noise: Noise
    innovation: Float[np.ndarray, "steps pieces"]
    acceleration: Float[np.ndarray, "steps pieces"]
    gap: Float[np.ndarray, "steps pieces"]
    x: Float[np.ndarray, "steps pieces"]
    v: Float[np.ndarray, "steps pieces"]
    surroundings: Surroundings

    def stimulus(self) -> Stimulus:
        """Stimuli of the drivers halfway, `[steps, pieces]`."""
        data = self.state.data
        return stimulus(self.x, self.v, data.length, data.is_truck.astype(float), self.surroundings)

    def autocorrelation(self) -> tuple[Float[np.ndarray, " lags"], Float[np.ndarray, " lags"]]:
        """Lags [s] up to LAGS_FOR, and the autocorrelation of weighted innovations [-]."""
        data = self.state.data
        furthest = max(round(LAGS_FOR / data.dt), data.stride)
        correlations = autocorrelation(self.innovation, data.weight, data.stride, furthest)
        return np.arange(1, len(correlations) + 1) * data.stride * data.dt, correlations


def residuals_of(solver: Solver, state: FitState, noise: Noise) -> Residuals:
    """Residuals of a solved state under the observer for a noise."""
    data = state.data
    innovation = np.asarray(solver.innovations([state])[0], float)
    gap = np.clip(np.asarray(solver.innovations([state], CLOSED_LOOP)[0], float), -FARTHEST, FARTHEST)
    gain, surroundings = noise.gain(data.dt, data.stride), data.halfway()
    # Single precision, in which the innovations were computed: their rounding errors then cancel.
    expected = data.y.astype(np.float32).astype(float) - innovation
    expected = expected - _predicted_errors(innovation * data.is_corrected()[:, None], gain)
    if LENS in state.active:
        lens = lens_at(solver.layout.by_name(jnp.asarray(state.theta)[:, None, None]), solver.layout.knots)
        expected = expected - np.asarray(lens.bend(jnp.asarray(expected)))
        surroundings = straightened(surroundings, lens)
    corrected = expected + gain.x * innovation * data.is_corrected()[:, None]
    expected_next = np.concatenate([expected[1:], expected[-1:]])
    v = (expected_next - corrected) / data.dt
    v[-1] = v[-2]
    return Residuals(
        state=state,
        prior=solver.layout.prior,
        noise=noise,
        innovation=innovation,
        acceleration=smoothed_acceleration(innovation, data.weight, noise, data.dt, data.stride),
        gap=gap,
        x=corrected + v * (data.dt / 2),
        v=np.maximum(v, 0.0),
        surroundings=surroundings,
    )


def _predicted_errors(used: Float[np.ndarray, "steps pieces"], gain: Gain) -> Float[np.ndarray, "steps pieces"]:
    """Correlated position error w [m] that the observer expects in every time step, from the innovations before it;
    `used` are the innovations that correct the observer, 0 elsewhere [m].
    """
    errors, nothing = np.zeros_like(used), np.zeros(used.shape[1])
    state = State(*(nothing,) * 5)  # w depends on the innovations alone, not on where a driver is
    for t, innovation in enumerate(used):
        errors[t] = state.w
        state = predict(correct(state, innovation, gain), nothing, gain, dt=0.0)
    return errors


def smoothed_acceleration(
    innovation: Float[np.ndarray, "steps pieces"],
    weight: Float[np.ndarray, "steps pieces"],
    noise: Noise,
    dt: float,
    stride: int,
) -> Float[np.ndarray, "steps pieces"]:
    """Acceleration residual in every time step, estimated from the whole drive [m/s^2].

    Args:
        innovation: Innovation of the observer with the gain of `noise` [m].
        weight: 1 if a time step counts, else 0; a drive ends at its last time step that counts.
        noise: Noise of the observer.
        dt: Time step [s].
        stride: Time steps from one correction to the next.
    """
    # o smoothed = o predicted + the row of o of the covariance times the information in this and all later innovations.
    observer = steady_state(noise, dt, stride)
    gain = observer.gain
    has_ended = np.cumsum(weight[::-1] > 0, axis=0)[::-1] == 0
    is_corrected = is_new(len(innovation), stride)
    used = np.where(has_ended | ~is_corrected[:, None], 0.0, innovation)
    predicted, o = np.zeros_like(used), np.zeros(used.shape[1])
    for t in range(len(used)):
        predicted[t] = o
        o = gain.kept_o * (o + gain.o * used[t])
    later_information, smoothed = np.zeros((5, used.shape[1])), np.empty_like(used)
    for t in range(len(used) - 1, -1, -1):
        later_information = (observer.corrected if is_corrected[t] else observer.step).T @ later_information
        later_information += MEASURED[:, None] * used[t] / gain.variance
        smoothed[t] = predicted[t] + observer.covariance[t % stride][2] @ later_information
    return np.where(has_ended, 0.0, smoothed)


def autocorrelation(
    innovation: Float[np.ndarray, "steps pieces"],
    weight: Float[np.ndarray, "steps pieces"],
    stride: int,
    furthest: int,
) -> Float[np.ndarray, " lags"]:
    """Autocorrelation of weighted innovations [m] at lags of one, two, ... strides [-], up to the furthest lag [time
    steps]. The weight is 1 where a time step counts; a stride is the number of time steps from one independent
    measurement to the next.
    """
    variance = max(float(((innovation * weight) ** 2).sum() / max(weight.sum(), 1.0)), 1e-12)
    return autocovariances(innovation, weight, range(stride, min(furthest, len(weight) - 1) + 1, stride)) / variance


def autocovariances(
    values: Float[np.ndarray, "steps pieces"], weight: Float[np.ndarray, "steps pieces"], lags: Iterable[int]
) -> Float[np.ndarray, " lags"]:
    """Mean products of values of mean 0 at given lags [time steps], over the pairs of time steps that both count; 0 at
    lags without such pairs.
    """
    counted, covariances = values * weight, []
    for lag in lags:
        pairs = max((weight[lag:] * weight[:-lag]).sum(), 1.0)
        covariances.append((counted[lag:] * counted[:-lag]).sum() / pairs)
    return np.array(covariances)
