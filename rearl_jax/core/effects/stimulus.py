"""Stimulus of a driver: own motion, surrounding vehicles, position and time."""

import equinox as eqx
from jaxtyping import Array, Float

OUT_OF_SIGHT = 1000.0
"""Gap [m] without a vehicle ahead; finite, so that it can be interpolated and differentiated."""


class Stimulus(eqx.Module):
    """Stimulus of each driver in one time step, arrays over the vehicles; flags are 0 or 1.

    Without a vehicle, the gap is OUT_OF_SIGHT, the speed is the own speed, the acceleration is 0, and the flag is 0.

    Attributes:
        time: Time since the start [s].
        position: Position of the own centre along the road [m].
        lane: Lane of the driver, 0 = leftmost [-].
        is_leftmost, is_rightmost: Whether there is no further lane on that side.
        lateral_offset: Distance from the centre of the lane [m], positive to the right.
        speed: Own speed v [m/s].
        length: Own length [m].
        is_truck: Whether the own vehicle is a truck.
        has_leader: Whether a vehicle is ahead on the lane.
        gap: To the leader, bumper to bumper, s [m].
        leader_speed: Speed of the leader [m/s].
        leader_acceleration: Acceleration of the leader [m/s^2].
        leader_length: Length of the leader [m].
        leader_is_truck: Whether the leader is a truck.
        has_second, second_gap, second_speed: The leader's leader; the gap is the sum of both gaps, lengths left out.
        has_third, third_speed: The third vehicle ahead.
        has_follower, follower_gap, follower_speed: The vehicle behind on the lane.
        has_left, left_gap, left_speed: The next vehicle ahead on the lane to the left.
        beside_speed: Slowest speed within BESIDE_RANGE on the lanes next to the own [m/s]; OUT_OF_SIGHT if none.
        n_beside: Number of these vehicles.
        time_since_change: Time since the leader last changed because of a lane change [s].
        gap_lost: Gap lost by that change [m]; 0 if the gap grew.
        time_gap_at_change: Time gap right after it [s].
    """

    time: Float[Array, "*#n"]
    position: Float[Array, "*#n"]
    lane: Float[Array, "*#n"]
    is_leftmost: Float[Array, "*#n"]
    is_rightmost: Float[Array, "*#n"]
    lateral_offset: Float[Array, "*#n"]
    speed: Float[Array, "*#n"]
    length: Float[Array, "*#n"]
    is_truck: Float[Array, "*#n"]
    has_leader: Float[Array, "*#n"]
    gap: Float[Array, "*#n"]
    leader_speed: Float[Array, "*#n"]
    leader_acceleration: Float[Array, "*#n"]
    leader_length: Float[Array, "*#n"]
    leader_is_truck: Float[Array, "*#n"]
    has_second: Float[Array, "*#n"]
    second_gap: Float[Array, "*#n"]
    second_speed: Float[Array, "*#n"]
    has_third: Float[Array, "*#n"]
    third_speed: Float[Array, "*#n"]
    has_follower: Float[Array, "*#n"]
    follower_gap: Float[Array, "*#n"]
    follower_speed: Float[Array, "*#n"]
    has_left: Float[Array, "*#n"]
    left_gap: Float[Array, "*#n"]
    left_speed: Float[Array, "*#n"]
    beside_speed: Float[Array, "*#n"]
    n_beside: Float[Array, "*#n"]
    time_since_change: Float[Array, "*#n"]
    gap_lost: Float[Array, "*#n"]
    time_gap_at_change: Float[Array, "*#n"]


BESIDE_RANGE = 40.0
"""Distance along the road [m] within which a vehicle on an adjacent lane counts as beside."""
