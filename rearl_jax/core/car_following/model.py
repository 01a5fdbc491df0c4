"""Car following: the interface of every model, and its linearisation.

A model is a record of its drivers' parameters, one value per vehicle, with methods for the acceleration. Traffic,
effects and discovery use only this interface; they do not depend on the formula of a model or its parameters.
"""

from abc import abstractmethod
from dataclasses import fields, replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.config.driver.declaration import DriverModel

SMALLEST_GAP = 0.5
"""Lower bound of gaps [m] in models that divide by the gap, because measured gaps may be negative."""

LEAST_DESIRED_SPEED = 0.1
"""Lower bound of desired speeds [m/s]; the zero of absent vehicles would cause a division by zero."""

LEAST_TIME_GAP = 0.05
"""Lower bound of the time gap after effects [s], because some models divide by it."""

COMFORTABLE_DECELERATION = 2.0
"""Comfortable deceleration [m/s^2] of models without such a parameter.

Source: Treiber & Kesting, Traffic Flow Dynamics (2013), table 11.2.
"""


class CarFollowing(eqx.Module):
    """Base of all car-following models.

    Class attributes:
        declaration: Names, units, usual values, bounds and sources of the parameters, in the order of the fields.

    Attributes:
        desired_speed: Desired speed v0 [m/s]; in a simulation that of the traffic's state replaces it.
        time_gap: Time gap T [s].
        jam_gap: Bumper-to-bumper gap s0 at standstill [m].
    """

    declaration: ClassVar[DriverModel]

    desired_speed: Float[Array, "*#n"]
    time_gap: Float[Array, "*#n"]
    jam_gap: Float[Array, "*#n"]

    def __init_subclass__(cls, **arguments: object) -> None:
        super().__init_subclass__(**arguments)
        models = [base for base in reversed(cls.__mro__) if issubclass(base, CarFollowing)]
        names = dict.fromkeys(name for model in models for name in vars(model).get("__annotations__", {}))
        names, declared = [name for name in names if name != "declaration"], cls.declaration.names
        if tuple(names) != declared:
            raise TypeError(f"{cls.__name__} has the fields {names}, but its declaration says {list(declared)}")

    @abstractmethod
    def free_acceleration(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Acceleration on a free road [m/s^2] at a speed [m/s]."""

    @abstractmethod
    def acceleration(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Acceleration behind a leader [m/s^2].

        Args:
            gap: Bumper-to-bumper gap to the leader [m].
            speed: Own speed [m/s].
            approach_rate: Own minus leader's speed dv [m/s].
        """

    @abstractmethod
    def equilibrium_gap(self, speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Gap behind a leader of constant speed below the desired speed [m]."""

    def desired_gap(self, speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Desired gap at a speed and an approach rate [m]; for most models the equilibrium gap."""
        return self.equilibrium_gap(speed) + 0.0 * approach_rate

    def comfortable_deceleration(self) -> Float[Array, "*n"]:
        """Comfortable deceleration, positive [m/s^2]."""
        return jnp.full_like(self.time_gap, COMFORTABLE_DECELERATION)

    def interaction(
        self, gap: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Deceleration because of a leader [m/s^2]: free-road acceleration minus acceleration."""
        return self.free_acceleration(speed) - self.acceleration(gap, speed, approach_rate)

    def spacing_acceleration(self, seen: "SpacingStimulus") -> Float[Array, "*n"]:
        """`acceleration` [m/s^2] from centre-to-centre spacings, with each driver's own desired speed; 0 without a
        leader.
        """
        gap, drivers = jnp.where(seen.has_leader, seen.spacing - seen.length, 0.0), self._with_desired_speed_of(seen)
        return jnp.where(seen.has_leader, drivers.acceleration(gap, seen.speed, seen.approach_rate), 0.0)

    def spacing_interaction(self, seen: "SpacingStimulus") -> Float[Array, "*n"]:
        """`interaction` [m/s^2] from centre-to-centre spacings, with each driver's own desired speed; 0 without a
        leader.
        """
        gap, drivers = jnp.where(seen.has_leader, seen.spacing - seen.length, 0.0), self._with_desired_speed_of(seen)
        return jnp.where(seen.has_leader, drivers.interaction(gap, seen.speed, seen.approach_rate), 0.0)

    def _with_desired_speed_of(self, seen: "SpacingStimulus") -> "CarFollowing":
        """The same drivers with desired speeds v / (v / v0) from the stimulus; at standstill, with their own."""
        is_moving = (seen.speed > 0) & (seen.speed_ratio > 0)
        at_standstill = LEAST_DESIRED_SPEED if self.desired_speed is None else self.desired_speed
        desired_speed = jnp.where(is_moving, seen.speed / jnp.where(is_moving, seen.speed_ratio, 1), at_standstill)
        return self.with_setpoints(desired_speed, self.time_gap, self.jam_gap)

    def desired_spacing(
        self, length: Float[Array, "*#n"], speed: Float[Array, "*#n"], approach_rate: Float[Array, "*#n"]
    ) -> Float[Array, "*n"]:
        """Desired centre-to-centre spacing [m]; `length` is the vehicle length [m]."""
        return self.desired_gap(speed, approach_rate) + length

    def with_setpoints(
        self, desired_speed: Float[Array, "*#n"], time_gap: Float[Array, "*#n"], jam_gap: Float[Array, "*#n"]
    ) -> "CarFollowing":
        """The same drivers with other desired speeds, time gaps and standstill gaps (set points)."""
        return replace(self, desired_speed=desired_speed, time_gap=time_gap, jam_gap=jam_gap)

    def full(self, shape: tuple[int, ...]) -> "CarFollowing":
        """The same drivers with every parameter spread out to a shape."""
        return jax.tree.map(lambda values: jnp.broadcast_to(values, shape), self)

    @classmethod
    def of_rows(cls, rows: Float[Array, "parameters *n"]) -> "CarFollowing":
        """Drivers from the values of their parameters, in the order of the declaration."""
        return cls(*rows)

    def rows(self) -> list[Float[Array, "*#n"]]:
        """Values of the parameters, in the order of the declaration."""
        return [getattr(self, item.name) for item in fields(self)]


class SpacingStimulus(NamedTuple):
    """Stimulus with centre-to-centre distances, as in highway-env.

    Attributes:
        spacing: Distance to the leader, centre to centre [m]; inf without a leader.
        length: Vehicle length [m], the difference of spacing and gap.
        speed: Own speed [m/s].
        speed_ratio: max(v, 0) / v0 with the driver's desired speed v0 [-].
        approach_rate: Own minus leader's speed along the driver's heading [m/s].
    """

    spacing: Float[Array, "*#n"]
    length: Float[Array, "*#n"]
    speed: Float[Array, "*#n"]
    speed_ratio: Float[Array, "*#n"]
    approach_rate: Float[Array, "*#n"]

    @property
    def has_leader(self) -> Bool[Array, "*n"]:
        """True where there is a leader."""
        return jnp.isfinite(self.spacing)


class Linearisation(NamedTuple):
    """Slopes of the acceleration f(s, v, dv) at equilibrium.

    Attributes:
        gap: df/ds [1/s^2].
        speed: df/dv at constant approach rate [1/s].
        approach_rate: df/d(dv) [1/s].
    """

    gap: Float[Array, "*n"]
    speed: Float[Array, "*n"]
    approach_rate: Float[Array, "*n"]

    def stability_margin(self) -> Float[Array, "*n"]:
        """Margin of linear string stability [1/s^2]: no wave grows along a platoon if it is at least 0.

            f_v^2 + 2 f_v f_dv - 2 f_s

        Source: Treiber & Kesting, Traffic Flow Dynamics (2013), chapter 15.
        """
        return self.speed**2 + 2 * self.speed * self.approach_rate - 2 * self.gap

    def amplification(self, frequency: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Amplitude of a follower's speed over its leader's [-] at an angular frequency [rad/s].

        Source: Treiber & Kesting (2013), chapter 15: transfer function of the linearised platoon.
        """
        numerator = self.gap**2 + (self.approach_rate * frequency) ** 2
        own_speed = self.speed + self.approach_rate  # slope with the driver's own speed at constant leader speed
        return jnp.sqrt(numerator / ((self.gap - frequency**2) ** 2 + (own_speed * frequency) ** 2))


def linearise(model: CarFollowing, speed: Float[Array, "*n"]) -> Linearisation:
    """Slopes of a model's acceleration at the equilibrium behind a leader of constant speed [m/s], which must be above
    0.
    """
    point = jnp.broadcast_arrays(model.equilibrium_gap(speed), speed, jnp.zeros_like(speed))
    _, back = jax.vjp(model.acceleration, *point)
    return Linearisation(*back(jnp.ones_like(point[0])))
