"""Parameters of each vehicle: car following, lane changing, and vehicle size.

Every leaf has the rank of the state's arrays, `[vehicles, *scenarios]`; an axis of length 1 means that all elements
share the value, at no cost. Defaults are those of highway-env's `IDMVehicle`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.highway_env_idm import HighwayEnvIDM
from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.timer import decision_period


class MOBILParams(eqx.Module):
    """Parameters of the lane-change model MOBIL in highway-env's form.

    Attributes:
        politeness: Weight p of the followers' change of acceleration [-].
        gain_threshold: Least gain in acceleration that justifies a change [m/s^2].
        safe_decel: Largest deceleration a change may impose on the new follower, positive [m/s^2].
        decision_period: Time from one lane-change decision to the next [ticks].
        changes_lanes: Whether the vehicle changes lanes at all.
    """

    politeness: Float[Array, "#vehicles *#scenarios"]
    gain_threshold: Float[Array, "#vehicles *#scenarios"]
    safe_decel: Float[Array, "#vehicles *#scenarios"]
    decision_period: Int[Array, "#vehicles *#scenarios"]
    changes_lanes: Bool[Array, "#vehicles *#scenarios"]


class Body(eqx.Module):
    """Size, class and limits of a vehicle, whatever its driver.

    Attributes:
        length: Length [m].
        width: Width [m].
        accel_limit: Bound of the executed acceleration and deceleration [m/s^2].
        collides: Whether the vehicle checks for collisions; a pair is tested if either vehicle does.
        is_truck: Whether the vehicle is a truck; None if all are cars.
    """

    length: Float[Array, "#vehicles *#scenarios"]
    width: Float[Array, "#vehicles *#scenarios"]
    accel_limit: Float[Array, "#vehicles *#scenarios"]
    collides: Bool[Array, "#vehicles *#scenarios"]
    is_truck: Bool[Array, "#vehicles *#scenarios"] | None = None


class Drivers(eqx.Module):
    """Car following, lane changing and vehicles of all drivers.

    Attributes:
        car_following: Parameters of one model, see `rearl_jax.core.car_following`. The desired speed in
            the traffic's state replaces theirs: `gap_driving.begin_driving` copies it there, decisions may change it.
        mobil: Parameters of lane changing.
        body: Size, class and limits of the vehicles.
        effects: Effects on car following and lane changing. A parameter is a scalar or has the rank of
            the state's arrays.
    """

    car_following: CarFollowing
    mobil: MOBILParams
    body: Body
    effects: tuple[Effect, ...] = ()

    @property
    def see_gaps(self) -> bool:
        """True for drivers with bumper-to-bumper gaps and memory; False for highway-env's drivers without effects."""
        return bool(self.effects) or not isinstance(self.car_following, HighwayEnvIDM)


def highway_env_drivers(
    accel_exponent: Float[Array, "#vehicles *#scenarios"] | None = None,
    *,
    ndim: int = 2,
    dtype: jnp.dtype = jnp.float32,
    ticks_per_second: int = 15,
) -> Drivers:
    """Drivers with highway-env's constants, equal for all vehicles except the acceleration exponent.

    Args:
        accel_exponent: IDM exponent delta of each vehicle; None for 4 everywhere. `highway-v0` draws U(3.5, 4.5).
        ndim: Rank of the state's arrays (2 for `[vehicles, scenarios]`), if no exponent is given.
        dtype: Floating type, if no exponent is given.
        ticks_per_second: Clock of the simulation, for the period of lane-change decisions.

    Source: highway-env 1.12.1, `vehicle/behavior.py` (IDMVehicle) and `vehicle/kinematics.py` (LENGTH, WIDTH).
    """
    if accel_exponent is None:
        accel_exponent = jnp.full((1,) * ndim, 4.0, dtype)

    def shared(value: float | int | bool, kind: jnp.dtype | type = accel_exponent.dtype) -> jax.Array:
        return jnp.full((1,) * accel_exponent.ndim, value, kind)

    return Drivers(
        car_following=HighwayEnvIDM(
            desired_speed=None,
            time_gap=shared(1.5),
            jam_gap=shared(5.0),
            max_accel=shared(3.0),
            comfort_decel=shared(5.0),
            accel_exponent=accel_exponent,
        ),
        mobil=MOBILParams(
            politeness=shared(0.0),
            gain_threshold=shared(0.2),
            safe_decel=shared(2.0),
            decision_period=shared(decision_period(1.0, ticks_per_second), jnp.int32),
            changes_lanes=shared(True, bool),
        ),
        body=Body(length=shared(5.0), width=shared(2.0), accel_limit=shared(6.0), collides=shared(True, bool)),
    )
