"""Platoons behind measured first vehicles, simulated by this package's traffic core."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from rearl_jax.core.drivers import Drivers
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import TrafficState
from rearl_jax.core.step import step
from rearl_jax.export.drawn import place_vehicles
from rearl_jax.models.population import Population

STEPS_PER_SECOND = 10
"""Steps of both simulations [1/s]: SUMO's are whole milliseconds, which highway-env's 15 per second are not."""

ROAD = TrafficModel(
    n_lanes=1,
    road_length=1e6,  # no vehicle reaches its end within hours
    speed_limit=None,
    ticks_per_second=STEPS_PER_SECOND,
    lane_changes=False,
    collisions=False,
)
"""One lane on which platoons drive."""


@dataclass(frozen=True)
class Motion:
    """Platoons over time, the first vehicle first.

    Attributes:
        position: Centres along the road [m].
        speed: [m/s].
        length: Lengths of the vehicles [m].
    """

    position: Float[np.ndarray, "steps vehicles platoons"]
    speed: Float[np.ndarray, "steps vehicles platoons"]
    length: Float[np.ndarray, "vehicles platoons"]

    @property
    def gap(self) -> Float[np.ndarray, "steps followers platoons"]:
        """Gaps of the followers, bumper to bumper [m]."""
        between = self.position[:, :-1] - self.position[:, 1:]
        return between - (self.length[:-1] + self.length[1:]) / 2


@dataclass(frozen=True)
class Start:
    """Platoons at the start, with their drivers."""

    state: TrafficState
    drivers: Drivers

    @property
    def length(self) -> Float[np.ndarray, "vehicles platoons"]:
        """Lengths of the vehicles [m]."""
        return np.broadcast_to(np.asarray(self.drivers.body.length), self.state.x.shape)


def start_platoons(
    population: Population, leader_speed: Float[np.ndarray, "steps platoons"], n_followers: int, seed: int
) -> Start:
    """Followers drawn from a population, `n_followers` behind each first vehicle, at its first speed [m/s] and their
    desired gap at that speed.
    """
    speed = np.repeat(leader_speed[:1], n_followers + 1, axis=0)
    state, drivers = place_vehicles(population, speed, ROAD, seed)
    length = np.broadcast_to(np.asarray(drivers.body.length), speed.shape)
    gap = np.asarray(drivers.car_following.desired_gap(state.speed, jnp.zeros_like(state.speed)))
    behind = np.cumsum(gap[1:] + (length[:-1] + length[1:]) / 2, axis=0)
    length_of_platoon = behind[-1]
    x = np.concatenate([length_of_platoon[None], length_of_platoon - behind]) + LAST_START
    return Start(replace(state, x=jnp.asarray(x, state.x.dtype)), drivers)


LAST_START = 100.0
"""Position of the last vehicle of each platoon at the start [m]."""


def simulate(start: Start, leader_speed: Float[np.ndarray, "steps platoons"]) -> Motion:
    """The platoons behind first vehicles that move by their measured speeds.

    Args:
        start: The platoons at the start.
        leader_speed: Speeds of the first vehicles [m/s], the first at the start.
    """
    dtype = start.state.x.dtype
    first = np.asarray(start.state.x)[0]
    position = jnp.asarray(leader_positions(first, leader_speed), dtype)
    x, speed = _simulate(start.state, start.drivers, position, jnp.asarray(leader_speed, dtype))
    return Motion(np.asarray(x), np.asarray(speed), start.length)


def leader_positions(
    first: Float[np.ndarray, " platoons"], speed: Float[np.ndarray, "steps platoons"]
) -> Float[np.ndarray, "steps platoons"]:
    """Positions of the first vehicles [m], by the trapezoidal rule from their speeds [m/s]."""
    moved = np.cumsum((speed[:-1] + speed[1:]) / (2 * STEPS_PER_SECOND), axis=0)
    return first + np.concatenate([np.zeros_like(speed[:1]), moved])


@jax.jit
def _simulate(
    state: TrafficState,
    drivers: Drivers,
    position: Float[Array, "steps platoons"],
    speed: Float[Array, "steps platoons"],
) -> tuple[Float[Array, "steps vehicles platoons"], Float[Array, "steps vehicles platoons"]]:
    """Positions [m] and speeds [m/s] of platoons whose first vehicles have the given ones."""

    def lead(state: TrafficState, x: Array, speed: Array, acceleration: Array) -> TrafficState:
        """The state with the first vehicles where they were measured."""
        return replace(
            state,
            x=state.x.at[0].set(x),
            speed=state.speed.at[0].set(speed),
            acceleration=state.acceleration.at[0].set(acceleration),
        )

    def one_step(before: TrafficState, leader: tuple[Array, ...]) -> tuple[TrafficState, tuple[Array, Array]]:
        after = lead(step(before, drivers, ROAD), *leader)
        return after, (after.x, after.speed)

    begun = begin_driving(lead(state, position[0], speed[0], jnp.zeros_like(speed[0])), drivers, ROAD)
    acceleration = jnp.diff(speed, axis=0) * STEPS_PER_SECOND
    _, (x, v) = lax.scan(one_step, begun, (position[1:], speed[1:], acceleration))
    return jnp.concatenate([begun.x[None], x]), jnp.concatenate([begun.speed[None], v])
