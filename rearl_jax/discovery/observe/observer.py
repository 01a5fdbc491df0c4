"""The observer: a driver model corrected by the measured positions, and its innovations.

Each step predicts with the model and corrects by a gain times the innovation, measured minus predicted position
(`kalman`).

    gain 0: a closed-loop simulation, whose errors are those that calibrations usually report;
    steady-state Kalman gain: the innovations of a correct model are white, so tests on them are calibrated.

Source: prediction-error method, Ljung, System Identification (1999), chapter 7.
"""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.following import begin_effects, follow
from rearl_jax.discovery.observe.early_leader import RecordedStimulus
from rearl_jax.discovery.observe.kalman import Gain, Noise, State, correct, halfway, predict
from rearl_jax.discovery.observe.lens import Lens
from rearl_jax.discovery.read.measured import Measured, Surroundings

MOST_SQUARED_ACCELERATION = 4.0
"""Bound of the squared acceleration of the leader in the growth of the follower's noise [m^2/s^4]."""

BEFORE_CHANGE, AFTER_CHANGE = 4.0, 10.0
"""Times before and after a change of leader in which the innovations may vary more [s]: the duration of a lane change,
and that of the relaxation of short gaps.

Sources: Toledo & Zohar, Transp. Res. Rec. 1999 (2007) 71; Keane & Gao, Transp. Res. C 125 (2021) 102990.
"""

LEAST_FAR = 0.3
"""Share of the data that must be far from changes of leader for noise to be judged there alone [-]."""


class Pieces(eqx.Module):
    """Arrays for the observer; the last axis is the pieces, uninterrupted parts of tracks (`read.measured`).

    Attributes:
        y: Measured position [m].
        weight: Weight of the time step [-]; 0 if it does not count.
        is_corrected: 1 in time steps in which the observer corrects its prediction, else 0.
        start: Position [m] and speed [m/s] in the first time step.
        seen: Surroundings in the middle between each time step and the next.
        length: Own length [m].
        is_truck: 1 for trucks.
        gain: Gain of the filter, each field an array over pieces.
        deviation: Standard deviation of innovations [m]; some multiple of it is the limit for outliers.
        known: Prescribed acceleration in addition to the model [m/s^2]; one row of zeros for none.
        varied: Logarithm of the time gap over the driver's own time gap [-]; None if it does not vary.
    """

    y: Float[Any, "steps pieces"]
    weight: Float[Any, "steps pieces"]
    is_corrected: Float[Any, "steps pieces"]
    start: Float[Any, "two pieces"]
    seen: Surroundings
    length: Float[Any, " pieces"]
    is_truck: Float[Any, " pieces"]
    gain: Gain
    deviation: Float[Any, " pieces"]
    known: Float[Any, "#steps pieces"]
    varied: Float[Any, "steps pieces"] | None = None


def innovations(
    pieces: Pieces,
    driver: CarFollowing,
    effects: tuple[Effect, ...],
    lens: Lens | None,
    dt: float,
) -> Float[Array, "steps pieces"]:
    """Measured minus predicted position in every time step [m]; in the first step, minus the smoothed start position.

    Args:
        pieces: Measured drives.
        driver: Car following of the drivers.
        effects: Effects that act on the drivers.
        lens: Distortion of positions by the camera; None for none.
        dt: Time step [s].
    """
    pieces = jax.tree.map(jnp.asarray, pieces)
    length, gain = pieces.length, pieces.gain

    def seen(x: Array, v: Array, now: Surroundings) -> Stimulus:
        return stimulus(x, v, length, pieces.is_truck, now if lens is None else straightened(now, lens))

    def step(carry: tuple, now: tuple[Array, Array, Surroundings, Array, Array | None]) -> tuple[tuple, Array]:
        (state, last, memory), (y, is_corrected, surroundings, extra, varied) = carry, now
        x = state.x
        innovation = y - state.w - (x if lens is None else x + lens.bend(x))
        state = correct(state, is_corrected * innovation, gain)
        middle_x, middle_v = halfway(state, last, dt)
        stimuli = seen(middle_x, jnp.maximum(middle_v, 0.0), surroundings)
        wanted, memory = follow(stimuli, with_time_gap(driver, varied), effects, memory, last, dt)
        acceleration = wanted + state.o + extra
        speed = jnp.maximum(state.v + acceleration * dt, 0.0)
        return (predict(state, speed, gain, dt), acceleration, memory), innovation

    x, v = pieces.start if lens is None else straightened_start(pieces.start, lens)
    nothing = jnp.zeros_like(x)
    memory = begin_effects(effects, seen(x, v, jax.tree.map(lambda values: values[0], pieces.seen)), driver, dt)
    extra = jnp.broadcast_to(pieces.known, pieces.y.shape)
    begin = (State(x, v, o=nothing, w=nothing, u=nothing), nothing, memory)
    return lax.scan(step, begin, (pieces.y, pieces.is_corrected, pieces.seen, extra, pieces.varied))[1]


def with_time_gap(driver: CarFollowing, varied: Float[Array, " pieces"] | None) -> CarFollowing:
    """The drivers with their time gap changed by a given difference of its logarithm; None for no change."""
    if varied is None:
        return driver
    return driver.with_setpoints(driver.desired_speed, driver.time_gap * jnp.exp(varied), driver.jam_gap)


def stimulus(
    x: Float[Any, "*n"],
    v: Float[Any, "*n"],
    length: Float[Any, " pieces"],
    is_truck: Float[Any, " pieces"],
    now: Surroundings,
) -> RecordedStimulus:
    """Stimulus of drivers at x [m] with speed v [m/s] among the measured vehicles."""
    x, v, now = jax.tree.map(jnp.asarray, (x, v, now))
    length, is_truck = (jnp.broadcast_to(jnp.asarray(own), x.shape) for own in (length, is_truck))
    front, rear = x + length / 2, x - length / 2
    return RecordedStimulus(
        position=x,
        speed=v,
        length=length,
        is_truck=is_truck,
        gap=now.leader_rear - front,
        second_gap=now.second_rear - front,
        follower_gap=rear - now.follower_front,
        left_gap=now.left_rear - front,
        next_gap=now.next_rear - front,
        former_gap=now.former_rear - front,
        **{name: getattr(now, name) for name in _AS_MEASURED},
    )


_AS_MEASURED = sorted(RecordedStimulus.__dataclass_fields__.keys() & Surroundings.__dataclass_fields__.keys())
"""Fields of a stimulus that do not depend on the driver's own motion."""


def straightened(surroundings: Surroundings, lens: Lens) -> Surroundings:
    """Surroundings with the camera distortion removed from leaders' positions."""
    # The distortion is a function of the true position, which two fixed-point iterations find.
    place = surroundings.leader_centre - lens.bend(surroundings.leader_centre - lens.bend(surroundings.leader_centre))
    bent = surroundings.has_leader * (surroundings.leader_centre - place)
    slope = surroundings.has_leader * lens.slope(place)
    return replace(
        surroundings, leader_rear=surroundings.leader_rear - bent, leader_speed=surroundings.leader_speed / (1 + slope)
    )


def straightened_start(start: Float[Array, "two pieces"], lens: Lens) -> tuple[Array, Array]:
    """Position and speed in the first time step with the camera distortion removed."""
    x, v = start
    x = x - lens.bend(x - lens.bend(x))
    return x, v / (1 + lens.slope(x))


def synchronised(surroundings: Surroundings, shift: Float[Array, "*n"]) -> Surroundings:
    """Surroundings with leaders where they are by the driver's clock; the leader's clock is ahead by `shift` [s]."""
    leader_shift = surroundings.has_leader * shift
    return replace(
        surroundings,
        leader_rear=surroundings.leader_rear + leader_shift * surroundings.leader_speed,
        leader_speed=surroundings.leader_speed + leader_shift * surroundings.leader_acceleration,
    )


def pieces_of(data: Measured, noise: Noise) -> Pieces:
    """The pieces of measured drives as arrays for the observer, all with one noise."""
    n, gain = len(data.driver), noise.gain(data.dt, data.stride)
    return Pieces(
        y=data.y,
        weight=weights(data, noise),
        is_corrected=np.repeat(data.is_corrected()[:, None], n, axis=1),
        start=np.stack([data.smooth[0], data.smooth_speed[0]]),
        seen=data.halfway(),
        length=data.length,
        is_truck=data.is_truck.astype(float),
        gain=repeated(gain, n),
        deviation=np.full(n, np.sqrt(gain.variance)),
        known=np.zeros((1, n)),
    )


def weights(data: Measured, noise: Noise) -> Float[np.ndarray, "steps pieces"]:
    """Weight of each innovation: effective share of independent information over its relative variance [-]."""
    return data.weight * noise.independent / relative_variance(data, noise)


def relative_variance(data: Measured, noise: Noise) -> Float[np.ndarray, "steps pieces"]:
    """Variance of innovations over that behind a leader of constant speed, far from changes of leader [-]."""
    by_leader = 1 + noise.growth * squared_leader_acceleration(data)
    return by_leader * (1 + noise.near_changes * is_near_change(data))


def is_near_change(data: Measured) -> Bool[np.ndarray, "steps pieces"]:
    """Whether a time step is within BEFORE_CHANGE and AFTER_CHANGE of a change of leader."""
    seen = data.surroundings
    return (seen.time_to_next < BEFORE_CHANGE) | (seen.time_since_change < AFTER_CHANGE)


def far_from_changes(data: Measured, weight: Float[np.ndarray, "steps pieces"]) -> Float[np.ndarray, "steps pieces"]:
    """Weights of the time steps far from changes of leader, 0 near them; all weights if the share of those is small."""
    far = weight * ~is_near_change(data)
    return far if far.sum() >= LEAST_FAR * weight.sum() else weight


def squared_leader_acceleration(data: Measured) -> Float[np.ndarray, "steps pieces"]:
    """Squared acceleration of the leader [m^2/s^4], bounded; the driver's own acceleration would contain its noise."""
    return np.minimum(data.surroundings.leader_acceleration**2, MOST_SQUARED_ACCELERATION)


def repeated(gain: Gain, n: int) -> Gain:
    """One gain repeated for n pieces."""
    return Gain(*(np.full(n, value) for value in gain))
