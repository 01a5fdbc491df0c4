"""Drivers who respond to a lane change before the vehicle has left its lane: the changing and the following driver."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.effects.stimulus import Stimulus


class EarlyResponse(Effect):
    """Before a lane change the driver reacts to the new leader, and the new follower to the driver."""

    of_changer: Float[Array, "*#n"]
    of_follower: Float[Array, "*#n"]
    limit: Float[Array, "*#n"]

    name: ClassVar[str] = "early_response"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "I + of_changer max(0, min(I_there, a_free + limit) - I), I the deceleration because of the leader, I_there "
        "that because of the leader on the lane it wants to be on; of_follower likewise for the vehicle changing to "
        "the own lane"
    )
    source: ClassVar[str] = (
        "after Schakel, Knoop & van Arem, Transp. Res. Rec. 2316 (2012) 47 (synchronisation and gap creation)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("of_changer", "-", "weight of the leader on the wanted lane", off=0.0, low=0.0, high=1.0, scale=0.5),
        Parameter(
            "of_follower", "-", "weight of the vehicle changing to the own lane", off=0.0, low=0.0, high=1.0, scale=0.5
        ),
        Parameter("limit", "m/s^2", "largest deceleration for either", 2.0, 0.2, 6.0, 1.0, is_strength=False),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Deceleration, larger if a vehicle on another lane is about to become the leader.

        Raises:
            ValueError: The stimulus is that of a recording.
        """
        if not isinstance(seen, SimulatedStimulus):
            raise ValueError(
                "early_response needs to know which vehicles want to change lanes, which only a simulation does"
            )
        bearable = driver.free_acceleration(seen.speed) + self.limit
        there = driver.interaction(seen.wanted_gap, seen.speed, seen.speed - seen.wanted_speed)
        value = value + self.of_changer * seen.has_wanted * jnp.maximum(jnp.minimum(there, bearable) - value, 0.0)
        coming = driver.interaction(seen.changer_gap, seen.speed, seen.speed - seen.changer_speed)
        return value + self.of_follower * seen.has_changer * jnp.maximum(jnp.minimum(coming, bearable) - value, 0.0)
