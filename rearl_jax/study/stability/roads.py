"""Vehicles on one lane in this package's traffic core: on a ring, and on an open road.

The core's roads are straight. On a ring, copies of its vehicles one lap ahead and one lap behind are added as replayed
vehicles; nothing else differs, so drivers keep all their effects. One copy drives behind the last vehicle and two ahead
of the first, as many as any effect considers.
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
from rearl_jax.export.drawn import place_vehicles
from rearl_jax.export.platoon import LAST_START, ROAD, STEPS_PER_SECOND
from rearl_jax.models.population import Population


class Motion(NamedTuple):
    """Vehicles after every second, the foremost first.

    Attributes:
        position: Centres along the road, laps added up [m].
        speed: [m/s].
        overlaps: How often each vehicle has come to overlap its leader.
    """

    position: Float[np.ndarray, "seconds vehicles scenarios"]
    speed: Float[np.ndarray, "seconds vehicles scenarios"]
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
    """Motion of drivers of a population on one lane.

    Args:
        population: The population.
        position: Positions at the start [m], the foremost vehicle first.
        speed: Speeds at the start [m/s].
        seconds: Simulated time [s].
        seed: Seed of the drivers.
        circumference: Length of each ring [m]; None for an open road.
    """
    state, drivers = place_vehicles(population, speed, ROAD, seed)
    dtype = state.x.dtype
    shift = LAST_START - position.min()  # no vehicle may start before the beginning of the core's road
    state = replace(state, x=jnp.asarray(position + shift, dtype))
    length = jnp.broadcast_to(drivers.body.length, state.x.shape)
    lap = None if circumference is None else jnp.asarray(circumference, dtype)
    x, v, overlaps = _drive(state, drivers, length, lap, seconds)
    return Motion(np.asarray(x) - shift, np.asarray(v), np.asarray(overlaps))


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
    def copies(state: TrafficState) -> ReplayedVehicles | None:
        return None if circumference is None else one_lap_away(state, drivers, length, circumference)

    def one_step(_: Array, carry: tuple[TrafficState, Array, Array]) -> tuple[TrafficState, Array, Array]:
        before, was_overlap, overlaps = carry
        after = step(before, drivers, ROAD, copies(before))
        is_overlap = gaps(after.x, length, circumference) < 0
        return after, is_overlap, overlaps + (is_overlap & ~was_overlap).astype(jnp.int32)

    def one_second(carry: tuple, _: None) -> tuple[tuple, tuple[Array, Array]]:
        carry = lax.fori_loop(0, STEPS_PER_SECOND, one_step, carry)
        return carry, (carry[0].x, carry[0].speed)

    begun = begin_driving(state, drivers, ROAD, copies(state))
    start = begun, gaps(begun.x, length, circumference) < 0, jnp.zeros(state.x.shape, jnp.int32)
    (_, _, overlaps), (x, v) = lax.scan(one_second, start, length=seconds)
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
    """Copies of the last two vehicles of each ring one lap ahead, and of the first vehicle one lap behind."""
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
