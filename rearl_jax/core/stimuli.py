"""What every simulated driver sees: the traffic's state as the stimulus that effects react to."""

from dataclasses import fields

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.effects.intentions import SimulatedStimulus
from rearl_jax.core.effects.side_lane import SideLane
from rearl_jax.core.effects.stimulus import OUT_OF_SIGHT
from rearl_jax.core.encounter import Encounter
from rearl_jax.core.lane_search import (
    Neighbour,
    Traits,
    bumper_gap,
    find_ahead,
    find_behind,
    find_entrant,
    look_beside,
    nobody,
)
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import View
from rearl_jax.core.state import Controller, TrafficState


def traits_of(state: TrafficState, view: View, drivers: Drivers) -> Traits:
    """What others can see of each vehicle; desired speeds are those of the state."""

    def full(values: Array) -> Float[Array, "vehicles *scenarios"]:
        return jnp.broadcast_to(values.astype(state.x.dtype), state.x.shape)

    is_truck = drivers.body.is_truck
    return Traits(
        speed=view.speed_x,
        acceleration=state.acceleration,
        length=full(drivers.body.length),
        is_truck=jnp.zeros_like(state.x) if is_truck is None else full(is_truck),
        desired_speed=state.desired_speed,
    )


class Around(eqx.Module):
    """Who is next to each vehicle on its own lane: three vehicles ahead, nearest first, and one behind."""

    ahead: tuple[Neighbour, ...]
    behind: Neighbour


def look_around(state: TrafficState, view: View, traits: Traits) -> Around:
    """Who is next to each vehicle on its own lane."""
    is_present, none = state.controller != Controller.ABSENT, nobody(traits)
    ahead = if_any(is_present, lambda: find_ahead(state, view, traits, view.lane, 3), (none,) * 3)
    return Around(ahead, if_any(is_present, lambda: find_behind(state, view, traits, view.lane), none))


def stimulus(
    state: TrafficState,
    view: View,
    traits: Traits,
    around: Around,
    encounter: Encounter,
    wanted_lane: Int[Array, "vehicles *scenarios"],
    time: Float[Array, ""],
    model: TrafficModel,
) -> SimulatedStimulus:
    """What each driver sees.

    Args:
        state: The traffic.
        view: What can be seen of it.
        traits: The same, for drivers who see more.
        around: Who is next to each vehicle on its own lane.
        encounter: Since when the leader has been the leader.
        wanted_lane: The lane each vehicle wants to be on.
        time: Since the start [s].
        model: The road.
    """
    (leader, second, third), follower = around.ahead, around.behind
    is_present = state.controller != Controller.ABSENT
    unseen = jnp.full_like(state.x, OUT_OF_SIGHT), jnp.zeros_like(state.x)
    left = if_any(is_present, lambda: find_ahead(state, view, traits, view.lane - 1, 1), (nobody(traits),))[0]
    beside_speed, n_beside = if_any(is_present, lambda: look_beside(state, view, traits), unseen)
    wishes = wanted_lane != view.lane
    entrant = if_any(wishes, lambda: find_entrant(state, view, traits, wanted_lane), nobody(traits))
    changes = state.target_lane != view.lane
    changer = if_any(changes, lambda: find_entrant(state, view, traits, state.target_lane), nobody(traits))
    (wanted,) = if_any(wishes, lambda: find_ahead(state, view, traits, wanted_lane, 1), (nobody(traits),))

    def flag(is_so: Array) -> Float[Array, "vehicles *scenarios"]:
        return is_so.astype(state.x.dtype)

    lane = flag(view.lane)
    leader_speed = leader.traits.speed
    second_speed = jnp.where(second.is_there, second.traits.speed, leader_speed)
    between = bumper_gap(second, traits) - leader.traits.length
    return SimulatedStimulus(
        time=time,
        position=state.x,
        lane=lane,
        is_leftmost=flag(view.lane == 0),
        is_rightmost=flag(view.lane == model.n_lanes - 1),
        lateral_offset=state.y - lane * model.lane_width,
        speed=traits.speed,
        length=traits.length,
        is_truck=traits.is_truck,
        **in_front(leader, traits),
        has_second=flag(second.is_there),
        second_gap=jnp.where(second.is_there, between, OUT_OF_SIGHT),
        second_speed=second_speed,
        has_third=flag(third.is_there),
        third_speed=jnp.where(third.is_there, third.traits.speed, second_speed),
        has_follower=flag(follower.is_there),
        follower_gap=bumper_gap(follower, traits),
        follower_speed=follower.traits.speed,
        has_left=flag(left.is_there),
        left_gap=bumper_gap(left, traits),
        left_speed=left.traits.speed,
        beside_speed=beside_speed,
        n_beside=n_beside,
        time_since_change=encounter.time_since_change,
        gap_lost=encounter.gap_lost,
        time_gap_at_change=encounter.time_gap,
        has_entrant=flag(entrant.is_there),
        entrant_gap=bumper_gap(entrant, traits),
        entrant_speed=entrant.traits.speed,
        has_changer=flag(changer.is_there),
        changer_gap=bumper_gap(changer, traits),
        changer_speed=changer.traits.speed,
        has_wanted=flag(wishes & wanted.is_there),
        wanted_gap=bumper_gap(wanted, traits),
        wanted_speed=wanted.traits.speed,
    )


def in_front(leader: Neighbour, traits: Traits) -> dict[str, Float[Array, "vehicles *scenarios"]]:
    """What each driver sees of a vehicle ahead, by the fields of `Stimulus`; arguments as of `bumper_gap`."""
    has_leader = leader.is_there.astype(traits.speed.dtype)
    return {
        "has_leader": has_leader,
        "gap": bumper_gap(leader, traits),
        "leader_speed": leader.traits.speed,
        "leader_acceleration": has_leader * leader.traits.acceleration,
        "leader_length": leader.traits.length,
        "leader_is_truck": has_leader * leader.traits.is_truck,
    }


def side_lane(
    direction: int,
    leader: Neighbour,
    follower: Neighbour,
    gain_of_others: Float[Array, "vehicles *scenarios"],
    traits: Traits,
) -> SideLane:
    """What each driver sees of the lane on one side.

    Args:
        direction: -1 for the left, +1 for the right.
        leader: The next vehicle ahead on it.
        follower: The next one behind.
        gain_of_others: What the followers gain together by a change [m/s^2].
        traits: What can be seen of each vehicle.
    """
    seen = in_front(leader, traits)
    names = {item.name for item in fields(SideLane)}
    return SideLane(
        direction=direction,
        **{name: values for name, values in seen.items() if name in names},
        has_follower=follower.is_there.astype(traits.speed.dtype),
        follower_gap=bumper_gap(follower, traits),
        follower_speed=follower.traits.speed,
        gain_of_others=gain_of_others,
    )
