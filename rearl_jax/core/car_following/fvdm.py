"""The full velocity difference model: relaxation to a speed that depends on the gap, and response to the approach rate.

    k0 [V(s) - v] - k dv   with   V(s) = v0 tanh((s - s0) / (v0 T)), 0 below s0

The optimal velocity rises with the slope 1 / T at the jam gap, so T is the time gap in slow traffic; towards the
desired speed gaps grow beyond s0 + v T.

Source: Jiang, Wu & Zhu, Phys. Rev. E 64 (2001) 017101; hyperbolic tangent as in Bando et al., Phys. Rev. E 51 (1995)
1035, with its inflection at standstill.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import fvdm
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import CarFollowing

MAX_SPEED_SHARE = 0.999
"""Upper bound of v / v0 in the equilibrium gap, which is infinite at the desired speed v0 [-]."""


class FVDM(CarFollowing):
    """The full velocity difference model.

    Attributes:
        speed_gain: Gain k0 of the difference to the optimal velocity V(s) [1/s], the sensitivity.
        approach_gain: Gain k of the approach rate [1/s].
    """

    declaration: ClassVar[DriverModel] = fvdm.MODEL

    speed_gain: Float[Array, "*#n"]
    approach_gain: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: k0 (v0 - v)."""
        return self.speed_gain * (self.desired_speed - speed)

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: k0 [V(s) - v] - k dv."""
        length_scale = self.desired_speed * self.time_gap
        optimal_speed = self.desired_speed * jnp.tanh(jnp.maximum(gap - self.jam_gap, 0.0) / length_scale)
        return self.speed_gain * (optimal_speed - speed) - self.approach_gain * approach_rate

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v0 T artanh(v / v0)."""
        share = jnp.clip(speed / self.desired_speed, 0.0, MAX_SPEED_SHARE)
        return self.jam_gap + self.desired_speed * self.time_gap * jnp.arctanh(share)
