"""Random effects: noise of the acceleration, of perceived distances and speeds, and of the time gap."""

from dataclasses import field, replace
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.randomness import no_seed, standard_normal
from rearl_jax.core.effects.stimulus import Stimulus


class Fluctuation(eqx.Module):
    """Ornstein-Uhlenbeck processes of variance 1, one per vehicle.

    Attributes:
        count: Time steps so far.
        value: Present values [-].
    """

    count: Int[Array, ""]
    value: Float[Array, "vehicles *scenarios"]


def begin_fluctuation(
    seed: Int[Array, "*#seeds"], stream: int, like: Float[Array, "vehicles *scenarios"]
) -> Fluctuation:
    """Processes in their stationary state; arguments as in `standard_normal`."""
    count = jnp.zeros((), jnp.int32)
    return Fluctuation(count, standard_normal(seed, stream, count, like))


def fluctuate(
    before: Fluctuation, seed: Int[Array, "*#seeds"], stream: int, time: Float[Array, "*#n"], dt: float
) -> Fluctuation:
    """The processes one time step later, exact for time steps of any length.

    Args:
        before: The processes.
        seed: One per scenario, or one for all.
        stream: The stream given to `begin_fluctuation`.
        time: Correlation time [s].
        dt: Time since the last call [s].

    Source: Gillespie, Phys. Rev. E 54 (1996) 2084 (exact update of the process).
    """
    decay = jnp.exp(-dt / time)
    count = before.count + 1
    drawn = standard_normal(seed, stream, count, before.value)
    return Fluctuation(count, before.value * decay + jnp.sqrt(1 - decay * decay) * drawn)


class AccelerationNoise(Effect):
    """Drivers accelerate a little more or less than they intend, by an error that is correlated in time."""

    sd: Float[Array, "*#n"]
    time: Float[Array, "*#n"]
    seed: Int[Array, "*#seeds"] = field(default_factory=no_seed)

    name: ClassVar[str] = "acceleration_noise"
    kind: ClassVar[str] = "random"
    equation: ClassVar[str] = "a + sd w, w an Ornstein-Uhlenbeck process of variance 1 and correlation time `time`"
    source: ClassVar[str] = (
        "Treiber, Kesting & Helbing, Physica A 360 (2006) 71; Laval, Toth & Zhou, Transp. Res. B 70 (2014) 228"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sd", "m/s^2", "standard deviation of the noise", off=0.0, low=0.0, high=3.0, scale=0.2),
        Parameter(
            "time", "s", "correlation time of the noise", off=1.5, low=0.05, high=60.0, scale=1.0, is_strength=False
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> Fluctuation:
        """The noise at the start."""
        return begin_fluctuation(self.seed, 0, seen.speed)

    def remember(self, memory: Fluctuation, seen: Stimulus, driver: CarFollowing, dt: float) -> Fluctuation:
        """The noise in this time step."""
        return fluctuate(memory, self.seed, 0, self.time, dt)

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: Fluctuation) -> Float[Array, "*n"]:
        """The acceleration with the noise added."""
        return value + self.sd * memory.value


class PerceptionNoise(Effect):
    """Drivers misjudge gaps and approach rates in proportion to the gap, by errors that are correlated in time."""

    gap_error: Float[Array, "*#n"]
    rate_error: Float[Array, "*#n"]
    time: Float[Array, "*#n"]
    seed: Int[Array, "*#seeds"] = field(default_factory=no_seed)

    name: ClassVar[str] = "perception_noise"
    kind: ClassVar[str] = "random"
    equation: ClassVar[str] = (
        "s -> s exp(gap_error w1), dv -> dv + rate_error s w2, w Ornstein-Uhlenbeck processes of variance 1"
    )
    source: ClassVar[str] = "Treiber, Kesting & Helbing, Physica A 360 (2006) 71 (human driver model)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gap_error", "-", "relative error of the gap", off=0.0, low=0.0, high=0.5, scale=0.05),
        Parameter("rate_error", "1/s", "error of the approach rate per gap", off=0.0, low=0.0, high=0.1, scale=0.01),
        Parameter(
            "time", "s", "correlation time of both", off=20.0, low=0.05, high=120.0, scale=10.0, is_strength=False
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> tuple[Fluctuation, Fluctuation]:
        """The errors at the start."""
        gap = begin_fluctuation(self.seed, 1, seen.speed)
        return gap, begin_fluctuation(self.seed, 2, seen.speed)

    def remember(
        self, memory: tuple[Fluctuation, Fluctuation], seen: Stimulus, driver: CarFollowing, dt: float
    ) -> tuple[Fluctuation, Fluctuation]:
        """The errors in this time step."""
        gap = fluctuate(memory[0], self.seed, 1, self.time, dt)
        return gap, fluctuate(memory[1], self.seed, 2, self.time, dt)

    def perceive(self, seen: Stimulus, memory: tuple[Fluctuation, Fluctuation]) -> Stimulus:
        """The stimulus with the misjudged gap and leader's speed."""
        gap = seen.gap * jnp.exp(self.gap_error * memory[0].value)
        leader_speed = seen.leader_speed - self.rate_error * seen.gap * seen.has_leader * memory[1].value
        return replace(seen, gap=gap, leader_speed=leader_speed)


LARGEST_DEPARTURE = 1.2
"""Largest difference of log T from the driver's usual value that counts as a variation [-]; with larger gaps a driver
does not follow.
"""

SLOWEST_FOLLOWING = 3.0
"""Smallest speed [m/s] by which a gap is divided for a time gap."""


def time_gap_departure(
    gap: Float[Any, "*#n"], speed: Float[Any, "*#n"], time_gap: Float[Any, "*#n"], jam_gap: Float[Any, "*#n"]
) -> Float[Array, "*n"]:
    """Logarithm of the ratio of the present time gap to `time_gap` [-]; 0 for drivers who do not follow."""
    present = jnp.maximum(gap - jam_gap, 0.1) / jnp.maximum(speed, SLOWEST_FOLLOWING)
    departure = jnp.log(present / time_gap)
    return jnp.where(departure > LARGEST_DEPARTURE, 0.0, jnp.maximum(departure, -LARGEST_DEPARTURE))


class TimeGapVariation(Effect):
    """Drivers keep a longer time gap for a while, and then a shorter one."""

    sd: Float[Array, "*#n"]
    time: Float[Array, "*#n"]
    start_share: Float[Array, "*#n"]
    seed: Int[Array, "*#seeds"] = field(default_factory=no_seed)

    name: ClassVar[str] = "time_gap_variation"
    kind: ClassVar[str] = "random"
    equation: ClassVar[str] = (
        "T exp(sd w), w an Ornstein-Uhlenbeck process of variance 1 and correlation time `time`, which begins at "
        "start_share log(T_start / T) / sd on average, T_start the time gap at the start"
    )
    source: ClassVar[str] = (
        "after Wagner, Transp. Res. B 46 (2012) 1384; Tian, Treiber, Ma, Jia & Zhang, ibid. 71 (2015) 59 (time gaps "
        "that vary within a driver)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("sd", "-", "standard deviation of log T", off=0.0, low=0.0, high=1.5, scale=0.2),
        Parameter(
            "time",
            "s",
            "correlation time of the variation",
            off=20.0,
            low=0.05,
            high=120.0,
            scale=10.0,
            is_strength=False,
        ),
        Parameter(
            "start_share",
            "-",
            "share of the difference of log T at the start that is variation",
            off=0.0,
            low=0.0,
            high=1.0,
            scale=0.5,
            is_strength=False,
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> Fluctuation:
        """The variation at the start, given the time gap at the start.

        Source: mean and variance of one of two normal variables given their sum.
        """
        drawn = begin_fluctuation(self.seed, 3, seen.speed)
        departure = seen.has_leader * time_gap_departure(seen.gap, seen.speed, driver.time_gap, driver.jam_gap)
        mean = self.start_share * departure / jnp.maximum(self.sd, 1e-6)
        is_drawn = self.start_share < 1  # the square root has no derivative at 0
        drawn_share = jnp.where(is_drawn, jnp.sqrt(jnp.where(is_drawn, 1 - self.start_share, 1.0)), 0.0)
        return replace(drawn, value=mean + drawn_share * drawn.value)

    def remember(self, memory: Fluctuation, seen: Stimulus, driver: CarFollowing, dt: float) -> Fluctuation:
        """The variation in this time step."""
        return fluctuate(memory, self.seed, 3, self.time, dt)

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: Fluctuation) -> Float[Array, "*n"]:
        """Time gap with its variation."""
        return value * jnp.exp(self.sd * memory.value)
