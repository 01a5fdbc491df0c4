"""Time since the last change of leader, and the gap lost by it."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.order import NO_VEHICLE

NEVER_CHANGED = 60.0
"""Upper bound of the time since the last change of leader, also used if it never changed [s]."""

MOST_GAP_LOST = 60.0
"""Bound of the gap that is lost at once [m]."""

IN_SIGHT = 200.0
"""Gap [m] beyond which a new leader does not count as a change."""

TIME_GAPS = (0.25, 9.0)
"""Range of the time gap right after a change [s]; the upper end if there was no change."""

SLOWEST = 5.0
"""Lower bound of the speed in a time gap [m/s]."""


class LeaderHistory(eqx.Module):
    """Memory of each driver about the last change of its leader.

    Attributes:
        leader: Index of the present leader, NO_VEHICLE for none.
        gap: Bumper-to-bumper gap to the leader [m].
        time_since_change: Time since it became the leader [s].
        gap_lost: Gap lost by that change [m].
        time_gap: Time gap right after it [s].
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
            gap: Bumper-to-bumper gap to it [m].
        """
        nothing = jnp.zeros_like(gap)
        return cls(leader, gap, nothing + NEVER_CHANGED, nothing, nothing + TIME_GAPS[1])

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
            gap: Bumper-to-bumper gap to it [m].
            speed: Own speed [m/s].
            dt: Time step [s].
        """
        is_new = (leader != self.leader) & (leader != NO_VEHICLE)
        is_alone = leader == NO_VEHICLE
        is_near = jnp.minimum(self.gap, gap) < IN_SIGHT
        lost = jnp.where(is_near, jnp.clip(self.gap - gap, 0.0, MOST_GAP_LOST), 0.0)
        since = jnp.minimum(self.time_since_change + dt, NEVER_CHANGED)
        time_gap = jnp.clip(gap / jnp.maximum(speed, SLOWEST), *TIME_GAPS)
        return LeaderHistory(
            leader=leader,
            gap=gap,
            time_since_change=jnp.where(is_new, 0.0, jnp.where(is_alone, NEVER_CHANGED, since)),
            gap_lost=jnp.where(is_new, lost, jnp.where(is_alone, 0.0, self.gap_lost)),
            time_gap=jnp.where(is_new, time_gap, self.time_gap),
        )
