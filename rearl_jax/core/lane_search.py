"""Who is around, with all that drivers react to: who it is, how far, how fast, how long, of which class.

`rearl_jax.core.neighbours` finds what highway-env's drivers see; here it is the same search for drivers who see more.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.effects.stimulus import BESIDE_RANGE, OUT_OF_SIGHT
from rearl_jax.core.nearest import lane_bit
from rearl_jax.core.neighbours import View, for_each_vehicle, row
from rearl_jax.core.order import NOBODY, take_vehicles
from rearl_jax.core.state import TrafficState


class Traits(eqx.Module):
    """What others can see of each vehicle.

    Attributes:
        speed: Along the road [m/s].
        acceleration: In the last time step [m/s^2].
        length: [m].
        is_truck: 1 for a truck.
        desired_speed: What its driver wants at the moment [m/s].
    """

    speed: Float[Array, "#vehicles *#scenarios"]
    acceleration: Float[Array, "#vehicles *#scenarios"]
    length: Float[Array, "#vehicles *#scenarios"]
    is_truck: Float[Array, "#vehicles *#scenarios"]
    desired_speed: Float[Array, "#vehicles *#scenarios"]


class Neighbour(eqx.Module):
    """A vehicle near each vehicle.

    Attributes:
        index: Its index; NOBODY for none.
        distance: Along the road, centre to centre, positive [m]; inf for none.
        traits: Its own; those of the vehicle itself for none.
    """

    index: Int[Array, "#vehicles *#scenarios"]
    distance: Float[Array, "#vehicles *#scenarios"]
    traits: Traits

    @property
    def is_there(self) -> Bool[Array, "#vehicles *#scenarios"]:
        """Whether there is one."""
        return self.index != NOBODY


def nobody(traits: Traits) -> Neighbour:
    """Nobody near anybody; `traits` are those of the vehicles themselves."""
    return Neighbour(
        jnp.full(traits.speed.shape, NOBODY, jnp.int32),
        jnp.full(traits.speed.shape, jnp.inf, traits.speed.dtype),
        traits,
    )


def bumper_gap(neighbour: Neighbour, traits: Traits) -> Float[Array, "vehicles *scenarios"]:
    """Gap between the bumpers of each vehicle and its neighbour [m]; OUT_OF_SIGHT without one."""
    gap = neighbour.distance - (traits.length + neighbour.traits.length) / 2
    return jnp.where(neighbour.is_there, gap, OUT_OF_SIGHT)


def find_ahead(
    state: TrafficState, view: View, traits: Traits, lane: Int[Array, "vehicles *scenarios"], n_leaders: int
) -> tuple[Neighbour, ...]:
    """The nearest vehicles ahead of each vehicle on a lane of its choice, nearest first.

    The same position counts as ahead; of several equally near vehicles the last in the list is nearest.

    Args:
        state: The traffic.
        view: What can be seen of it.
        traits: The same, for drivers who see more.
        lane: The lane each vehicle looks at; -1 and n_lanes are empty.
        n_leaders: How many to look for.
    """
    own_index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)
    none = nobody(traits)
    if view.nearest is not None:
        index = view.nearest.ahead_on(lane)
        leaders = [index]
        while len(leaders) < n_leaders:
            further = view.nearest.after(index, lane)
            # Among vehicles abreast the own place may come after that of a leader.
            further = jnp.where(further == own_index, view.nearest.after(own_index, lane), further)
            index = jnp.where(index == NOBODY, NOBODY, further)
            leaders.append(index)
        return tuple(_where(index != NOBODY, _picked(state, traits, index), none) for index in leaders)
    bit = lane_bit(lane)

    def look_at(other: Int[Array, ""], found: tuple[Neighbour, ...]) -> tuple[Neighbour, ...]:
        new = _row(state, traits, other)
        is_ahead = ((row(view.on_lanes, other) & bit) != 0) & (new.distance >= 0) & (own_index != other)
        kept = []
        for place in found:
            is_nearer = is_ahead & (new.distance <= place.distance)
            kept.append(_where(is_nearer, new, place))
            new = _where(is_nearer, place, new)
        return tuple(kept)

    return for_each_vehicle(state.x.shape[0], look_at, (none,) * n_leaders)


def find_behind(state: TrafficState, view: View, traits: Traits, lane: Int[Array, "vehicles *scenarios"]) -> Neighbour:
    """The nearest vehicle behind each vehicle on a lane of its choice; of equally near ones the first in the list.

    Arguments as of `find_ahead`.
    """
    none = nobody(traits)
    if view.nearest is not None:
        index = view.nearest.behind_on(lane)
        return _where(index != NOBODY, _reversed(_picked(state, traits, index)), none)
    bit = lane_bit(lane)

    def look_at(other: Int[Array, ""], found: Neighbour) -> Neighbour:
        new = _reversed(_row(state, traits, other))
        is_behind = ((row(view.on_lanes, other) & bit) != 0) & (new.distance > 0)
        return _where(is_behind & (new.distance < found.distance), new, found)

    return for_each_vehicle(state.x.shape[0], look_at, none)


def find_entrant(
    state: TrafficState, view: View, traits: Traits, wanted_lane: Int[Array, "vehicles *scenarios"]
) -> Neighbour:
    """The nearest vehicle ahead of each vehicle that is on another lane and wants to be on that of the vehicle.

    Args:
        state: The traffic.
        view: What can be seen of it.
        traits: The same, for drivers who see more.
        wanted_lane: The lane each vehicle wants to be on.
    """

    def look_at(other: Int[Array, ""], found: Neighbour) -> Neighbour:
        new = _row(state, traits, other)
        wants_in = (row(wanted_lane, other) == view.lane) & (row(view.lane, other) != view.lane)
        is_ahead = wants_in & (row(view.on_lanes, other) != 0) & (new.distance > 0)
        return _where(is_ahead & (new.distance <= found.distance), new, found)

    return for_each_vehicle(state.x.shape[0], look_at, nobody(traits))


def look_beside(
    state: TrafficState, view: View, traits: Traits
) -> tuple[Float[Array, "vehicles *scenarios"], Float[Array, "vehicles *scenarios"]]:
    """Slowest speed within BESIDE_RANGE on the lanes beside [m/s], OUT_OF_SIGHT without one, and how many there are."""

    def look_at(other: Int[Array, ""], found: tuple[Array, Array]) -> tuple[Array, Array]:
        is_near = jnp.abs(row(state.x, other) - state.x) <= BESIDE_RANGE
        is_beside = (jnp.abs(row(view.lane, other) - view.lane) == 1) & (row(view.on_lanes, other) != 0) & is_near
        slowest = jnp.where(is_beside, jnp.minimum(found[0], row(traits.speed, other)), found[0])
        return slowest, found[1] + is_beside.astype(state.x.dtype)

    nothing = jnp.zeros_like(state.x)
    return for_each_vehicle(state.x.shape[0], look_at, (nothing + OUT_OF_SIGHT, nothing))


def _row(state: TrafficState, traits: Traits, other: Int[Array, ""]) -> Neighbour:
    """One vehicle as everybody's neighbour; distances are signed."""
    index = jnp.broadcast_to(other, (1,) * state.x.ndim).astype(jnp.int32)
    return Neighbour(index, row(state.x, other) - state.x, jax.tree.map(lambda values: row(values, other), traits))


def _picked(state: TrafficState, traits: Traits, index: Int[Array, "vehicles *scenarios"]) -> Neighbour:
    """A vehicle for each vehicle; distances are signed."""
    return Neighbour(
        index,
        take_vehicles(state.x, index) - state.x,
        jax.tree.map(lambda values: take_vehicles(values, index), traits),
    )


def _reversed(neighbour: Neighbour) -> Neighbour:
    """The same with distances counted backwards."""
    return Neighbour(neighbour.index, -neighbour.distance, neighbour.traits)


def _where(is_chosen: Array, new: Neighbour, found: Neighbour) -> Neighbour:
    return jax.tree.map(lambda a, b: jnp.where(is_chosen, a, b), new, found)
