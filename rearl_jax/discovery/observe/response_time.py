"""Response time of drivers: delay of their measured acceleration behind the acceleration of their model.

The model acceleration is computed at the measured state in every time step, so errors do not accumulate. A direct
correlation of measured and model acceleration would be biased, because the driver's noise changes gap and speed and
thereby the model acceleration. The leader's acceleration does not depend on this noise. If drivers respond late, the
covariance of their acceleration with the leader's earlier acceleration equals that of the model acceleration, shifted
by the response time. A piece is an uninterrupted part of a track.

Source: delay by cross-correlation, Knapp & Carter, IEEE Trans. ASSP 24 (1976) 320; with the leader's acceleration as
the instrument, Young, Recursive Estimation and Time-Series Analysis (2011), chapter 7.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.observe.candidates import LENS, REACTION_DELAY, lens_at
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.forcing import model_acceleration
from rearl_jax.discovery.observe.observer import stimulus, straightened, straightened_start
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.thresholds import THRESHOLDS

LONGEST_AFTER = 6.0
"""Longest lag of the follower's acceleration behind the leader's [s]."""

EARLIEST, LATEST = -1.0, 3.0
"""Range of tested response times [s]; below zero the model is later than the driver."""

LEAST_DELAY = 0.15
"""Response time [s] from which drivers' own parameters are calibrated again under that delay."""


@dataclass(frozen=True)
class Covariances:
    """Covariances with the leader's earlier acceleration, driver by driver, summed over time [m^2/s^4].

    Attributes:
        dt: Time step [s].
        measured: Covariances of the measured acceleration, at lags from 0 to LONGEST_AFTER.
        modelled: Covariances of the model acceleration, at lags from -LATEST to LONGEST_AFTER - EARLIEST.
    """

    dt: float
    measured: Float[np.ndarray, "drivers lags"]
    modelled: Float[np.ndarray, "drivers more"]

    def delay(self, drivers: Int[np.ndarray, " some"]) -> float:
        """Shift [s] at which the model's covariances fit the measured ones of the given drivers best."""
        of_measured, of_model = self.measured[drivers].sum(axis=0), self.modelled[drivers].sum(axis=0)
        shifted = np.lib.stride_tricks.sliding_window_view(of_model, len(of_measured))[::-1]  # from EARLIEST to LATEST
        similarity = shifted @ of_measured / np.maximum(np.linalg.norm(shifted, axis=1), 1e-12)
        best, earliest = int(np.argmax(similarity)), round(EARLIEST / self.dt)
        if not 0 < best < len(similarity) - 1:
            return (best + earliest) * self.dt
        before, middle, after = similarity[best - 1 : best + 2]  # vertex of the parabola through three values
        return float(best + earliest + 0.5 * (before - after) / (before - 2 * middle + after)) * self.dt


@dataclass(frozen=True)
class Responses:
    """Response times of drivers.

    Attributes:
        undelayed: Covariances under the model.
        delayed: Covariances under the model with a delay and own parameters calibrated again; None if no delay was
            added.
        added: The added delay [s].
    """

    undelayed: Covariances
    delayed: Covariances | None = None
    added: float = 0.0

    def figure(self, resampling: Resampling) -> dict[str, float] | None:
        """Response time {value, low, high} [s] with its interval over drivers; None if it is not identified, because
        its values in the resamples differ too much or lie at the ends of the tested range.
        """
        samples = resampling.samples(len(self.undelayed.measured))
        figure = resampling.figure(np.array([self.of(drivers) for drivers in samples]))
        low, high = figure["low"], figure["high"]
        is_inside = low > EARLIEST + self.undelayed.dt and high < LATEST - self.undelayed.dt
        return figure if is_inside and high - low <= THRESHOLDS.widest_response_time else None

    def of(self, drivers: Int[np.ndarray, " some"]) -> float:
        """Response time of the given drivers [s]: the delay with which the model is no longer ahead of them.

        Parameters calibrated without a delay imitate part of it. The shift that remains after a delay was added shows
        which part, and the response time is corrected by it.
        """
        late = self.undelayed.delay(drivers)
        if self.delayed is None:
            return late
        reduction = late - self.delayed.delay(drivers)
        return late if reduction < self.added / 2 else late * self.added / reduction


def responses(solver: Solver, state: FitState) -> Responses:
    """Response times of the drivers of a state."""
    undelayed = covariances(solver, state)
    late = undelayed.delay(np.arange(state.data.n_drivers))
    layout = solver.layout
    if late < LEAST_DELAY or REACTION_DELAY in state.active or REACTION_DELAY not in layout.candidates:
        return Responses(undelayed)
    places = list(layout.candidates[REACTION_DELAY].free)  # indices of theta, the parameters of all candidates
    theta = state.theta.copy()
    theta[places] = np.minimum(late, layout.high[places])
    delayed = replaced(state, theta=theta, active=(*state.active, REACTION_DELAY))
    solver.solve([delayed], iterations=15, tolerance=0.1)
    return Responses(undelayed, covariances(solver, delayed), float(theta[places[0]]))


def covariances(solver: Solver, state: FitState) -> Covariances:
    """Covariances of a state; the mean of each piece is subtracted from accelerations."""
    data = state.data
    modelled = model_acceleration(solver, state, _measured_stimuli(solver, state))
    counts = _between_measurements(data.weight > 0, data.stride)
    leader = data.surroundings.leader_acceleration
    measured, modelled, of_leader = (
        (values - (values * counts).sum(axis=0) / np.maximum(counts.sum(axis=0), 1)) * counts
        for values in (np.gradient(data.smooth_speed, data.dt, axis=0), modelled, leader)
    )

    def lagged(values: np.ndarray, first: int, last: int) -> np.ndarray:
        rows = [_lagged(values, of_leader, data.leader, lag) for lag in range(first, last + 1)]
        sums = np.zeros((data.n_drivers, len(rows)))
        np.add.at(sums, data.driver, np.array(rows).T)
        return sums

    longest, earliest, latest = (round(time / data.dt) for time in (LONGEST_AFTER, EARLIEST, LATEST))
    return Covariances(data.dt, lagged(measured, 0, longest), lagged(modelled, -latest, longest - earliest))


def _between_measurements(counts: Bool[np.ndarray, "steps pieces"], stride: int) -> Bool[np.ndarray, "steps pieces"]:
    """True for time steps between two neighbouring ones that count, both included."""
    measured, row = counts[::stride], np.arange(len(counts))
    last, following = row // stride, -(-row // stride)  # the measurements before and after, rounded down and up
    return measured[last] & measured[np.minimum(following, len(measured) - 1)] & (following < len(measured))[:, None]


def _lagged(
    values: Float[np.ndarray, "steps pieces"],
    of_leader: Float[np.ndarray, "steps pieces"],
    leader: Int[np.ndarray, "steps pieces"],
    lag: int,
) -> Float[np.ndarray, " pieces"]:
    """Sum of products of values with those of the leader `lag` time steps before, if it is the same, piece by piece."""
    n = len(values)
    late, early = slice(max(lag, 0), n + min(lag, 0)), slice(max(-lag, 0), n - max(lag, 0))
    return (values[late] * of_leader[early] * (leader[late] == leader[early])).sum(axis=0)


def _measured_stimuli(solver: Solver, state: FitState) -> Stimulus:
    """Stimuli of the drivers at their measured positions and speeds, without camera distortion if that was added."""
    data = state.data
    x, v, surroundings = jax.tree.map(jnp.asarray, (data.smooth, data.smooth_speed, data.surroundings))
    if LENS in state.active:
        knots = jax.tree.map(jnp.asarray, solver.layout.knots)
        lens = lens_at(solver.layout.by_name(jnp.asarray(state.theta)[:, None, None]), knots)
        surroundings, (x, v) = straightened(surroundings, lens), straightened_start(jnp.stack([x, v]), lens)
    return stimulus(x, v, data.length, data.is_truck.astype(float), surroundings)
