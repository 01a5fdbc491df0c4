"""Effects of further vehicles ahead and beside, and of the leader's acceleration."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

PASSING_SPEED = 60 / 3.6
"""Speed [m/s] up to which vehicles may be passed on the right, in congestion."""

STRONGEST_SECOND = 9.0
"""Bound of the interaction deceleration behind the second leader [m/s^2], for very small second gaps; tyre grip on a
dry road.
"""


def interaction_increase(
    value: Float[Array, "*#n"],
    gap: Float[Array, "*#n"],
    speed: Float[Array, "*#n"],
    other_speed: Float[Array, "*#n"],
    driver: CarFollowing,
    limit: Float[Array, "*#n"],
) -> Float[Array, "*n"]:
    """Increase of the interaction deceleration by another vehicle [m/s^2], as far as braking stays within a limit.

    max(0, min(I, a_free + limit) - value), I the interaction deceleration behind that vehicle. The acceleration is
    a_free - I, so I = a_free + limit brakes with the limit.

    Args:
        value: Interaction deceleration without that vehicle [m/s^2].
        gap: Bumper-to-bumper gap to it [m].
        speed: Own speed [m/s].
        other_speed: Its speed [m/s].
        driver: Car following of the drivers.
        limit: Largest deceleration because of it [m/s^2].
    """
    largest = driver.free_acceleration(speed) + limit
    return jnp.maximum(jnp.minimum(driver.interaction(gap, speed, speed - other_speed), largest) - value, 0.0)


class SeveralLeaders(Effect):
    """The driver also keeps twice the distance to the leader's leader."""

    weight: Float[Array, "*#n"]
    relief: Float[Array, "*#n"]

    name: ClassVar[str] = "several_leaders"
    depends_on: ClassVar[tuple[str, ...]] = ("second_gap", "second_speed")
    equation: ClassVar[str] = (
        "(1 - relief w) I(s, dv) + w I(s_2 / 2, dv_2), I the interaction deceleration behind a vehicle at that gap and "
        "approach rate, s_2 the sum of the next two gaps"
    )
    source: ClassVar[str] = "after Treiber, Kesting & Helbing, Physica A 360 (2006) 71 (human driver model)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weight", "-", "weight of the second leader", off=0.0, low=0.0, high=1.0, scale=0.4),
        Parameter(
            "relief",
            "-",
            "reduction of the first leader's weight",
            off=0.5,
            low=0.0,
            high=1.0,
            scale=0.5,
            is_strength=False,
        ),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Interaction deceleration [m/s^2], weighted over both leaders if there are two."""
        dv = seen.speed - seen.second_speed
        second = jnp.minimum(driver.interaction(seen.second_gap / 2, seen.speed, dv), STRONGEST_SECOND)
        return value + self.weight * seen.has_second * seen.has_leader * (second - self.relief * value)


class LeaderAcceleration(Effect):
    """The driver responds to the leader's acceleration before the speeds differ, as to brake lights."""

    gain: Float[Array, "*#n"]
    reach: Float[Array, "*#n"]

    name: ClassVar[str] = "leader_acceleration"
    depends_on: ClassVar[tuple[str, ...]] = ("leader_acceleration",)
    equation: ClassVar[str] = "a + gain a_leader exp(-s / reach)"
    source: ClassVar[str] = "after Kesting, Treiber & Helbing, Phil. Trans. R. Soc. A 368 (2010) 4585 (ACC model)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "-", "share of the leader's acceleration", off=0.0, low=0.0, high=1.5, scale=0.4),
        Parameter(
            "reach",
            "m",
            "gap at which the gain has fallen to 1/e",
            off=60.0,
            low=15.0,
            high=240.0,
            scale=30.0,
            is_strength=False,
        ),
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration plus a share of the leader's acceleration."""
        return value + self.gain * seen.has_leader * seen.leader_acceleration * jnp.exp(-seen.gap / self.reach)


class Asymmetry(Effect):
    """The driver responds differently to a shrinking and to a growing gap; both responses saturate."""

    closing: Float[Array, "*#n"]
    opening: Float[Array, "*#n"]
    scale: Float[Array, "*#n"]

    name: ClassVar[str] = "asymmetry"
    depends_on: ClassVar[tuple[str, ...]] = ("approach_rate",)
    equation: ClassVar[str] = "a - closing h(dv) - opening h(-dv), h(u) = scale tanh(max(0, u) / scale)"
    source: ClassVar[str] = "after Gong, Liu & Wang, Physica A 387 (2008) 2595 (asymmetric full velocity difference)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("closing", "1/s", "deceleration per approach rate", off=0.0, low=-1.0, high=1.0, scale=0.15),
        Parameter("opening", "1/s", "deceleration per rate of falling back", off=0.0, low=-1.0, high=1.0, scale=0.15),
        Parameter(
            "scale",
            "m/s",
            "approach rate at which the response saturates",
            off=5.0,
            low=1.0,
            high=30.0,
            scale=4.0,
            is_strength=False,
        ),
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration minus a term in the rate at which the gap shrinks or grows."""
        dv = seen.speed - seen.leader_speed
        nearer, farther = (self.scale * jnp.tanh(jnp.maximum(rate, 0.0) / self.scale) for rate in (dv, -dv))
        return value - seen.has_leader * (self.closing * nearer + self.opening * farther)


class LaneFriction(Effect):
    """Slower vehicles on adjacent lanes slow the driver down."""

    gain: Float[Array, "*#n"]
    scale: Float[Array, "*#n"]

    name: ClassVar[str] = "lane_friction"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_beside",)
    equation: ClassVar[str] = "a - gain tanh(max(0, v - v_beside) / scale)"
    source: ClassVar[str] = "after Ponnu & Coifman, Transp. Res. B 97 (2017) 228 (adjacent-lane friction)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "m/s^2", "deceleration beside much slower traffic", off=0.0, low=0.0, high=3.0, scale=0.5),
        Parameter(
            "scale",
            "m/s",
            "speed difference at which the response saturates",
            off=5.0,
            low=1.0,
            high=15.0,
            scale=2.5,
            is_strength=False,
        ),
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration minus a term in the speed difference to slower vehicles on adjacent lanes."""
        faster_by = jnp.maximum(seen.speed - seen.beside_speed, 0.0)
        return value - self.gain * jnp.tanh(faster_by / self.scale)


class NoUndertaking(Effect):
    """A driver does not pass a slower vehicle ahead on the left lane; braking for it is at most comfortable."""

    weight: Float[Array, "*#n"]

    name: ClassVar[str] = "no_undertaking"
    depends_on: ClassVar[tuple[str, ...]] = ("left_gap", "left_speed")
    equation: ClassVar[str] = (
        "I + w max(0, min(I_left, a_free + b) - I) / (1 + exp((v_left - v) / 0.5 m/s)) above 60 km/h, I and "
        "I_left the interaction decelerations behind the leader and behind that on the left lane, b the comfortable "
        "deceleration"
    )
    source: ClassVar[str] = "after Treiber & Kesting, Traffic Flow Dynamics (2013), chapter 14 (European rules)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "weight",
            "-",
            "weight of the leader on the left lane; 1 forbids passing it",
            off=0.0,
            low=0.0,
            high=1.0,
            scale=0.5,
        ),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Interaction deceleration [m/s^2]: `value`, increased if the driver would pass the leader on the left lane."""
        comfortable = driver.comfortable_deceleration()
        increase = interaction_increase(value, seen.left_gap, seen.speed, seen.left_speed, driver, comfortable)
        faster_by = seen.speed - seen.left_speed
        passes = jnp.where(seen.speed > PASSING_SPEED, seen.has_left, 0.0) * jax.nn.sigmoid(2.0 * faster_by)
        return value + self.weight * passes * increase
