"""Drivers who make room for others."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.gap_idm import FollowingParams, free_term, gap_interaction


class Cooperation(Effect):
    """The driver opens a gap for a vehicle on the lane beside that wants to come over, unless that is too hard."""

    weight: Float[Array, "*#n"]
    limit: Float[Array, "*#n"]

    name: ClassVar[str] = "cooperation"
    kind: ClassVar[str] = "lane_change"
    equation: ClassVar[str] = (
        "(s*/s)^2 + weight max(0, min((s*_e / s_e)^2, what makes a = -limit) - (s*/s)^2), e who wants to come over"
    )
    source: ClassVar[str] = "after Hidas, Transp. Res. C 10 (2002) 351 (courtesy lane changes)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weight", "-", "how far a gap is opened", off=0.0, low=0.0, high=1.0, scale=0.5),
        Parameter("limit", "m/s^2", "hardest braking for it", 2.0, 0.2, 6.0, 1.0, is_strength=False),
    )

    def interaction(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, params: FollowingParams
    ) -> Float[Array, "*n"]:
        """More, where somebody wants to come over.

        Raises:
            ValueError: The stimulus is that of a recording.
        """
        if not isinstance(seen, SimulatedStimulus):
            raise ValueError("cooperation needs to know who wants to change lanes, which only a simulation does")
        closing = seen.speed - seen.entrant_speed
        wanted = gap_interaction(seen.entrant_gap, seen.speed, closing, params)
        bearable = 1 - free_term(seen.speed, params.desired_speed) + self.limit / params.max_accel
        more = jnp.maximum(jnp.minimum(wanted, bearable) - value, 0.0)
        return value + self.weight * seen.has_entrant * more
