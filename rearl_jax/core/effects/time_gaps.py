"""Effects on the desired time gap."""

from dataclasses import replace
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

USUAL_SPEED = 20.0
"""Speed [m/s] at which a speed-dependent time gap is the driver's own."""


class SpeedDependentTimeGap(Effect):
    """The time gap grows or falls with the own speed."""

    slope: Float[Array, "*#n"]

    name: ClassVar[str] = "speed_dependent_time_gap"
    depends_on: ClassVar[tuple[str, ...]] = ("speed",)
    equation: ClassVar[str] = "T exp(slope (v / 20 m/s - 1))"
    source: ClassVar[str] = "after Jiang et al., Transp. Res. B 69 (2014) 527 (speed-dependent preferred time gap)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slope", "-", "growth of log T with v / 20 m/s", off=0.0, low=-2.0, high=2.0, scale=0.4),
    )

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, changed with the own speed."""
        return value * jnp.exp(self.slope * (seen.speed / USUAL_SPEED - 1))


class VarianceDrivenTimeGap(Effect):
    """The time gap grows if the vehicles ahead drive at unequal speeds."""

    gain: Float[Array, "*#n"]

    name: ClassVar[str] = "variance_driven_time_gap"
    depends_on: ClassVar[tuple[str, ...]] = ("speeds_ahead",)
    equation: ClassVar[str] = "T exp(gain V), V = sd / mean of the speeds of the own and the next three vehicles"
    source: ClassVar[str] = "after Treiber, Kesting & Helbing, Phys. Rev. E 74 (2006) 016123"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gain",
            "-",
            "growth of log T with the speeds' coefficient of variation",
            off=0.0,
            low=0.0,
            high=12.0,
            scale=3.0,
        ),
    )

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, longer if the speeds ahead are unequal."""
        second = jnp.where(seen.has_second > 0, seen.second_speed, seen.leader_speed)
        third = jnp.where(seen.has_third > 0, seen.third_speed, second)
        speeds = jnp.stack(jnp.broadcast_arrays(seen.speed, seen.leader_speed, second, third))
        # The small constants keep the derivative finite for equal speeds and in standing traffic.
        variation = jnp.sqrt(jnp.var(speeds, axis=0) + 0.04) / (jnp.mean(speeds, axis=0) + 2.0)
        return value * jnp.exp(self.gain * variation)


class Resignation(Effect):
    """The time gap depends on how far below the desired speed the driver has been recently, as in long queues."""

    gain: Float[Array, "*#n"]
    memory_time: Float[Array, "*#n"]

    name: ClassVar[str] = "resignation"
    depends_on: ClassVar[tuple[str, ...]] = ("past_speed",)
    equation: ClassVar[str] = "T exp(gain (1 - L)), dL/dt = (v / v0 - L) / memory_time"
    source: ClassVar[str] = "after Treiber & Helbing, Phys. Rev. E 68 (2003) 046119 (memory effect)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "-", "growth of log T at a standstill", off=0.0, low=0.0, high=3.0, scale=0.6),
        Parameter(
            "memory_time",
            "s",
            "time over which speeds are remembered",
            off=10.0,
            low=2.0,
            high=120.0,
            scale=10.0,
            is_strength=False,
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> Float[Array, "*n"]:
        """The present level of service."""
        return seen.speed / driver.desired_speed

    def remember(
        self, memory: Float[Array, "*n"], seen: Stimulus, driver: CarFollowing, dt: float
    ) -> Float[Array, "*n"]:
        """The level of service, smoothed exponentially."""
        return memory + dt / self.memory_time * (seen.speed / driver.desired_speed - memory)

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Time gap, longer after more time in a queue."""
        return value * jnp.exp(self.gain * (1 - memory))


class Relaxation(Effect):
    """Right after a lane change the driver accepts a short gap; the desired gap returns slowly."""

    gap_share: Float[Array, "*#n"]
    time_gap_share: Float[Array, "*#n"]
    relaxation_time: Float[Array, "*#n"]

    name: ClassVar[str] = "relaxation"
    depends_on: ClassVar[tuple[str, ...]] = ("time_since_change",)
    equation: ClassVar[str] = (
        "s + gap_share s_lost e, T + time_gap_share min(0, T_then - T) e, e = exp(-t_since_change / relaxation_time)"
    )
    source: ClassVar[str] = "after Laval & Leclercq, Transp. Res. B 42 (2008) 511; Keane & Gao, ibid. 150 (2021) 301"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gap_share", "-", "share of the lost gap that is ignored at first", off=0.0, low=0.0, high=2.0, scale=0.5
        ),
        Parameter(
            "time_gap_share",
            "-",
            "share of the difference to the time gap right after the change",
            off=0.0,
            low=0.0,
            high=1.5,
            scale=0.5,
        ),
        Parameter(
            "relaxation_time",
            "s",
            "relaxation time of the difference",
            off=10.0,
            low=1.0,
            high=60.0,
            scale=7.0,
            is_strength=False,
        ),
    )

    def perceive(self, seen: Stimulus, memory: None) -> Stimulus:
        """Stimulus with part of the lost gap added."""
        return replace(seen, gap=seen.gap + self.gap_share * seen.gap_lost * self._remaining_share(seen))

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, shorter if the gap after the change was shorter."""
        return value + self.time_gap_share * jnp.minimum(seen.time_gap_at_change - value, 0.0) * self._remaining_share(
            seen
        )

    def _remaining_share(self, seen: Stimulus) -> Float[Array, "*n"]:
        return jnp.exp(-seen.time_since_change / self.relaxation_time)


PRESSING_TIME_GAP = Parameter(
    "pressing_time_gap",
    "s",
    "follower's time gap z0 below which it presses",
    off=1.0,
    low=0.3,
    high=2.5,
    scale=0.3,
    is_strength=False,
)
"""Parameter of effects of a close follower."""


def pressure_from_behind(seen: Stimulus, pressing_time_gap: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """Pressure of the follower [-], from 0 to 1, by its time gap z: 1 / (1 + exp((z - z0) / 0.25 s)).

    z = max(gap, 0.5 m) / (speed + 2 m/s) stays finite when the follower stands or touches. Without a follower the value
    has no meaning.

    Args:
        seen: Present stimulus of each driver.
        pressing_time_gap: The time gap z0 [s].

    Source: form of this project.
    """
    time_gap = jnp.maximum(seen.follower_gap, 0.5) / (jnp.maximum(seen.follower_speed, 0.0) + 2.0)
    return jax.nn.sigmoid((pressing_time_gap - time_gap) / 0.25)


class RearPressure(Effect):
    """A close follower makes the driver follow more closely."""

    gain: Float[Array, "*#n"]
    pressing_time_gap: Float[Array, "*#n"]

    name: ClassVar[str] = "rear_pressure"
    depends_on: ClassVar[tuple[str, ...]] = ("follower_gap",)
    equation: ClassVar[str] = "T exp(-gain / (1 + exp((z - z0) / 0.25 s))), z the follower's time gap"
    source: ClassVar[str] = "after Herman, Montroll, Potts & Rothery, Oper. Res. 7 (1959) 86 (look-behind term)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "-", "fall of log T under pressure", off=0.0, low=0.0, high=2.5, scale=0.5),
        PRESSING_TIME_GAP,
    )

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, shorter under pressure."""
        return value * jnp.exp(-self.gain * seen.has_follower * pressure_from_behind(seen, self.pressing_time_gap))


class LeaderClass(Effect):
    """The time gap behind a truck differs from that behind a car."""

    gain: Float[Array, "*#n"]

    name: ClassVar[str] = "leader_class"
    depends_on: ClassVar[tuple[str, ...]] = ("leader_class",)
    equation: ClassVar[str] = "T exp(gain) behind a truck"
    source: ClassVar[str] = "after Aghabayk, Sarvi & Young, Transport Reviews 35 (2015) 82 (headways behind trucks)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "-", "growth of log T behind a truck", off=0.0, low=-1.5, high=1.5, scale=0.4),
    )

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, longer or shorter behind a truck."""
        return value * jnp.exp(self.gain * seen.has_leader * seen.leader_is_truck)
