"""Early response to a lane change: the lane changer and its new follower respond before the change of lane."""

from typing import ClassVar

from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.anticipation import interaction_increase
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.intentions import require_intentions
from rearl_jax.core.effects.stimulus import Stimulus


class EarlyResponse(Effect):
    """Before it has left its lane, a lane changer responds to its new leader, and its new follower to it."""

    of_changer: Float[Array, "*#n"]
    of_follower: Float[Array, "*#n"]
    limit: Float[Array, "*#n"]

    name: ClassVar[str] = "early_response"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "I + of_changer max(0, min(I_new, a_free + limit) - I), I and I_new the interaction decelerations behind the "
        "leader and behind the new leader, on the lane the driver wants to change to; then the same with of_follower "
        "behind a vehicle changing to the driver's lane; the acceleration is a_free - I"
    )
    source: ClassVar[str] = (
        "after Schakel, Knoop & van Arem, Transp. Res. Rec. 2316 (2012) 47 (synchronisation and gap creation)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "of_changer",
            "-",
            "how strongly a lane changer responds to its new leader",
            off=0.0,
            low=0.0,
            high=1.0,
            scale=0.5,
        ),
        Parameter(
            "of_follower",
            "-",
            "how strongly a new follower responds to the lane changer",
            off=0.0,
            low=0.0,
            high=1.0,
            scale=0.5,
        ),
        Parameter(
            "limit",
            "m/s^2",
            "largest deceleration of the lane changer and of its new follower in this response",
            off=2.0,
            low=0.2,
            high=9.0,
            scale=1.0,
            is_strength=False,
        ),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Interaction deceleration [m/s^2]: `value`, increased if a vehicle on another lane will become the leader.

        Raises:
            ValueError: The stimulus is that of a recording.
        """
        seen = require_intentions(seen, self.name)
        new_leader = seen.new_leader_gap, seen.speed, seen.new_leader_speed
        increase = interaction_increase(value, *new_leader, driver, self.limit)
        value = value + self.of_changer * seen.has_new_leader * increase
        increase = interaction_increase(value, seen.changer_gap, seen.speed, seen.changer_speed, driver, self.limit)
        return value + self.of_follower * seen.has_changer * increase
