"""The leader that a recording will show next: drivers follow it before the lane column says so.

A lane column flips where a vehicle crosses the marking, seconds after the change was decided. From then on the driver
follows the leader of the lane it goes to, who will be behind it has made it its leader, and who was behind it has
another one already. Only a recording knows what comes; in a simulation `early_response` stands for the first two.
"""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.read.next_leaders import LONGEST_LEAD

SCATTER = 0.4
"""Scatter of the lead time between changes [s]; own choice, which keeps the response differentiable."""


class RecordedStimulus(Stimulus):
    """Stimulus in a recording, which knows who will be the leader next.

    Attributes:
        time_to_next: Time until somebody else is the leader [s]; beyond LONGEST_LEAD for nobody.
        next_gap: To whoever is it then, bumper to bumper [m].
        next_speed: Its speed [m/s].
        next_by_own: Whether it is the driver who changes lanes.
        next_is_nearer: Whether somebody comes in between, without a lane change of the driver.
    """

    time_to_next: Float[Array, "*#n"]
    next_gap: Float[Array, "*#n"]
    next_speed: Float[Array, "*#n"]
    next_by_own: Float[Array, "*#n"]
    next_is_nearer: Float[Array, "*#n"]


class EarlyLeader(Effect):
    """Drivers answer to the next leader before the lane column shows it."""

    of_changer: Float[Array, "*#n"]
    of_follower: Float[Array, "*#n"]
    of_left: Float[Array, "*#n"]
    lead_time: Float[Array, "*#n"]

    name: ClassVar[str] = "early_leader"
    kind: ClassVar[str] = "lane_change"
    depends_on: ClassVar[tuple[str, ...]] = ("time_to_next",)
    equation: ClassVar[str] = (
        "I + w (I_next - I) in the last lead_time before the leader changes, I the deceleration because of the leader, "
        "w that of who changes lanes, of who gets a new leader, or of whose leader leaves"
    )
    source: ClassVar[str] = "after Schakel, Knoop & van Arem, Transp. Res. Rec. 2316 (2012) 47 (synchronisation)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("of_changer", "-", "weight of the next leader for who changes lanes", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_follower", "-", "the same for who gets a new leader", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_left", "-", "the same for whose leader leaves", 0.0, 0.0, 1.2, 0.5),
        Parameter("lead_time", "s", "time before the column flips", 1.5, 0.0, LONGEST_LEAD, 1.0, is_strength=False),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """That because of the next leader, the more the surer it is one already."""
        assert isinstance(seen, RecordedStimulus)
        of_others = seen.next_is_nearer * self.of_follower + (1 - seen.next_is_nearer) * self.of_left
        weight = seen.next_by_own * self.of_changer + (1 - seen.next_by_own) * of_others
        early = jax.nn.sigmoid((self.lead_time - seen.time_to_next) / SCATTER)
        early = jnp.where(seen.time_to_next < LONGEST_LEAD, early, 0.0)
        there = driver.interaction(seen.next_gap, seen.speed, seen.speed - seen.next_speed)
        bearable = driver.free_acceleration(seen.speed) + driver.comfortable_deceleration()
        return value + weight * early * (jnp.minimum(there, bearable) - value)
