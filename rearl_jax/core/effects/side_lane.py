"""Stimulus of an adjacent lane, for drivers who may change lanes."""

import equinox as eqx
from jaxtyping import Array, Float


class SideLane(eqx.Module):
    """Stimulus of an adjacent lane, arrays over the vehicles; flags are 0 or 1.

    Without a vehicle, the gap is OUT_OF_SIGHT, the speed is the own speed, and the flag is 0.

    Attributes:
        direction: -1 for the lane on the left, +1 for that on the right.
        has_leader: Whether a vehicle is ahead on it.
        gap: Bumper-to-bumper gap to that vehicle [m].
        leader_speed: Speed of that vehicle [m/s].
        leader_is_truck: Whether it is a truck.
        has_follower: Whether a vehicle is behind on it.
        follower_gap: Bumper-to-bumper gap to that vehicle [m].
        follower_speed: Speed of that vehicle [m/s].
        gain_of_others: Gain of the followers on both lanes together by the change [m/s^2].
    """

    direction: int = eqx.field(static=True)
    has_leader: Float[Array, "*#n"]
    gap: Float[Array, "*#n"]
    leader_speed: Float[Array, "*#n"]
    leader_is_truck: Float[Array, "*#n"]
    has_follower: Float[Array, "*#n"]
    follower_gap: Float[Array, "*#n"]
    follower_speed: Float[Array, "*#n"]
    gain_of_others: Float[Array, "*#n"]
