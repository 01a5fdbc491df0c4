"""Lanes compared by car following on the gap between bumpers, and what effects make of a change.

The rules are those of `rearl_jax.core.mobil`: the deciding driver's parameters stand in for everybody's.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.lane_search import Neighbour, Traits, bumper_gap, find_ahead, find_behind, nobody
from rearl_jax.core.mobil import Prospects, is_due, is_moving, is_reachable, is_unsafe, lane_gains
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import View
from rearl_jax.core.state import TrafficState
from rearl_jax.core.stimuli import side_lane

Gains = tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]
"""What a change to the left and to the right gains [m/s^2]."""


class Outlook(eqx.Module):
    """What drivers see and want in this time step.

    Attributes:
        traits: What can be seen of each vehicle, its desired speed of this moment included.
        leader: The next vehicle ahead on the own lane.
        seen: What each driver sees.
        driver: Their car following, with wishes as the effects leave them at this moment.
        held: What each effect remembers.
    """

    traits: Traits
    leader: Neighbour
    seen: SimulatedStimulus
    driver: CarFollowing
    held: tuple[PyTree, ...]

    def behind(self, leader: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of each vehicle behind a leader [m/s^2]."""
        speed = self.traits.speed
        pull = self.driver.interaction(bumper_gap(leader, self.traits), speed, speed - leader.traits.speed)
        return self.driver.free_acceleration(speed) - jnp.where(leader.is_there, pull, 0.0)

    def of_follower(
        self, follower: Neighbour, gap: Float[Array, "vehicles *scenarios"], front: Neighbour | None = None
    ) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of each vehicle's follower [m/s^2], 0 without one.

        Args:
            follower: The follower.
            gap: Between it and whom it follows, bumper to bumper [m].
            front: Whom it follows; None for the vehicle itself.
        """
        its = follower.traits
        front_speed = self.traits.speed if front is None else front.traits.speed
        # The deciding driver's parameters stand in for the follower's, but for the speed it wants to drive at.
        stand_in = self.driver.with_wishes(its.desired_speed, self.driver.time_gap, self.driver.jam_gap)
        pull = stand_in.interaction(gap, its.speed, its.speed - front_speed)
        if front is not None:
            pull = jnp.where(front.is_there, pull, 0.0)
        return jnp.where(follower.is_there, stand_in.free_acceleration(its.speed) - pull, 0.0)

    def behind_me(self, follower: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """Acceleration of a follower behind the vehicle itself [m/s^2]."""
        return self.of_follower(follower, bumper_gap(follower, self.traits))

    def gain_of(self, follower: Neighbour, leader: Neighbour) -> Float[Array, "vehicles *scenarios"]:
        """What a follower gains by the vehicle between it and the leader [m/s^2]."""
        gap = bumper_gap(leader, self.traits) + self.traits.length + bumper_gap(follower, self.traits)
        return self.behind_me(follower) - self.of_follower(follower, gap, leader)


def compare_lanes(
    state: TrafficState, view: View, outlook: Outlook, drivers: Drivers, model: TrafficModel
) -> tuple[Prospects, Gains]:
    """Prospects of the lanes beside and the own one, and what changes gain once the effects have acted.

    Args:
        state: The traffic.
        view: What can be seen of it.
        outlook: What its drivers see and want.
        drivers: Parameters of all vehicles.
        model: The road.
    """
    due, traits = is_due(state, view, drivers), outlook.traits
    none = nobody(traits)

    def look(lane: Int[Array, "vehicles *scenarios"]) -> tuple[Neighbour, Neighbour]:
        (ahead,) = if_any(due, lambda: find_ahead(state, view, traits, lane, 1), (none,))
        return ahead, if_any(due, lambda: find_behind(state, view, traits, lane), none)

    freed = outlook.gain_of(look(view.lane)[1], outlook.leader)
    sides, leaders, followers = [], [], []
    for direction in (-1, +1):
        leader, follower = look(view.lane + direction)
        others = outlook.gain_of(follower, leader) - freed
        sides.append(side_lane(direction, leader, follower, others, traits))
        leaders.append(outlook.behind(leader))
        followers.append(outlook.behind_me(follower))
    own = outlook.behind(outlook.leader)
    prospects = Prospects(own, *leaders, *followers, *(side.gain_of_others for side in sides))
    gains = list(lane_gains(prospects, drivers, model))
    for number, side in enumerate(sides):
        for effect, memory in zip(drivers.effects, outlook.held, strict=True):
            gains[number] = effect.incentive(gains[number], side, outlook.seen, memory)
    return prospects, (gains[0], gains[1])


def wished_side(
    state: TrafficState,
    view: View,
    prospects: Prospects,
    gains: Gains,
    drivers: Drivers,
    model: TrafficModel,
    *,
    before: Int[Array, "vehicles *scenarios"],
) -> Int[Array, "vehicles *scenarios"]:
    """-1 or +1 for drivers who at their last decision would have changed to that side had there been room, else 0.

    Args:
        state: The traffic.
        view: What can be seen of it.
        prospects: Of the lanes.
        gains: What changes gain.
        drivers: Parameters of all vehicles.
        model: The road.
        before: The same one time step ago.
    """
    wished = jnp.zeros_like(before)
    due = is_due(state, view, drivers)
    willing = due & is_moving(state)
    followers = prospects.left_follower, prospects.right_follower
    for side, gain, follower in zip((-1, +1), gains, followers, strict=True):
        wants = willing & ~(gain < drivers.mobil.gain_threshold) & is_reachable(state, view.lane + side, model)
        wished = jnp.where(wants & is_unsafe(follower, drivers), side, wished)
    return jnp.where(due, wished, before)
