"""Speed, IDM and MOBIL parameters of every vehicle, drawn by the shares of the driver classes.

Lanes, positions, acceleration exponents and the phase of the lane-change decisions are those of `method=base`, drawn
from the same key. The random numbers behind class and speed do not depend on the shares, so that two mixtures differ in
the shares alone (common random numbers).
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Key

from rearl_jax.core.car_following.highway_env_idm import VEHICLE_LENGTH
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import ticks_to_first_decision
from rearl_jax.core.state import TrafficState
from rearl_jax.core.timer import decision_period

CLASS_STREAM = 2
"""Number of the random stream of classes and speeds, separate from that of the initial state."""


@dataclass(frozen=True)
class DriverClass:
    """Drivers of one class; all other parameters have highway-env's values.

    Attributes:
        max_accel: IDM acceleration a [m/s^2].
        jam_spacing: IDM spacing at rest, centre to centre like highway-env's DISTANCE_WANTED [m].
        gain_threshold: MOBIL gain in acceleration that justifies a change [m/s^2].
        delay: Time between two lane-change decisions, highway-env's LANE_CHANGE_DELAY [s].
        politeness: MOBIL weight p of the followers' change of acceleration [-].
        mean_speed: Mean of the speeds [m/s].
        speed_sd: Standard deviation of the speeds [m/s].
    """

    max_accel: float
    jam_spacing: float
    gain_threshold: float
    delay: float
    politeness: float
    mean_speed: float
    speed_sd: float


CLASSES = {
    "aggressive": DriverClass(4.5, 2.0, 0.3, 0.3, 0.05, 33.5, 4.6),
    "defensive": DriverClass(2.0, 7.0, 0.5, 3.0, 0.9, 23.7, 3.8),
    "truck": DriverClass(3.0, 10.0, 0.2, 1.0, 0.0, 23.9, 2.8),
    "regular": DriverClass(3.2, 5.0, 0.2, 1.0, 0.3, 33.3, 3.2),
}
"""Classes in the order of `Mixture`; the last one takes the remaining share.

Source: CRITICAL, highway_env/vehicle/behavior.py. In highway-env DISTANCE_WANTED includes one vehicle length, unlike
CRITICAL's values. They are used unchanged as centre-to-centre distances, as the code of highway-env treats them. Trucks
have highway-env 1.12.1's constants (IDMVehicle) and CRITICAL's speeds. All vehicles are 5 m long as with `method=base`;
CRITICAL's trucks are 10 m long.
"""


def populate(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    shares: Float[Array, "classes scenarios"],
    model: TrafficModel,
) -> tuple[TrafficState, Drivers]:
    """State and drivers of the same vehicles at the same positions, with classes and speeds drawn.

    Initial speeds are clipped to the range of `model.speed_levels`. They are also the desired speeds, which the speed
    limit caps. Politeness only has an effect with `model.cooperative`.

    Args:
        state: Drawn initial state.
        drivers: Drivers of the traffic.
        keys: Random keys the state was drawn from.
        shares: Shares of aggressive drivers, defensive drivers and trucks [-]; regular drivers get the remainder.
        model: Traffic model; only its road is used.
    """
    n_vehicles, dtype = state.x.shape[0], state.x.dtype

    def draw(key: Key[Array, ""]) -> tuple[Array, Array]:
        class_key, speed_key = jax.random.split(jax.random.fold_in(key, CLASS_STREAM))
        return jax.random.uniform(class_key, (n_vehicles,), dtype), jax.random.normal(speed_key, (n_vehicles,), dtype)

    uniform, deviation = jax.vmap(draw, out_axes=-1)(keys)
    class_index = class_indices(uniform, shares)

    def per_vehicle(name: str) -> Float[Array, "vehicles scenarios"]:
        return jnp.asarray([getattr(kind, name) for kind in CLASSES.values()], dtype)[class_index]

    periods = [decision_period(kind.delay, model.ticks_per_second) for kind in CLASSES.values()]
    period = jnp.asarray(periods, jnp.int32)[class_index]
    speed = per_vehicle("mean_speed") + per_vehicle("speed_sd") * deviation
    speed = jnp.clip(speed, model.speed_levels[0], model.speed_levels[-1])
    ticks = ticks_to_first_decision(state.x, state.y, per_vehicle("delay"), period, model.ticks_per_second)
    state = replace(state, speed=speed, desired_speed=speed, ticks_to_decision=ticks)
    jam_gap = per_vehicle("jam_spacing") - VEHICLE_LENGTH
    car_following = replace(drivers.car_following, max_accel=per_vehicle("max_accel"), jam_gap=jam_gap)
    mobil = replace(
        drivers.mobil,
        politeness=per_vehicle("politeness"),
        gain_threshold=per_vehicle("gain_threshold"),
        decision_period=period,
    )
    return state, replace(drivers, car_following=car_following, mobil=mobil)


def class_indices(
    uniform: Float[Array, "vehicles scenarios"], shares: Float[Array, "classes scenarios"]
) -> Int[Array, "vehicles scenarios"]:
    """Class of each vehicle, in the order of `CLASSES`.

    Args:
        uniform: Random numbers from U(0, 1).
        shares: Shares of all classes but the last [-].
    """
    upper = jnp.cumsum(shares, axis=0)
    return jnp.sum(uniform[None] >= upper[:, None], axis=0, dtype=jnp.int32)
