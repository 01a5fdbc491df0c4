"""The Intelligent Driver Model as highway-env implements it.

    a [1 - (max(v, 0) / |v0|)^delta - (s* / d)^2]   with   s* = d0 + v T + v dv / (2 sqrt(a b))

Two deviations from the published model matter: distances d are centre to centre (d0 = s0 + 5 m includes one vehicle
length, the same for all), and s* may be negative; as s* enters squared, a leader that drives away fast enough then
makes its follower brake.

Traffic without effects uses the methods with keyword arguments, which reproduce the rounding of highway-env.

Source: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805; highway-env 1.12.1, `IDMVehicle.acceleration`.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.config.driver import highway_env_idm
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following.model import SMALLEST_GAP, CarFollowing, SpacingStimulus
from rearl_jax.core.double_double import rounded
from rearl_jax.core.elementary import not_zero, power

VEHICLE_LENGTH = 5.0
"""Vehicle length [m] included in a centre-to-centre spacing. Source: highway-env 1.12.1, `Vehicle.LENGTH`."""


class HighwayEnvIDM(CarFollowing):
    """highway-env's Intelligent Driver Model.

    Attributes:
        desired_speed: Desired speed v0 [m/s]; None if only the traffic's state contains it.
        max_accel: Maximum acceleration a [m/s^2].
        comfort_decel: Comfortable deceleration b, positive [m/s^2].
        accel_exponent: Acceleration exponent delta [-].
    """

    declaration: ClassVar[DriverModel] = highway_env_idm.MODEL

    desired_speed: Float[Array, "*#n"] | None
    max_accel: Float[Array, "*#n"]
    comfort_decel: Float[Array, "*#n"]
    accel_exponent: Float[Array, "*#n"]

    @property
    def jam_spacing(self) -> Float[Array, "*#n"]:
        """Spacing d0 at standstill, centre to centre [m]."""
        return self.jam_gap + VEHICLE_LENGTH

    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Free-road acceleration [m/s^2]: a [1 - (max(v, 0) / |v0|)^delta]."""
        speed_ratio = jnp.maximum(speed, 0.0) / jnp.abs(not_zero(self._known_desired_speed()))
        return self.free_acceleration_at(speed_ratio=speed_ratio)

    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2]: a [1 - (max(v, 0) / |v0|)^delta - (s* / d)^2]."""
        return self.free_acceleration(speed) - self.interaction(gap, speed, approach_rate)

    def interaction(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Deceleration because of a leader [m/s^2]: a (s* / d)^2."""
        distance = jnp.maximum(gap + VEHICLE_LENGTH, SMALLEST_GAP)
        return self.interaction_at(distance=distance, speed=speed, approach_rate=approach_rate)

    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Equilibrium gap [m]: (d0 + v T) / sqrt(1 - (v / v0)^delta) - 5 m; without bound towards the desired speed."""
        free = 1 - power(jnp.maximum(speed, 0.0) / self._known_desired_speed(), self.accel_exponent)
        return (self.jam_spacing + speed * self.time_gap) / jnp.sqrt(jnp.maximum(free, 1e-6)) - VEHICLE_LENGTH

    def desired_gap(self, speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Desired gap [m]: s* - 5 m."""
        return self.desired_distance(speed=speed, approach_rate=approach_rate) - VEHICLE_LENGTH

    def _known_desired_speed(self) -> Float[Array, "*#n"]:
        """Desired speed of these parameters [m/s].

        Raises:
            ValueError: Only the traffic's state contains desired speeds.
        """
        if self.desired_speed is None:
            raise ValueError("these drivers' desired speeds are in the traffic's state: set one by with_setpoints")
        return self.desired_speed

    def comfortable_deceleration(self) -> Float[Array, "*n"]:
        """Comfortable deceleration [m/s^2]: b."""
        return self.comfort_decel

    def spacing_acceleration(self, seen: SpacingStimulus) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2], independent of vehicle lengths.

        a [1 - (max(v, 0) / |v0|)^delta - (s* / d)^2]
        """
        return self.free_acceleration_at(speed_ratio=seen.speed_ratio) - self.spacing_interaction(seen)

    def spacing_interaction(self, seen: SpacingStimulus) -> Float[Array, "*n"]:
        """Deceleration because of a leader [m/s^2]: a (s* / d)^2, independent of vehicle lengths."""
        return self.interaction_at(distance=seen.spacing, speed=seen.speed, approach_rate=seen.approach_rate)

    def desired_spacing(
        self, length: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Desired centre-to-centre spacing s* [m], independent of vehicle lengths."""
        return self.desired_distance(speed=speed, approach_rate=approach_rate)

    def free_acceleration_at(self, *, speed_ratio: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Acceleration on a free road [m/s^2]: a [1 - (v / v0)^delta], unbounded below for v > v0.

        Args:
            speed_ratio: max(v, 0) / |v0| [-].
        """
        return rounded(self.max_accel * (1 - power(speed_ratio, self.accel_exponent)))

    def desired_distance(self, *, speed: Float[Array, "*n"], approach_rate: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Desired spacing s* to the leader, centre to centre [m].

        Args:
            speed: Own speed [m/s].
            approach_rate: Own minus leader's speed along the driver's heading [m/s].
        """
        v, a, b = speed, self.max_accel, self.comfort_decel
        return self.jam_spacing + rounded(v * self.time_gap) + v * approach_rate / (2 * jnp.sqrt(a * b))

    def interaction_at(
        self, *, distance: Float[Array, "*n"], speed: Float[Array, "*n"], approach_rate: Float[Array, "*n"]
    ) -> Float[Array, "*n"]:
        """Deceleration because of a leader [m/s^2], positive: a (s* / d)^2; 0 at distance inf.

        Args:
            distance: To the leader, centre to centre [m]; inf if there is none.
            speed: Own speed [m/s].
            approach_rate: Own minus leader's speed along the driver's heading [m/s].
        """
        ratio = self.desired_distance(speed=speed, approach_rate=approach_rate) / not_zero(distance)
        return rounded(self.max_accel * (ratio * ratio))
