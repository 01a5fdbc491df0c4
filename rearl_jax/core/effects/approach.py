"""Effects of the approach to the vehicle ahead, and of the gap at the start of following."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

SLOWEST = 2.0
"""Smallest speed for which a present time gap is computed [m/s]."""

TIME_GAPS = (0.1, 6.0)
"""Range of a present time gap [s]; beyond it a driver does not follow."""


class ApproachRateGain(Effect):
    """The driver responds to the approach rate with an additional gain."""

    gain: Float[Array, "*#n"]

    name: ClassVar[str] = "approach_rate_gain"
    depends_on: ClassVar[tuple[str, ...]] = ("approach_rate",)
    equation: ClassVar[str] = "a - gain dv behind a leader"
    source: ClassVar[str] = "after Helly (1959) and Milanes & Shladover, Transp. Res. C 48 (2014) 285 (relative speed)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "1/s", "deceleration per approach rate", off=0.0, low=-1.0, high=2.0, scale=0.3),
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration minus a term in the approach rate."""
        return value - self.gain * seen.has_leader * (seen.speed - seen.leader_speed)


class FirstGap(eqx.Module):
    """Memory of the gap at which a driver began to follow.

    Attributes:
        time_gap: Time gap right after the leader appeared [s]; without a leader, that of the gap OUT_OF_SIGHT.
        elapsed: Time since then [s].
        had_leader: Whether there was a leader in the last time step.
        time_since_change: `Stimulus.time_since_change` in the last time step [s].
    """

    time_gap: Float[Array, "*n"]
    elapsed: Float[Array, "*n"]
    had_leader: Float[Array, "*n"]
    time_since_change: Float[Array, "*n"]


class GapRelaxation(Effect):
    """At the start of following, or of a recording, the time gap relaxes from its present to its desired value."""

    share: Float[Array, "*#n"]
    relaxation_time: Float[Array, "*#n"]

    name: ClassVar[str] = "gap_relaxation"
    depends_on: ClassVar[tuple[str, ...]] = ("time_since_change",)
    equation: ClassVar[str] = (
        "T + share (T_then - T) exp(-t / relaxation_time), T_then the time gap when the leader appeared, t since then"
    )
    source: ClassVar[str] = "after Laval & Leclercq, Transp. Res. B 42 (2008) 511; Keane & Gao, ibid. 150 (2021) 301"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "share", "-", "share of the difference to the present time gap", off=0.0, low=0.0, high=1.0, scale=0.5
        ),
        Parameter(
            "relaxation_time",
            "s",
            "relaxation time of the difference",
            off=15.0,
            low=1.0,
            high=120.0,
            scale=10.0,
            is_strength=False,
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> FirstGap:
        """The gap at the start."""
        zero = jnp.zeros_like(seen.speed)
        return FirstGap(
            time_gap=_present_time_gap(seen, driver),
            elapsed=zero,
            had_leader=zero + seen.has_leader,
            time_since_change=zero + seen.time_since_change,
        )

    def remember(self, memory: FirstGap, seen: Stimulus, driver: CarFollowing, dt: float) -> FirstGap:
        """Memory of the gap to a new leader, or else of the gap to the present leader."""
        is_new = (seen.has_leader > memory.had_leader) | (seen.time_since_change < memory.time_since_change)
        return FirstGap(
            time_gap=jnp.where(is_new, _present_time_gap(seen, driver), memory.time_gap),
            elapsed=jnp.where(is_new, 0.0, memory.elapsed + dt),
            had_leader=jnp.zeros_like(seen.speed) + seen.has_leader,
            time_since_change=jnp.zeros_like(seen.speed) + seen.time_since_change,
        )

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: FirstGap) -> Float[Array, "*n"]:
        """Time gap between the present and the desired one."""
        return value + self.share * seen.has_leader * (memory.time_gap - value) * jnp.exp(
            -memory.elapsed / self.relaxation_time
        )


def _present_time_gap(seen: Stimulus, driver: CarFollowing) -> Float[Array, "*n"]:
    """Time gap with which the present gap would be the desired gap [s]."""
    return jnp.clip((seen.gap - driver.jam_gap) / jnp.maximum(seen.speed, SLOWEST), *TIME_GAPS)
