"""Response to the next leader before the lane column shows a lane change, and to the former leader after it.

A lane column changes when a vehicle crosses the marking, seconds after the driver decided to change, and seconds before
its vehicle has left the old lane. If lateral positions are recorded, the beginning of the sideways motion shows when
the change began, and lead times count from there; otherwise from the change of the column. Before, the driver already
follows the leader on the target lane, the new follower already follows the driver, and the old follower may already
follow its next leader. After, driver and old follower still avoid the leader that they had, until the vehicles no
longer overlap laterally. The first needs the future of a recording; in a simulation the effect `early_response`
represents it for changing drivers and new followers.
"""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.discovery.read.sideways_motion import LONGEST_LEAD


class RecordedStimulus(Stimulus):
    """Stimulus in a recording, with the next and the former leader known.

    Attributes:
        time_to_next: Time until the lane change begins that gives the driver its next leader [s], negative after its
            beginning; until the leader changes if the beginning is unknown; above LONGEST_LEAD if there is none.
        next_gap: Bumper-to-bumper gap to the next leader [m].
        next_speed: Speed of the next leader [m/s].
        next_by_own: Whether the leader changes because the driver itself changes lanes.
        next_is_nearer: Whether another vehicle cuts in between, without a lane change of the driver.
        former_gap: Bumper-to-bumper gap to the leader before the last change [m]; far away if it was long ago.
        former_speed: Speed of this leader [m/s].
    """

    time_to_next: Float[Array, "*#n"]
    next_gap: Float[Array, "*#n"]
    next_speed: Float[Array, "*#n"]
    next_by_own: Float[Array, "*#n"]
    next_is_nearer: Float[Array, "*#n"]
    former_gap: Float[Array, "*#n"]
    former_speed: Float[Array, "*#n"]


class EarlyLeader(Effect):
    """Drivers respond to the next leader before the lane column shows the change, and to the former one for a while
    after it; attributes as in `parameters`.
    """

    of_changer: Float[Array, "*#n"]
    of_follower: Float[Array, "*#n"]
    of_left: Float[Array, "*#n"]
    lead_time: Float[Array, "*#n"]
    of_former: Float[Array, "*#n"]
    release_time: Float[Array, "*#n"]
    braking_limit: Float[Array, "*#n"]
    scatter: Float[Array, "*#n"]

    name: ClassVar[str] = "early_leader"
    kind: ClassVar[str] = "lane_change"
    depends_on: ClassVar[tuple[str, ...]] = ("time_to_next", "time_since_change")
    equation: ClassVar[str] = (
        "I + w (I_next - I) from lead_time before the lane change begins, I the deceleration because of the leader, "
        "w the weight for drivers who change lanes, who get a new leader, or whose leader leaves; "
        "I + of_former max(I_former - I, 0) in the first release_time after the change; "
        "I_next and I_former at most the deceleration of a driver who brakes at braking_limit"
    )
    source: ClassVar[str] = "after Schakel, Knoop & van Arem, Transp. Res. Rec. 2316 (2012) 47 (synchronisation)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("of_changer", "-", "weight of the next leader for drivers who change lanes", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_follower", "-", "weight for drivers who get a new leader", 0.0, 0.0, 1.2, 0.5),
        Parameter("of_left", "-", "weight for drivers whose leader leaves", 0.0, 0.0, 1.2, 0.5),
        Parameter(
            "lead_time",
            "s",
            "time before the lane change begins, or before the column changes if its beginning is unknown",
            1.0,
            -2.0,
            LONGEST_LEAD,
            1.0,
            is_strength=False,
        ),
        Parameter("of_former", "-", "weight of the former leader", 0.0, 0.0, 1.2, 0.5),
        Parameter("release_time", "s", "time after the column changed", 1.0, 0.0, LONGEST_LEAD, 0.5, is_strength=False),
        Parameter("braking_limit", "m/s^2", "most braking for another vehicle", 2.0, 0.2, 9.0, 2.0, is_strength=False),
        Parameter("scatter", "s", "scatter of both times between lane changes", 0.4, 0.1, 1.0, 0.3, is_strength=False),
    )

    def leaders(
        self, value: Float[Array, "*n"], seen: Stimulus, memory: None, driver: CarFollowing
    ) -> Float[Array, "*n"]:
        """Deceleration because of leaders [m/s^2]: the weighted mean of those because of the present leader (`value`)
        and of the next one, and a share of what the former one demands beyond it. Weights follow from the probability
        that the driver already responds to the next one, and still to the former one.
        """
        assert isinstance(seen, RecordedStimulus)
        # Drivers brake less for a vehicle that is not yet, or no longer, the leader.
        bearable = driver.free_acceleration(seen.speed) + self.braking_limit

        def because_of(gap: Float[Array, "*#n"], speed: Float[Array, "*#n"]) -> Float[Array, "*n"]:
            return jnp.minimum(driver.interaction(gap, seen.speed, seen.speed - speed), bearable)

        of_others = seen.next_is_nearer * self.of_follower + (1 - seen.next_is_nearer) * self.of_left
        weight = seen.next_by_own * self.of_changer + (1 - seen.next_by_own) * of_others
        already = self._within(self.lead_time, seen.time_to_next)
        still = self._within(self.release_time, seen.time_since_change)
        early = value + weight * already * (because_of(seen.next_gap, seen.next_speed) - value)
        beyond = jnp.maximum(because_of(seen.former_gap, seen.former_speed) - value, 0.0)
        return early + self.of_former * still * beyond

    def _within(self, reach: Float[Array, "*#n"], time: Float[Array, "*#n"]) -> Float[Array, "*n"]:
        """Probability that a time to or since a lane change [s] is within a reach that scatters between changes."""
        return jnp.where(time < LONGEST_LEAD, jax.nn.sigmoid((reach - time) / self.scatter), 0.0)
