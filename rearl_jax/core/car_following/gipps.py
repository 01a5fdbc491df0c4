"""Gipps' model: the fastest speed from which a driver can still stop behind a leader who brakes.

    v_free = v + 2.5 a tau (1 - v / v0) sqrt(0.025 + v / v0)
    v_safe = -b tau + sqrt(b^2 tau^2 + b [2 (s - s0) - v tau] + v_leader^2)
    acceleration = (min(v_free, v_safe) - v) / tau

Drivers assume that the leader brakes with their own deceleration b. The safety margin is half a reaction time, as in
Gipps' paper, so the equilibrium time gap is T = 1.5 tau. T is the parameter here, as in all other models. Gipps' model
has time steps of one reaction time; here the speed changes in continuous time.

Source: Gipps, Transp. Res. B 15 (1981) 105.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import gipps
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import CarFollowing

TIME_GAP_PER_REACTION_TIME = 1.5
"""Equilibrium time gap over the reaction time [-]: the reaction time and half of it as a margin.

Source: Gipps (1981).
"""

MIN_SQUARE_ROOT = 0.1
"""Lower bound of the square root in the safe speed [m/s], for gaps too short to stop; it keeps the slope finite."""


class Gipps(CarFollowing):
    """Gipps' model in continuous time.

    Attributes:
        max_accel: Maximum acceleration a [m/s^2].
        comfort_decel: Comfortable deceleration b, positive [m/s^2], the hardest braking a driver wants.
    """

    declaration: ClassVar[DriverModel] = gipps.MODEL

    max_accel: Float[Array, "*#n"]
    comfort_decel: Float[Array, "*#n"]

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: 2.5 a (1 - v / v0) sqrt(0.025 + v / v0)."""
        ratio = speed / self.desired_speed
        return 2.5 * self.max_accel * (1 - ratio) * jnp.sqrt(0.025 + jnp.maximum(ratio, 0.0))

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: (min(v_free, v_safe) - v) / tau."""
        reaction_time = self.time_gap / TIME_GAP_PER_REACTION_TIME
        decel, leader_speed = self.comfort_decel, jnp.maximum(speed - approach_rate, 0.0)
        reserve = 2 * (gap - self.jam_gap) - speed * reaction_time
        square = (decel * reaction_time) ** 2 + decel * reserve + leader_speed**2
        safe_speed = -decel * reaction_time + jnp.sqrt(jnp.maximum(square, MIN_SQUARE_ROOT**2))
        return jnp.minimum(self.free_acceleration(speed), (safe_speed - speed) / reaction_time)

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: s0 + v T."""
        return self.jam_gap + speed * self.time_gap

    def comfortable_deceleration(self) -> Float[Array, "*n"]:
        """Comfortable deceleration [m/s^2]: b."""
        return self.comfort_decel
