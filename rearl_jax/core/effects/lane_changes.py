"""Effects on lane choice: gains of a lane change in addition to the own acceleration.

`incentive` receives and returns the gain of a change to one side [m/s^2], which is compared with the driver's
threshold.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.anticipation import PASSING_SPEED
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.side_lane import SideLane
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.effects.time_gaps import PRESSING_TIME_GAP, pressure_from_behind


class KeepRight(Effect):
    """Drivers go back to the right lane."""

    bias: Float[Array, "*#n"]

    name: ClassVar[str] = "keep_right"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = "gain of the right lane + bias, gain of the left lane - bias"
    source: ClassVar[str] = "Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86 (asymmetric rules)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("bias", "m/s^2", "bias towards the right lane", off=0.0, low=-2.0, high=2.0, scale=0.3),
    )

    def incentive(self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Gain, larger to the right and smaller to the left."""
        return value + side.direction * self.bias


class NoPassingOnTheRight(Effect):
    """Drivers do not change to the right lane to pass a slower leader."""

    weight: Float[Array, "*#n"]

    name: ClassVar[str] = "no_passing_on_the_right"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = "gain of the right lane - weight max(0, gain) above 60 km/h; weight 1 forbids it"
    source: ClassVar[str] = "Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86 (European passing rule)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weight", "-", "share of the gain that is ignored", off=0.0, low=0.0, high=1.0, scale=0.5),
    )

    def incentive(self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Gain, smaller to the right if it is positive there."""
        if side.direction < 0:
            return value
        return value - self.weight * jnp.where(seen.speed > PASSING_SPEED, jnp.maximum(value, 0.0), 0.0)


class Politeness(Effect):
    """Drivers consider what a lane change costs the vehicles behind."""

    weight: Float[Array, "*#n"]

    name: ClassVar[str] = "politeness"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = "gain of a change + weight (sum of the gains of the followers on both lanes)"
    source: ClassVar[str] = "Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86 (politeness)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weight", "-", "weight of the followers' gain", off=0.0, low=-0.5, high=2.0, scale=0.3),
    )

    def incentive(self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Gain plus the weighted gain of the followers."""
        return value + self.weight * side.gain_of_others


class MovingOver(Effect):
    """A close follower makes the driver go to the right."""

    gain: Float[Array, "*#n"]
    pressing_time_gap: Float[Array, "*#n"]

    name: ClassVar[str] = "moving_over"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "gain of the right lane + gain / (1 + exp((z - z0) / 0.25 s)), z the follower's time gap, z0 pressing_time_gap"
    )
    source: ClassVar[str] = "form of this project, as in the effect rear_pressure on the time gap"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "m/s^2", "gain of giving way under pressure", off=0.0, low=-1.0, high=3.0, scale=0.5),
        PRESSING_TIME_GAP,
    )

    def incentive(self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Gain, larger to the right under pressure."""
        if side.direction < 0:
            return value
        return value + self.gain * seen.has_follower * pressure_from_behind(seen, self.pressing_time_gap)


class TruckAversion(Effect):
    """Drivers avoid following a truck by changing lanes."""

    gain: Float[Array, "*#n"]
    reach: Float[Array, "*#n"]

    name: ClassVar[str] = "truck_aversion"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "gain of a change + gain (exp(-s / reach) behind a truck on the driver's lane - the same on the adjacent lane)"
    )
    source: ClassVar[str] = (
        "form of this project; after Moridpour, Rose & Sarvi, J. Transp. Eng. 136 (2010) 973 (trucks and lanes)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "m/s^2", "gain of a lane without a truck", off=0.0, low=-2.0, high=3.0, scale=0.5),
        Parameter(
            "reach",
            "m",
            "gap at which this gain has fallen to 1/e",
            off=80.0,
            low=10.0,
            high=500.0,
            scale=50.0,
            is_strength=False,
        ),
    )

    def incentive(self, value: Float[Array, "*n"], side: SideLane, seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Gain, larger if the change leads away from a truck."""
        here = seen.has_leader * seen.leader_is_truck * jnp.exp(-seen.gap / self.reach)
        there = side.has_leader * side.leader_is_truck * jnp.exp(-side.gap / self.reach)
        return value + self.gain * (here - there)
