"""Adaptive cruise control at a constant time headway: linear in the error of the gap and in the approach rate.

    min(k_s (s - s0 - v T) - k dv, k0 (v0 - v))

Source: Milanes & Shladover, Transp. Res. C 48 (2014) 285 (gap control); Xiao, Wang & van Arem, Transp. Res. Rec. 2623
(2017) 1 (speed control); Ioannou & Chien, IEEE Trans. Veh. Technol. 42 (1993) 657 (constant time headway).
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import constant_time_headway
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import CarFollowing


class ConstantTimeHeadway(CarFollowing):
    """A linear controller with a constant time headway.

    Attributes:
        gap_gain: Gain k_s of the gap error [1/s^2].
        approach_gain: Gain k of the approach rate [1/s].
        speed_gain: Gain k0 of the difference to the desired speed [1/s].
    """

    declaration: ClassVar[DriverModel] = constant_time_headway.MODEL

    gap_gain: Float[Array, "*#n"]
    approach_gain: Float[Array, "*#n"]
    speed_gain: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: k0 (v0 - v)."""
        return self.speed_gain * (self.desired_speed - speed)

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: min(k_s (s - s0 - v T) - k dv, k0 (v0 - v))."""
        following = self.gap_gain * (gap - self.equilibrium_gap(speed)) - self.approach_gain * approach_rate
        return jnp.minimum(following, self.free_acceleration(speed))

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v T."""
        return self.jam_gap + speed * self.time_gap
