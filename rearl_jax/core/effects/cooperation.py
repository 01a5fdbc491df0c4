"""Cooperation: drivers open a gap for a lane change of another vehicle."""

from typing import ClassVar

from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.anticipation import interaction_increase
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.intentions import require_intentions
from rearl_jax.core.effects.stimulus import Stimulus


class Cooperation(Effect):
    """The driver opens a gap for a vehicle that wants to change to the driver's lane, without hard braking."""

    weight: Float[Array, "*#n"]
    limit: Float[Array, "*#n"]

    name: ClassVar[str] = "cooperation"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "I + weight max(0, min(I_e, a_free + limit) - I), I and I_e the interaction decelerations behind the leader "
        "and behind the vehicle that wants to change to the driver's lane; the acceleration is a_free - I"
    )
    source: ClassVar[str] = "after Hidas, Transp. Res. C 10 (2002) 351 (courtesy lane changes)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "weight", "-", "weight of the vehicle that wants to change lanes", off=0.0, low=0.0, high=1.0, scale=0.5
        ),
        Parameter(
            "limit",
            "m/s^2",
            "largest deceleration the driver accepts to let the other vehicle in",
            off=2.0,
            low=0.2,
            high=6.0,
            scale=1.0,
            is_strength=False,
        ),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Interaction deceleration [m/s^2]: `value`, increased if a vehicle wants to change to the driver's lane.

        Raises:
            ValueError: The stimulus is that of a recording.
        """
        seen = require_intentions(seen, self.name)
        increase = interaction_increase(value, seen.entrant_gap, seen.speed, seen.entrant_speed, driver, self.limit)
        return value + self.weight * seen.has_entrant * increase
