"""Early response to the next leader, before the lane column shows the lane change.

A lane column changes when a vehicle crosses the marking, seconds after the driver decided to change. In between, the
driver already follows the leader on the target lane, the new follower already follows the driver, and the old follower
already follows its next leader. This needs the future of a recording; in a simulation the effect `early_response`
represents the first two.
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
"""Standard deviation of the lead time between lane changes [s]; above 0, to keep the response differentiable."""


class RecordedStimulus(Stimulus):
    """Stimulus in a recording, with the next leader known.

    Attributes:
        time_to_next: Time until the next change of leader [s]; above LONGEST_LEAD without one.
        next_gap: Bumper-to-bumper gap to the next leader [m].
        next_speed: Speed of the next leader [m/s].
        next_by_own: Whether the leader changes because the driver itself changes lanes.
        next_is_nearer: Whether another vehicle cuts in between, without a lane change of the driver.
    """

    time_to_next: Float[Array, "*#n"]
    next_gap: Float[Array, "*#n"]
    next_speed: Float[Array, "*#n"]
    next_by_own: Float[Array, "*#n"]
    next_is_nearer: Float[Array, "*#n"]


class EarlyLeader(Effect):
    """Drivers respond to the next leader before the lane column shows the change; attributes as in `parameters`."""

    of_changer: Float[Array, "*#n"]
    of_follower: Float[Array, "*#n"]
    of_left: Float[Array, "*#n"]
    lead_time: Float[Array, "*#n"]

    name: ClassVar[str] = "early_leader"
    kind: ClassVar[str] = "lane_change"
    depends_on: ClassVar[tuple[str, ...]] = ("time_to_next",)
    equation: ClassVar[str] = (
        "I + w (I_next - I) in the last lead_time before the leader changes, I the deceleration because of the leader, "
        "w the weight for drivers who change lanes, who get a new leader, or whose leader leaves"
    )
    source: ClassVar[str] = "after Schakel, Knoop & van Arem, Transp. Res. Rec. 2316 (2012) 47 (synchronisation)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("of_changer", "-", "weight of the next leader for drivers who change lanes", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_follower", "-", "weight for drivers who get a new leader", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_left", "-", "weight for drivers whose leader leaves", 0.0, 0.0, 1.2, 0.5),
        Parameter("lead_time", "s", "time before the column changes", 1.5, 0.0, LONGEST_LEAD, 1.0, is_strength=False),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Weighted mean of the decelerations because of the present leader (`value`) and of the next one [m/s^2]; the
        weight follows from the probability that the driver already responds to the next one.
        """
        assert isinstance(seen, RecordedStimulus)
        of_others = seen.next_is_nearer * self.of_follower + (1 - seen.next_is_nearer) * self.of_left
        weight = seen.next_by_own * self.of_changer + (1 - seen.next_by_own) * of_others
        already = jax.nn.sigmoid((self.lead_time - seen.time_to_next) / SCATTER)
        already = jnp.where(seen.time_to_next < LONGEST_LEAD, already, 0.0)
        by_next = driver.interaction(seen.next_gap, seen.speed, seen.speed - seen.next_speed)
        # Nobody brakes harder than comfortable for a vehicle that is not the leader yet.
        bearable = driver.free_acceleration(seen.speed) + driver.comfortable_deceleration()
        return value + weight * already * (jnp.minimum(by_next, bearable) - value)
