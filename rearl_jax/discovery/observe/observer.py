"""The observer: a driver model that is held to the measured positions, and what it fails to predict.

State of a driver: position x, speed v, o, what the driver does beside the model (an Ornstein-Uhlenbeck process), and w,
the error of measured positions where it lasts from one moment to the next. Each step predicts with the model and
corrects by a gain times the innovation, measured minus predicted position.

    gain 0: the closed-loop simulation, whose errors are those readers expect;
    steady-state Kalman gain: innovations of a right model are white, so tests on them are calibrated.

Source: prediction-error method, Ljung, System Identification (1999), chapter 7; Kalman, J. Basic Eng. 82 (1960) 35.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.following import begin_effects, follow
from rearl_jax.discovery.observe.lens import Lens
from rearl_jax.discovery.read.measured import Measured, Surroundings

GAIN_ITERATIONS = 600

MEASURED = np.array([1.0, 0.0, 0.0, 1.0])
"""What is measured of x, v, o, w."""

PULL, DAMPING = 0.075, 0.5
"""How a driver's acceleration answers to being ahead of its place [1/s^2] and too fast [1/s], as the observer takes it:
IDM at 20 m/s, 30 m behind, with usual parameters. Without it, what drivers take back would count as less noise.
"""

ANEW = 0.01
"""Share of the variance of lasting errors that is measured anew in every moment [-]: none at all cannot be inverted."""


@dataclass(frozen=True)
class Noise:
    """What the observer takes for random.

    Attributes:
        acceleration: Standard deviation of what drivers do beside the model [m/s^2].
        time: Its correlation time [s].
        position: Standard deviation of measured positions [m].
        position_time: Correlation time of their errors [s]; 0 where every moment is measured anew.
    """

    acceleration: float
    time: float
    position: float
    position_time: float = 0.0

    def gain(self, dt: float, stride: int = 1) -> Float[np.ndarray, "7"]:
        """Steady-state Kalman gain of x [-], v [1/s], o [1/s^2]; what is left of o after a step [-]; innovation
        variance [m^2]; gain of w [-]; what is left of w after a step [-].

        Args:
            dt: Time of a step [s].
            stride: Steps from one correction to the next.
        """
        return steady_state(self, dt, stride).gain


class SteadyState(NamedTuple):
    """The observer after a long time.

    Attributes:
        gain: As of `Noise.gain`.
        step: From x, v, o, w to those one step later.
        corrected: The same for the error of the prediction where it is corrected first.
        covariance: Of x, v, o, w before each step of a period; the first is corrected.
    """

    gain: Float[np.ndarray, "7"]
    step: Float[np.ndarray, "4 4"]
    corrected: Float[np.ndarray, "4 4"]
    covariance: list[Float[np.ndarray, "4 4"]]


@cache
def steady_state(noise: Noise, dt: float, stride: int) -> SteadyState:
    """The observer's steady state; arguments as of `Noise.gain`."""
    kept, lasting = np.exp(-dt / noise.time), np.exp(-dt / noise.position_time) if noise.position_time else 0.0
    step = np.diag([1.0, 1.0 - DAMPING * dt, kept, lasting])
    step[0, 1:3], step[1, 0], step[1, 2] = (dt, dt * dt / 2), -PULL * dt, dt
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
    found = np.array([*gain[:3], kept, expected, gain[3], lasting])
    found.flags.writeable = False  # one array for all who ask
    corrected = step - step @ np.outer(gain, MEASURED)
    return SteadyState(found, step, corrected, [covariance[-1], *covariance[:-1]])


CLOSED_LOOP = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
"""The gain that never corrects: a simulation behind the measured leader."""


class Pieces(eqx.Module):
    """What the observer runs through, the pieces last.

    Attributes:
        y: Measured position [m].
        weight: 1 where the moment counts.
        looks: 1 where the observer corrects its prediction.
        start: Position [m] and speed [m/s] at the first moment.
        seen: What is around, in the middle between each moment and the next.
        length: Own length [m].
        is_truck: 1 for trucks.
        gain: As of `Noise.gain`.
        deviation: Standard deviation of innovations [m], beyond some multiples of which a moment is an outlier.
        known: Acceleration beside the model that is given [m/s^2]; one row of zeros for none.
    """

    y: Float[Any, "steps pieces"]
    weight: Float[Any, "steps pieces"]
    looks: Float[Any, "steps pieces"]
    start: Float[Any, "two pieces"]
    seen: Surroundings
    length: Float[Any, " pieces"]
    is_truck: Float[Any, " pieces"]
    gain: Float[Any, "seven pieces"]
    deviation: Float[Any, " pieces"]
    known: Float[Any, "#steps pieces"]


def innovations(
    pieces: Pieces,
    driver: CarFollowing,
    effects: tuple[Effect, ...],
    lens: Lens | None,
    dt: float,
) -> Float[Array, "steps pieces"]:
    """Measured minus predicted position in every moment [m]; in the first, minus the smoothed one it starts from.

    Args:
        pieces: What was measured.
        driver: Car following of the drivers.
        effects: What acts on them beyond it.
        lens: Distortion of positions by the camera; None for none.
        dt: Time between moments [s].
    """
    pieces = jax.tree.map(jnp.asarray, pieces)
    length, gain = pieces.length, pieces.gain

    def seen(x: Array, v: Array, now: Surroundings) -> Stimulus:
        return stimulus(x, v, length, pieces.is_truck, now if lens is None else straightened(now, lens))

    def step(carry: tuple, now: tuple[Array, Array, Surroundings, Array]) -> tuple[tuple, Array]:
        (x, v, o, w, last, memory), (y, looks, halfway, extra) = carry, now
        surprise = y - w - (x if lens is None else x + lens.bend(x))
        known = looks * surprise
        x, v, o, w = x + gain[0] * known, v + gain[1] * known, o + gain[2] * known, w + gain[5] * known
        # The model is asked for the middle of the step, so that a step does not count as a reaction time.
        halfway_x, halfway_v = x + v * (dt / 2) + last * (dt * dt / 8), jnp.maximum(v + last * (dt / 2), 0.0)
        wanted, memory = follow(seen(halfway_x, halfway_v, halfway), driver, effects, memory, last, dt)
        acceleration = wanted + o + extra
        faster = jnp.maximum(v + acceleration * dt, 0.0)
        return (x + dt * (v + faster) / 2, faster, gain[3] * o, gain[6] * w, acceleration, memory), surprise

    x, v = pieces.start if lens is None else straightened_start(pieces.start, lens)
    nothing = jnp.zeros_like(x)
    memory = begin_effects(effects, seen(x, v, jax.tree.map(lambda values: values[0], pieces.seen)), driver, dt)
    extra = jnp.broadcast_to(pieces.known, pieces.y.shape)
    begin = (x, v, nothing, nothing, nothing, memory)
    return lax.scan(step, begin, (pieces.y, pieces.looks, pieces.seen, extra))[1]


def stimulus(
    x: Float[Any, "*n"],
    v: Float[Any, "*n"],
    length: Float[Any, " pieces"],
    is_truck: Float[Any, " pieces"],
    now: Surroundings,
) -> Stimulus:
    """What drivers at x [m] with speed v [m/s] see of what was measured."""
    x, v, now = jax.tree.map(jnp.asarray, (x, v, now))
    length, is_truck = (jnp.broadcast_to(jnp.asarray(own), x.shape) for own in (length, is_truck))
    front, rear = x + length / 2, x - length / 2
    return Stimulus(
        time=now.time,
        position=x,
        lane=now.lane,
        is_leftmost=now.is_leftmost,
        is_rightmost=now.is_rightmost,
        lateral_offset=now.lateral_offset,
        speed=v,
        length=length,
        is_truck=is_truck,
        has_leader=now.has_leader,
        gap=now.leader_rear - front,
        leader_speed=now.leader_speed,
        leader_acceleration=now.leader_acceleration,
        leader_length=now.leader_length,
        leader_is_truck=now.leader_is_truck,
        has_second=now.has_second,
        second_gap=now.second_rear - front,
        second_speed=now.second_speed,
        has_third=now.has_third,
        third_speed=now.third_speed,
        has_follower=now.has_follower,
        follower_gap=rear - now.follower_front,
        follower_speed=now.follower_speed,
        has_left=now.has_left,
        left_gap=now.left_rear - front,
        left_speed=now.left_speed,
        beside_speed=now.beside_speed,
        n_beside=now.n_beside,
        time_since_change=now.time_since_change,
        gap_lost=now.gap_lost,
        time_gap_at_change=now.time_gap_at_change,
    )


def straightened(around: Surroundings, lens: Lens) -> Surroundings:
    """Leaders where they were before the camera bent the picture."""
    # The distortion belongs to the true place, which is found by going back twice.
    place = around.leader_centre - lens.bend(around.leader_centre - lens.bend(around.leader_centre))
    bent = around.has_leader * (around.leader_centre - place)
    slope = around.has_leader * lens.slope(place)
    return replace(around, leader_rear=around.leader_rear - bent, leader_speed=around.leader_speed / (1 + slope))


def straightened_start(start: Float[Array, "two pieces"], lens: Lens) -> tuple[Array, Array]:
    """Position and speed at the first moment before the camera bent the picture."""
    x, v = start
    x = x - lens.bend(x - lens.bend(x))
    return x, v / (1 + lens.slope(x))


def synchronised(around: Surroundings, shift: Float[Array, "*n"]) -> Surroundings:
    """Leaders at the own time, where their clock is ahead by `shift` [s]."""
    ahead = around.has_leader * shift
    return replace(
        around,
        leader_rear=around.leader_rear + ahead * around.leader_speed,
        leader_speed=around.leader_speed + ahead * around.leader_acceleration,
    )


def pieces_of(data: Measured, gain: Float[np.ndarray, "7"]) -> Pieces:
    """The pieces of measured drives as the observer takes them, all with one gain."""
    n = len(data.driver)
    return Pieces(
        y=data.y,
        weight=data.weight,
        looks=np.repeat(data.looks()[:, None], n, axis=1),
        start=np.stack([data.smooth[0], data.smooth_speed[0]]),
        seen=data.halfway(),
        length=data.length,
        is_truck=data.is_truck.astype(float),
        gain=np.repeat(np.asarray(gain)[:, None], n, axis=1),
        deviation=np.full(n, np.sqrt(gain[4])),
        known=np.zeros((1, n)),
    )
