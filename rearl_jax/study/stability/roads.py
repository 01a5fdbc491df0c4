"""Vehicles on one lane in this package's traffic core: on a ring, and on an open road.

The core's roads are straight. A ring is one on which the vehicles are also seen one lap ahead and one lap behind
themselves, as replayed vehicles; nothing else differs, so drivers keep all their effects. One vehicle is seen behind
the last and two ahead of the first, as many as any effect considers.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.drivers import Drivers
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import TrafficState
from rearl_jax.core.step import step
from rearl_jax.export.drawn import place
from rearl_jax.export.platoon import ROAD, SETBACK, STEPS_PER_SECOND
from rearl_jax.models.population import Population


class Motion(NamedTuple):
    """Vehicles after every second, the foremost first.

    Attributes:
        position: Centres along the road, laps added up [m].
        speed: [m/s].
        length: Lengths of the vehicles [m].
        overlaps: How often each vehicle has come to overlap its leader.
    """

    position: Float[np.ndarray, "seconds vehicles scenarios"]
    speed: Float[np.ndarray, "seconds vehicles scenarios"]
    length: Float[np.ndarray, "vehicles scenarios"]
    overlaps: Int[np.ndarray, "vehicles scenarios"]


def drive(
    population: Population,
    position: Float[np.ndarray, "vehicles scenarios"],
    speed: Float[np.ndarray, "vehicles scenarios"],
    *,
    seconds: int,
    seed: int,
    circumference: Float[np.ndarray, " scenarios"] | None = None,
) -> Motion:
    """Drivers of a population on one lane.

    Args:
        population: The population.
        position: Positions at the start [m], the foremost vehicle first.
        speed: Speeds at the start [m/s].
        seconds: Simulated time [s].
        seed: Seed of the drivers.
        circumference: Length of each ring [m]; None for an open road.
    """
    state, drivers = place(population, speed, ROAD, seed)
    dtype = state.x.dtype
    back = SETBACK - position.min()  # no vehicle is before the beginning of the core's road
    state = replace(state, x=jnp.asarray(position + back, dtype))
    length = jnp.broadcast_to(drivers.body.length, state.x.shape)
    around = None if circumference is None else jnp.asarray(circumference, dtype)
    x, v, overlaps = _drive(state, drivers, length, around, seconds)
    return Motion(np.asarray(x) - back, np.asarray(v), np.asarray(length), np.asarray(overlaps))


@partial(jax.jit, static_argnames="seconds")
def _drive(
    state: TrafficState,
    drivers: Drivers,
    length: Float[Array, "vehicles scenarios"],
    circumference: Float[Array, " scenarios"] | None,
    seconds: int,
) -> tuple[
    Float[Array, "seconds vehicles scenarios"],
    Float[Array, "seconds vehicles scenarios"],
    Int[Array, "vehicles scenarios"],
]:
    def around(state: TrafficState) -> ReplayedVehicles | None:
        return None if circumference is None else one_lap_away(state, drivers, length, circumference)

    def tick(_: Array, now: tuple[TrafficState, Array, Array]) -> tuple[TrafficState, Array, Array]:
        before, was_inside, overlaps = now
        after = step(before, drivers, ROAD, around(before))
        is_inside = gaps(after.x, length, circumference) < 0
        return after, is_inside, overlaps + (is_inside & ~was_inside).astype(jnp.int32)

    def second(now: tuple, _: None) -> tuple[tuple, tuple[Array, Array]]:
        now = lax.fori_loop(0, STEPS_PER_SECOND, tick, now)
        return now, (now[0].x, now[0].speed)

    begun = begin_driving(state, drivers, ROAD, around(state))
    start = begun, gaps(begun.x, length, circumference) < 0, jnp.zeros(state.x.shape, jnp.int32)
    (_, _, overlaps), (x, v) = lax.scan(second, start, length=seconds)
    return x, v, overlaps


def gaps(
    x: Float[Array, "vehicles scenarios"],
    length: Float[Array, "vehicles scenarios"],
    circumference: Float[Array, " scenarios"] | None,
) -> Float[Array, "vehicles scenarios"]:
    """Gaps between bumpers [m]; inf ahead of the first vehicle on an open road."""
    lap = jnp.inf if circumference is None else circumference
    ahead = jnp.roll(x, 1, axis=0).at[0].add(lap)
    return ahead - x - (jnp.roll(length, 1, axis=0) + length) / 2


def one_lap_away(
    state: TrafficState,
    drivers: Drivers,
    length: Float[Array, "vehicles scenarios"],
    circumference: Float[Array, " scenarios"],
) -> ReplayedVehicles:
    """The last vehicles of each ring one lap ahead, and the first one lap behind."""
    n_vehicles = state.x.shape[0]
    index = np.array([n_vehicles - 1, n_vehicles - 2, 0])
    laps = np.array([1.0, 1.0, -1.0])[:, None]
    shape = (len(index), *state.x.shape[1:])
    is_truck = drivers.body.is_truck
    trucks = jnp.zeros(shape) if is_truck is None else jnp.broadcast_to(is_truck, state.x.shape)[index]
    return ReplayedVehicles(
        x=state.x[index] + laps * circumference[None],
        speed=state.speed[index],
        acceleration=state.acceleration[index],
        lane=jnp.zeros(shape, jnp.int32),
        length=length[index],
        is_truck=trucks.astype(state.x.dtype),
        number=jnp.broadcast_to(jnp.asarray(n_vehicles + index, jnp.int32)[:, None], shape),
    )
