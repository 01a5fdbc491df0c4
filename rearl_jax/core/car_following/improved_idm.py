"""The improved Intelligent Driver Model: drivers keep the gap s0 + v T up to the desired speed, and a driver who is
faster than desired brakes comfortably.

With z = s* / s, s* as in IDM, and the free-road acceleration f:

    f = a [1 - (v / v0)^4]  up to v0,   -b [1 - (v0 / v)^(4 a / b)]  above
    z >= 1:  a (1 - z^2)  up to v0,   f + a (1 - z^2)  above
    z < 1:   f (1 - z^(2 a / f))  up to v0,   f  above

Source: Treiber & Kesting, Traffic Flow Dynamics (2013), section 11.3.7. SUMO's EIDM is based on it.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import improved_idm
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.car_following.model import SMALLEST_GAP, CarFollowing

LEAST_FREE = 1e-3
"""Lower bound of f in the exponent 2 a / f [m/s^2], because f may be 0."""


class ImprovedIDM(IDM):
    """The improved Intelligent Driver Model, with the parameters of IDM."""

    declaration: ClassVar[DriverModel] = improved_idm.MODEL

    interaction = CarFollowing.interaction

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration f [m/s^2]."""
        excess = jnp.maximum(speed / self.desired_speed, 1.0)
        braking = self.comfort_decel * (1 - excess ** (-4 * self.max_accel / self.comfort_decel))
        return self.max_accel * (1 - jnp.minimum(self._free_term(speed), 1.0)) - braking

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]."""
        free = self.free_acceleration(speed)
        ratio = self.desired_gap(speed, approach_rate) / jnp.maximum(gap, SMALLEST_GAP)
        wide = free * (1 - jnp.minimum(ratio, 1.0) ** (2 * self.max_accel / jnp.maximum(free, LEAST_FREE)))
        close = self.max_accel * (1 - ratio * ratio)
        return jnp.where(free > 0, jnp.where(ratio < 1, wide, close), free + jnp.minimum(close, 0.0))

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v T."""
        return self.jam_gap + speed * self.time_gap
