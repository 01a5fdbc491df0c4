"""Response time of drivers: how much later than their model asks they accelerate.

The model is asked in every time step where its driver was measured to be, so no error adds up. What drivers do beside
the model moves gap and speed, and with them what the model asks; correlated with each other, both would show that. What
the leader does owes nothing to it: if drivers do late what the model asks, the covariance of their acceleration with
the leader's some time before is that of the model's, later by the response time.

Source: delay by cross-correlation, Knapp & Carter, IEEE Trans. ASSP 24 (1976) 320; with the leader's acceleration as
the instrument, Young, Recursive Estimation and Time-Series Analysis (2011), chapter 7.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Bool, Float

from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.following import begin_effects, follow
from rearl_jax.discovery.observe.candidates import LENS, effects_at, lens_at
from rearl_jax.discovery.observe.observer import stimulus, straightened, straightened_start
from rearl_jax.discovery.observe.solver import FitState, Solver

LONGEST_AFTER = 6.0
"""Time after what a leader does over which its follower is watched [s]."""

EARLIEST, LATEST = -1.0, 3.0
"""Response times that are tried [s]; below zero the model is later than the driver."""


@dataclass(frozen=True)
class Covariances:
    """Covariances with the leader's acceleration before, driver by driver, summed over time [m^2/s^4].

    Attributes:
        dt: Time step [s].
        measured: Of the measured acceleration, from lag 0 to LONGEST_AFTER.
        asked: Of what the model asks, from lag -LATEST to LONGEST_AFTER - EARLIEST.
    """

    dt: float
    measured: Float[np.ndarray, "drivers lags"]
    asked: Float[np.ndarray, "drivers more"]


def response_time(
    solver: Solver, state: FitState, confidence: float, draws: int, seed: int
) -> dict[str, float] | None:
    """Response time [s] of the drivers of a state with its interval over drivers, as in verdict.json; None where it is
    not identified: where resamples of the drivers have it at the ends of what is tried.
    """
    found = covariances(solver, state)
    value, rng, n = delay(found, np.arange(state.data.n_drivers)), np.random.default_rng(seed), state.data.n_drivers
    drawn = np.array([delay(found, rng.integers(0, n, n)) for _ in range(draws)])
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2]).tolist()
    is_inside = low > EARLIEST + state.data.dt and high < LATEST - state.data.dt
    return {"value": value, "low": low, "high": high} if is_inside else None


def delay(found: Covariances, drivers: np.ndarray) -> float:
    """Shift [s] with which the model's covariances are most alike to the measured ones of some drivers."""
    measured, asked = found.measured[drivers].sum(axis=0), found.asked[drivers].sum(axis=0)
    latest, earliest = round(LATEST / found.dt), round(EARLIEST / found.dt)
    shifted = np.lib.stride_tricks.sliding_window_view(asked, len(measured))[::-1]  # from EARLIEST to LATEST
    alike = shifted @ measured / np.maximum(np.linalg.norm(shifted, axis=1), 1e-12)
    best = int(np.argmax(alike))
    if not 0 < best < latest - earliest:
        return (best + earliest) * found.dt
    before, at, after = alike[best - 1 : best + 2]
    return float(best + earliest + 0.5 * (before - after) / (before - 2 * at + after)) * found.dt


def covariances(solver: Solver, state: FitState) -> Covariances:
    """Covariances of a state; accelerations are taken about their means in each piece."""
    data = state.data
    counts = _between_looks(data.weight > 0, data.stride)
    leader = data.around.leader_acceleration
    made, asked, before = (
        (values - (values * counts).sum(axis=0) / np.maximum(counts.sum(axis=0), 1)) * counts
        for values in (np.gradient(data.smooth_speed, data.dt, axis=0), asked_acceleration(solver, state), leader)
    )

    def lagged(values: np.ndarray, first: float, last: float) -> np.ndarray:
        rows = [
            _lagged(values, before, data.leader, lag) for lag in range(round(first / data.dt), round(last / data.dt) + 1)
        ]
        total = np.zeros((data.n_drivers, len(rows)))
        np.add.at(total, data.driver, np.array(rows).T)
        return total

    return Covariances(
        data.dt, lagged(made, 0.0, LONGEST_AFTER), lagged(asked, -LATEST, LONGEST_AFTER - EARLIEST)
    )


def _between_looks(counts: Bool[np.ndarray, "steps pieces"], stride: int) -> Bool[np.ndarray, "steps pieces"]:
    """Time steps between two neighbouring ones that count, both included."""
    looks, row = counts[::stride], np.arange(len(counts))
    last, following = row // stride, -(-row // stride)
    return looks[last] & looks[np.minimum(following, len(looks) - 1)] & (following < len(looks))[:, None]


def _lagged(
    values: Float[np.ndarray, "steps pieces"],
    before: Float[np.ndarray, "steps pieces"],
    leader: np.ndarray,
    lag: int,
) -> Float[np.ndarray, " pieces"]:
    """Sum of products of values with those of the same leader `lag` time steps before, piece by piece."""
    n = len(values)
    late, early = slice(max(lag, 0), n + min(lag, 0)), slice(max(-lag, 0), n - max(lag, 0))
    return (values[late] * before[early] * (leader[late] == leader[early])).sum(axis=0)


def asked_acceleration(solver: Solver, state: FitState) -> Float[np.ndarray, "steps pieces"]:
    """Acceleration [m/s^2] that the model asks of each driver at the measured place and speed."""
    data, layout = state.data, solver.layout
    is_truck = data.is_truck.astype(float)
    driver = layout.prior.drivers(jnp.asarray(state.z[data.driver].T), is_truck)
    numbers = layout.by_name(jnp.repeat(jnp.asarray(state.theta)[:, None], len(data.driver), axis=1))
    knots = jax.tree.map(jnp.asarray, layout.knots)
    effects = effects_at(numbers, knots, state.active)
    x, v, around = jax.tree.map(jnp.asarray, (data.smooth, data.smooth_speed, data.around))
    if LENS in state.active:
        lens = lens_at(layout.by_name(jnp.asarray(state.theta)[:, None, None]), knots)
        around, (x, v) = straightened(around, lens), straightened_start(jnp.stack([x, v]), lens)
    seen = jax.vmap(stimulus, in_axes=(0, 0, None, None, 0))(x, v, jnp.asarray(data.length), is_truck, around)

    def step(carry: tuple, now: Stimulus) -> tuple[tuple, Array]:
        memory, last = carry
        asked, memory = follow(now, driver, effects, memory, last, data.dt)
        return (memory, asked), asked

    memory = begin_effects(effects, jax.tree.map(lambda values: values[0], seen), driver, data.dt)
    first = memory, jnp.zeros(x.shape[1:])
    return np.asarray(jax.jit(lambda carry, rows: lax.scan(step, carry, rows)[1])(first, seen), float)
