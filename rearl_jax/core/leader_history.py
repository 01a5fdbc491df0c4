"""Time since the last change of leader, and the gap lost by it."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.order import NO_VEHICLE

MAX_TIME_SINCE_CHANGE = 60.0
"""Upper bound of the time since the last change of leader, also used if the leader never changed [s]."""

MAX_GAP_LOST = 60.0
"""Upper bound of the gap lost by a change of leader [m]."""

MAX_GAP_IN_SIGHT = 200.0
"""Gap [m] from which on no gap counts as lost, if the gaps before and after the change both reach it."""

TIME_GAP_RANGE = (0.25, 9.0)
"""Range of the time gap right after a change of leader [s]; the upper end if there was no change."""

MIN_SPEED = 5.0
"""Lower bound of the speed that a gap is divided by for a time gap [m/s]."""


class LeaderHistory(eqx.Module):
    """Memory of each driver about the last change of leader.

    Attributes:
        leader: Index of the present leader, NO_VEHICLE for none.
        gap: Bumper-to-bumper gap to the leader [m].
        time_since_change: Time since this vehicle became the leader [s].
        gap_lost: Gap lost by that change [m].
        time_gap: Time gap right after that change [s].
    """

    leader: Int[Array, "vehicles *scenarios"]
    gap: Float[Array, "vehicles *scenarios"]
    time_since_change: Float[Array, "vehicles *scenarios"]
    gap_lost: Float[Array, "vehicles *scenarios"]
    time_gap: Float[Array, "vehicles *scenarios"]

    @classmethod
    def begin(
        cls, leader: Int[Array, "vehicles *scenarios"], gap: Float[Array, "vehicles *scenarios"]
    ) -> "LeaderHistory":
        """The history at the start, as if the leader had never changed.

        Args:
            leader: Index of each vehicle's leader, NO_VEHICLE for none.
            gap: Bumper-to-bumper gap to the leader [m].
        """
        nothing = jnp.zeros_like(gap)
        return cls(leader, gap, nothing + MAX_TIME_SINCE_CHANGE, nothing, nothing + TIME_GAP_RANGE[1])

    def update(
        self,
        leader: Int[Array, "vehicles *scenarios"],
        gap: Float[Array, "vehicles *scenarios"],
        speed: Float[Array, "vehicles *scenarios"],
        dt: float,
    ) -> "LeaderHistory":
        """The history one time step later.

        Args:
            leader: Index of the present leader.
            gap: Bumper-to-bumper gap to the leader [m].
            speed: Own speed [m/s].
            dt: Time step [s].
        """
        is_new = (leader != self.leader) & (leader != NO_VEHICLE)
        is_alone = leader == NO_VEHICLE
        is_in_sight = jnp.minimum(self.gap, gap) < MAX_GAP_IN_SIGHT
        lost = jnp.where(is_in_sight, jnp.clip(self.gap - gap, 0.0, MAX_GAP_LOST), 0.0)
        since = jnp.minimum(self.time_since_change + dt, MAX_TIME_SINCE_CHANGE)
        time_gap = jnp.clip(gap / jnp.maximum(speed, MIN_SPEED), *TIME_GAP_RANGE)
        return LeaderHistory(
            leader=leader,
            gap=gap,
            time_since_change=jnp.where(is_new, 0.0, jnp.where(is_alone, MAX_TIME_SINCE_CHANGE, since)),
            gap_lost=jnp.where(is_new, lost, jnp.where(is_alone, 0.0, self.gap_lost)),
            time_gap=jnp.where(is_new, time_gap, self.time_gap),
        )
