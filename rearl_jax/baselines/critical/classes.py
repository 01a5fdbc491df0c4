"""Driver classes: shares in; speeds, IDM and MOBIL parameters of every vehicle out.

Lanes, places, acceleration exponents and the phase of the lane-change decisions are those of the method base, drawn
from the same key. What a vehicle's class and speed are drawn with does not depend on the shares either, so that two
mixtures differ in nothing but the mixture (common random numbers).
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
"""Separates the random numbers of classes and their speeds from those of the initial state."""


@dataclass(frozen=True)
class DriverClass:
    """Drivers of one kind; what is not named here is highway-env's.

    Attributes:
        max_accel: IDM acceleration a [m/s^2].
        jam_spacing: IDM spacing at rest s0, centre to centre as highway-env's DISTANCE_WANTED [m].
        gain_threshold: MOBIL gain in acceleration that justifies a change [m/s^2].
        delay: Time between two lane-change decisions, highway-env's LANE_CHANGE_DELAY [s].
        politeness: MOBIL weight p of the followers' change of acceleration [-].
        mean_speed: Mean of the speeds [m/s].
        speed_sd: Their standard deviation [m/s].
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
"""In the order of `Mixture`, the rest last.

Source: CRITICAL, highway_env/vehicle/behavior.py. It overwrites DISTANCE_WANTED, which in highway-env holds one vehicle
length, with values that do not: taken as they act there. Trucks keep highway-env 1.12.1's constants (IDMVehicle) and
their own speeds; they are as long as cars here (5 m, in CRITICAL 10 m), as all vehicles of Base.
"""


def populate(
    state: TrafficState,
    drivers: Drivers,
    keys: Key[Array, " scenarios"],
    shares: Float[Array, "classes scenarios"],
    model: TrafficModel,
) -> tuple[TrafficState, Drivers]:
    """The same vehicles at the same places, driven by drivers of several classes at their own speeds.

    Initial speeds are drawn and cut to the range of `model.speed_levels`; they are the desired speeds too, which the
    road's limit caps. The model must be cooperative, or politeness has no effect.

    Args:
        state: Drawn initial state.
        drivers: Its drivers.
        keys: Random keys the state was drawn from.
        shares: Of aggressive and defensive drivers and of trucks [-].
        model: The road.
    """
    n_vehicles, dtype = state.x.shape[0], state.x.dtype

    def draw(key: Key[Array, ""]) -> tuple[Array, Array]:
        class_key, speed_key = jax.random.split(jax.random.fold_in(key, CLASS_STREAM))
        return jax.random.uniform(class_key, (n_vehicles,), dtype), jax.random.normal(speed_key, (n_vehicles,), dtype)

    place, deviation = jax.vmap(draw, out_axes=-1)(keys)
    number = class_numbers(place, shares)

    def own(name: str) -> Float[Array, "vehicles scenarios"]:
        return jnp.asarray([getattr(kind, name) for kind in CLASSES.values()], dtype)[number]

    periods = [decision_period(kind.delay, model.ticks_per_second) for kind in CLASSES.values()]
    period = jnp.asarray(periods, jnp.int32)[number]
    speed = own("mean_speed") + own("speed_sd") * deviation
    speed = jnp.clip(speed, model.speed_levels[0], model.speed_levels[-1])
    ticks = ticks_to_first_decision(state.x, state.y, own("delay"), period, model.ticks_per_second)
    state = replace(state, speed=speed, desired_speed=speed, ticks_to_decision=ticks)
    jam_gap = own("jam_spacing") - VEHICLE_LENGTH
    car_following = replace(drivers.car_following, max_accel=own("max_accel"), jam_gap=jam_gap)
    mobil = replace(
        drivers.mobil,
        politeness=own("politeness"),
        gain_threshold=own("gain_threshold"),
        decision_period=period,
    )
    return state, replace(drivers, car_following=car_following, mobil=mobil)


def class_numbers(
    place: Float[Array, "vehicles scenarios"], shares: Float[Array, "classes scenarios"]
) -> Int[Array, "vehicles scenarios"]:
    """Class of each vehicle, in the order of `CLASSES`.

    Args:
        place: Drawn from U(0, 1).
        shares: Of all classes but the last [-].
    """
    upper = jnp.cumsum(shares, axis=0)
    return jnp.sum(place[None] >= upper[:, None], axis=0, dtype=jnp.int32)
