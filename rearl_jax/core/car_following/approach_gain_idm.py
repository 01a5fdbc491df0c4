"""The Intelligent Driver Model with a separate gain for the approach rate.

    min(a [1 - (s* / s)^p] - k dv, k0 (v0 - v))   with   s* = s0 + v T

IDM responds to the approach rate through the desired gap, with a strength that follows from a and b. In adaptive cruise
controls this response is a separate parameter, k, and a speed controller, k0 (v0 - v), bounds the acceleration.

Source: after Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805; relative-speed term as in Milanes &
Shladover, Transp. Res. C 48 (2014) 285; speed control as in Xiao, Wang & van Arem, Transp. Res. Rec. 2623 (2017) 1.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import approach_gain_idm
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import SMALLEST_GAP, CarFollowing


class ApproachGainIDM(CarFollowing):
    """IDM with a separate parameter for the response to the approach rate.

    Attributes:
        max_accel: Maximum acceleration a [m/s^2].
        gap_exponent: Exponent p of the gap term [-].
        approach_gain: Gain k of the approach rate [1/s].
        speed_gain: Gain k0 of the difference to the desired speed [1/s].
    """

    declaration: ClassVar[DriverModel] = approach_gain_idm.MODEL

    max_accel: Float[Array, "*#n"]
    gap_exponent: Float[Array, "*#n"]
    approach_gain: Float[Array, "*#n"]
    speed_gain: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: min(a, k0 (v0 - v))."""
        return jnp.minimum(self.max_accel, self._cap(speed))

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: min(a [1 - (s* / s)^p] - k dv, k0 (v0 - v))."""
        ratio = self.equilibrium_gap(jnp.maximum(speed, 0.0)) / jnp.maximum(gap, SMALLEST_GAP)
        following = self.max_accel * (1 - ratio**self.gap_exponent) - self.approach_gain * approach_rate
        return jnp.minimum(following, self._cap(speed))

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v T."""
        return self.jam_gap + speed * self.time_gap

    def _cap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Upper bound of the acceleration: k0 (v0 - v) [m/s^2]."""
        return self.speed_gain * (self.desired_speed - speed)
