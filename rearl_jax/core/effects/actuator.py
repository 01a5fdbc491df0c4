"""Effects of the vehicle between the wanted and the executed acceleration."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.effect import Effect, Parameter

NO_BOUND = 20.0
"""Acceleration [m/s^2] above the capability of any vehicle."""

NO_JERK_BOUND = 400.0
"""Jerk [m/s^3] without effect as a bound: from full braking to full acceleration within a time step."""


class ActuatorLag(Effect):
    """The vehicle follows the wanted acceleration with a first-order lag."""

    time: Float[Array, "*#n"]

    name: ClassVar[str] = "actuator_lag"
    equation: ClassVar[str] = "da/dt = (a_wanted - a) / time"
    source: ClassVar[str] = (
        "after Ploeg, van de Wouw & Nijmeijer, IEEE Trans. Control Syst. Technol. 22 (2014) 786 (first-order vehicle)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("time", "s", "time constant of engine and brakes", off=0.0, low=0.0, high=3.0, scale=0.4),
    )

    def actuate(self, wanted: Float[Array, "*n"], last: Float[Array, "*n"], dt: float) -> Float[Array, "*n"]:
        """The executed acceleration, moved part of the way to the wanted one."""
        # Backward Euler is stable for every time constant and has a derivative at the time constant 0, which the search
        # needs.
        return wanted + (last - wanted) * self.time / (self.time + dt)


class VehicleLimits(Effect):
    """Acceleration, braking and jerk of the vehicle are limited."""

    acceleration_limit: Float[Array, "*#n"]
    deceleration_limit: Float[Array, "*#n"]
    jerk_limit: Float[Array, "*#n"]

    name: ClassVar[str] = "vehicle_limits"
    equation: ClassVar[str] = "-deceleration_limit <= a <= acceleration_limit, |da/dt| <= jerk_limit"
    source: ClassVar[str] = "after ISO 15622 (2018), limits of adaptive cruise control"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "acceleration_limit", "m/s^2", "largest acceleration", off=NO_BOUND, low=0.1, high=NO_BOUND, scale=4.0
        ),
        Parameter(
            "deceleration_limit", "m/s^2", "largest deceleration", off=NO_BOUND, low=0.1, high=NO_BOUND, scale=4.0
        ),
        Parameter(
            "jerk_limit",
            "m/s^3",
            "largest rate of change of the acceleration",
            off=NO_JERK_BOUND,
            low=0.1,
            high=NO_JERK_BOUND,
            scale=20.0,
        ),
    )

    def actuate(self, wanted: Float[Array, "*n"], last: Float[Array, "*n"], dt: float) -> Float[Array, "*n"]:
        """Wanted acceleration within the limits; limits of acceleration are applied before the limit of jerk."""
        bounded = jnp.clip(wanted, -self.deceleration_limit, self.acceleration_limit)
        step = self.jerk_limit * dt
        return jnp.clip(bounded, last - step, last + step)
