"""Random initial traffic as in highway-env: vehicles are placed one by one, each ahead of all placed before."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from rearl_jax.core.drivers import Drivers, highway_env_drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import Controller, TrafficState
from rearl_jax.core.timer import decision_period

SPEED_RANGE = (0.7, 0.8)
"""Range of initial speeds as shares of the speed limit. Source: highway-env 1.12.1, `Vehicle.create_random`."""

FALLBACK_SPEEDS = (23.0, 25.0)
"""Range of initial speeds [m/s] on a road without limit. Source: highway-env 1.12.1,
`Vehicle.DEFAULT_INITIAL_SPEEDS`.
"""

EXPONENT_RANGE = (3.5, 4.5)
"""Range of the IDM exponent. Source: highway-env 1.12.1, `IDMVehicle.randomize_behavior`."""

_MIN_DRAWN = 16
"""Least number of vehicles that random numbers are drawn for; the numbers of the first vehicles do not depend on it.
XLA would unroll the loops of smaller draws, which takes five times as long to compile.
"""


def spawn(
    keys: Key[Array, " scenarios"],
    model: TrafficModel,
    *,
    n_vehicles: int,
    density: float = 2.0,
    initial_speed: float | None = None,
    dtype: jnp.dtype = jnp.float32,
) -> tuple[TrafficState, Drivers]:
    """IDM traffic of one scenario per key, and its drivers. The same key gives the same scenario in every batch.

    Each vehicle draws a lane, a speed v and its distance ahead of the vehicle placed before, 0.9 to 1.1 times
    (12 + v) exp(-5 K / 40) / density, with K the number of lanes. So the list order is the order along the road.

    Args:
        keys: One random key per scenario.
        model: Traffic model; only its road is used.
        n_vehicles: Vehicles per scenario.
        density: highway-env's `vehicles_density` [-].
        initial_speed: Speed of all vehicles [m/s]; None draws 70 to 80 % of the speed limit for each.
        dtype: Floating type of the state.

    Source: highway-env 1.12.1, `Vehicle.create_random`; `IDMVehicle.__init__` (phase of the lane-change decisions).
    """
    if model.speed_limit is None:
        low, high = FALLBACK_SPEEDS
    else:
        low, high = (share * model.speed_limit for share in SPEED_RANGE)

    shape = (max(n_vehicles, _MIN_DRAWN),)

    def draw(key: Key[Array, ""]) -> tuple[Array, Array, Array, Array]:
        lane_key, speed_key, jitter_key, exponent_key = jax.random.split(key, 4)
        lane = jax.random.randint(lane_key, shape, 0, model.n_lanes)
        speed = jax.random.uniform(speed_key, shape, dtype, low, high)
        jitter = jax.random.uniform(jitter_key, shape, dtype, 0.9, 1.1)
        return lane, speed, jitter, jax.random.uniform(exponent_key, shape, dtype, *EXPONENT_RANGE)

    lane, speed, jitter, exponent = (values[:n_vehicles] for values in jax.vmap(draw, out_axes=-1)(keys))
    if initial_speed is not None:
        speed = jnp.full_like(speed, initial_speed)
    offset = (12 + speed) * float(np.exp(-5 / 40 * model.n_lanes) / density)
    # Three times the first offset as a sum, because a product would be fused with the following sum for some batch
    # sizes only, with different rounding.
    x = jnp.cumsum(offset * jitter, axis=0) + (offset[:1] + offset[:1] + offset[:1])
    y = lane.astype(dtype) * model.lane_width
    zeros, no_vehicle = jnp.zeros_like(x), jnp.zeros(x.shape, bool)
    state = TrafficState(
        x=x,
        y=y,
        x_lost=zeros,
        y_lost=zeros,
        heading=zeros,
        speed=speed,
        acceleration=zeros,
        desired_speed=speed,
        target_lane=lane.astype(jnp.int32),
        ticks_to_decision=ticks_to_first_decision(
            x, y, 1.0, decision_period(1.0, model.ticks_per_second), model.ticks_per_second
        ),
        controller=jnp.full(x.shape, int(Controller.IDM), jnp.int32),
        crashed=no_vehicle,
        is_pushed=no_vehicle,
        push_x=zeros,
        push_y=zeros,
        order=jax.lax.broadcasted_iota(jnp.int32, x.shape, 0),
    )
    return state, highway_env_drivers(exponent, ticks_per_second=model.ticks_per_second)


def ticks_to_first_decision(
    x: Float[Array, "*n"],
    y: Float[Array, "*n"],
    delay: Float[Array, "*n"] | float,
    period: Int[Array, "*n"] | int,
    ticks_per_second: int,
) -> Int[Array, "*n"]:
    """Ticks until newly placed vehicles take their first lane-change decision.

    Args:
        x: Positions along the road [m].
        y: Lateral positions [m].
        delay: Time between two decisions [s].
        period: Time between two decisions in ticks, from `decision_period`.
        ticks_per_second: Clock of the simulation [1/s].

    Source: highway-env 1.12.1, `IDMVehicle.__init__`: the timer starts at ((x + y) pi) mod delay.
    """
    phase = ((x + y) * np.pi) % delay
    ticks = jnp.floor((delay - phase) * ticks_per_second).astype(jnp.int32) + 1
    return jnp.clip(ticks, 1, period)
