"""Krauss' model: the safe speed of SUMO's standard driver.

    v_safe = v_leader + (s - s0 - v_leader T) / ((v + v_leader) / (2 b) + T)
    acceleration = min(a, (min(v0, v_safe) - v) / T)

The reaction time T is the equilibrium time gap. Krauss' model has time steps of one reaction time; here the speed
changes in continuous time. Dawdling is modelled as noise (`driver.noise_sd`, or the effect `acceleration_noise`).

Source: Krauss, Microscopic Modeling of Traffic Flow (1998), DLR-FB 98-08.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import krauss
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import CarFollowing


class Krauss(CarFollowing):
    """Krauss' model in continuous time, without dawdling.

    Attributes:
        max_accel: Maximum acceleration a [m/s^2].
        comfort_decel: Comfortable deceleration b, positive [m/s^2], the hardest braking a driver wants.
    """

    declaration: ClassVar[DriverModel] = krauss.MODEL

    max_accel: Float[Array, "*#n"]
    comfort_decel: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: min(a, (v0 - v) / T)."""
        return jnp.minimum(self.max_accel, (self.desired_speed - speed) / self.time_gap)

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: min(a, (min(v0, v_safe) - v) / T)."""
        leader_speed = jnp.maximum(speed - approach_rate, 0.0)
        mean_speed = (jnp.maximum(speed, 0.0) + leader_speed) / 2
        reserve = gap - self.jam_gap - leader_speed * self.time_gap
        safe_speed = leader_speed + reserve / (mean_speed / self.comfort_decel + self.time_gap)
        return jnp.minimum(self.free_acceleration(speed), (safe_speed - speed) / self.time_gap)

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v T."""
        return self.jam_gap + speed * self.time_gap

    def comfortable_deceleration(self) -> Float[Array, "*n"]:
        """Comfortable deceleration [m/s^2]: b."""
        return self.comfort_decel
