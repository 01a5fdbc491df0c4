"""The Intelligent Driver Model as published, on bumper-to-bumper gaps; the desired gap is at least the jam gap.

    a [1 - (v / v0)^4 - (s* / s)^2]   with   s* = s0 + max(0, v T + v dv / (2 sqrt(a b)))

Source: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import idm
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import SMALLEST_GAP, CarFollowing


class IDM(CarFollowing):
    """The published Intelligent Driver Model.

    Attributes:
        max_accel: Maximum acceleration a [m/s^2].
        comfort_decel: Comfortable deceleration b, positive [m/s^2].
    """

    declaration: ClassVar[DriverModel] = idm.MODEL

    max_accel: Float[Array, "*#n"]
    comfort_decel: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: a [1 - (v / v0)^4]."""
        return self.max_accel * (1 - self._free_term(speed))

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: a [1 - (v / v0)^4 - (s* / s)^2]."""
        ratio = self.desired_gap(speed, approach_rate) / jnp.maximum(gap, SMALLEST_GAP)
        return self.max_accel * (1 - self._free_term(speed) - ratio * ratio)

    def interaction(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Deceleration because of a leader [m/s^2]: a (s* / s)^2."""
        ratio = self.desired_gap(speed, approach_rate) / jnp.maximum(gap, SMALLEST_GAP)
        return self.max_accel * (ratio * ratio)

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: (s0 + v T) / sqrt(1 - (v / v0)^4); without bound towards the desired speed."""
        return (self.jam_gap + speed * self.time_gap) / jnp.sqrt(jnp.maximum(1 - self._free_term(speed), 1e-6))

    def desired_gap(self, speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Desired gap [m]: s*."""
        braking = speed * approach_rate / (2 * jnp.sqrt(self.max_accel * self.comfort_decel))
        return self.jam_gap + jnp.maximum(speed * self.time_gap + braking, 0.0)

    def comfortable_deceleration(self) -> Float[Array, "*n"]:
        """Comfortable deceleration [m/s^2]: b."""
        return self.comfort_decel

    def _free_term(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road term: (v / v0)^4 [-]."""
        ratio = jnp.maximum(speed, 0.0) / self.desired_speed
        square = ratio * ratio
        return square * square
