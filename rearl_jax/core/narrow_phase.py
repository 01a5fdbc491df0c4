"""Narrow phase of collision detection: candidate pairs tested in full, block by block.

In highway-env the displacement of a vehicle is overwritten by each collision partner, so the partner with the highest
list index determines it. Pairs are processed in any order here, so a displacement is stored only if no partner with a
higher index has stored one.

Source: highway-env 1.12.1, `RoadObject.handle_collisions`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from rearl_jax.core.compaction import Block, gather, list_bits, list_vehicles, process_in_blocks
from rearl_jax.core.contacts import contact
from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.core.rectangles import Rectangle
from rearl_jax.core.state import TrafficState

VEHICLES_PER_CHECKED = 64
"""A block of vehicles whose pairs are tested together has room for one of this many vehicles."""


class Collisions(NamedTuple):
    """Collisions found so far: crash flags and displacements, by flat index over all vehicles of all scenarios.

    Attributes:
        crashed: Whether a vehicle has been in a collision.
        partner: Flat index of the collision partner with the highest list index; NO_VEHICLE for none.
        push_x: Displacement along the road caused by that partner [m].
        push_y: Displacement across the road caused by that partner [m].
    """

    crashed: Bool[Array, " all"]
    partner: Int[Array, " all"]
    push_x: Float[Array, " all"]
    push_y: Float[Array, " all"]


class Places(NamedTuple):
    """The vehicles by place in some order, all places of all scenarios on one flat axis.

    Attributes:
        state: The traffic.
        body: Sizes of the vehicles.
        vehicle: Flat index of the vehicle at each place; None for the order of the vehicle list.
    """

    state: TrafficState
    body: Body
    vehicle: Int[Array, " all"] | None

    @property
    def n_scenarios(self) -> int:
        """Number of scenarios, which is the stride from one place to the next of the same scenario."""
        return self.state.x.size // self.state.x.shape[0]

    def vehicle_at(self, place: Int[Array, " block"]) -> Int[Array, " block"]:
        """Flat indices of the vehicles at some places."""
        return place if self.vehicle is None else self.vehicle[place]

    def rectangles(self, vehicle: Int[Array, "*block"]) -> Rectangle:
        """The rectangles of the given vehicles."""
        state, body = self.state, self.body
        columns = state.x, state.y, state.heading, state.speed, body.length, body.width, body.collides
        x, y, heading, speed, length, width, collides = (gather(values, vehicle, state.x.shape) for values in columns)
        return Rectangle(x, y, cosine(heading), sine(heading), speed, length / 2, width / 2, collides)


def check_candidates(
    candidates: UInt32[Array, "places *scenarios"], places: Places, collisions: Collisions, model: TrafficModel
) -> Collisions:
    """Collisions after every vehicle has been tested against its candidates ahead.

    Args:
        candidates: For each place the places ahead to test, as bits, the next one lowest.
        places: The traffic by place.
        collisions: Collisions found so far.
        model: Traffic model; only its time step is used.
    """
    flat = candidates.ravel()

    def check_block(block: Block, collisions: Collisions) -> Collisions:
        own_candidates = jnp.where(block.is_filled, flat[block.index], jnp.uint32(0))
        return check_ahead(block.index, own_candidates, 1, places, collisions, model)

    members = list_vehicles(candidates != 0)
    return process_in_blocks(members, flat.size // VEHICLES_PER_CHECKED + 1, check_block, collisions)


def check_ahead(
    place: Int[Array, " block"],
    candidates: UInt32[Array, " block"],
    first: Int[Array, ""] | int,
    places: Places,
    collisions: Collisions,
    model: TrafficModel,
) -> Collisions:
    """Collisions after the given vehicles have been tested against their candidates ahead.

    Args:
        place: Flat indices of the places of these vehicles.
        candidates: For each vehicle the places ahead to test, as bits.
        first: Number of places from a vehicle to the one of its lowest bit.
        places: The traffic by place.
        collisions: Collisions found so far.
        model: Traffic model; only its time step is used.
    """
    n_all = places.state.x.size

    def check_block(block: Block, collisions: Collisions) -> Collisions:
        rear = place[block.word]
        front = rear + (first + block.bit) * places.n_scenarios
        front = jnp.where(front < n_all, front, front - n_all)  # the list is circular
        return _check_pairs(
            places.vehicle_at(rear), places.vehicle_at(front), block.is_filled, places, collisions, model
        )

    return process_in_blocks(list_bits(candidates), place.size, check_block, collisions)


def _check_pairs(
    rear: Int[Array, " block"],
    front: Int[Array, " block"],
    is_pair: Bool[Array, " block"],
    places: Places,
    collisions: Collisions,
    model: TrafficModel,
) -> Collisions:
    """Collisions after the given pairs of vehicles (flat indices) have been tested."""
    pair = jnp.stack([jnp.minimum(rear, front), jnp.maximum(rear, front)])
    partner_of_each = pair[::-1]
    rectangles = places.rectangles(pair)
    # The first and the last row are the same for a value that all vehicles share.
    first, second = (jax.tree.map(lambda values, k=k: values[k], rectangles) for k in (0, -1))
    touches, will_touch, shift_x, shift_y = contact(first, second, is_pair, model)
    touches, will_touch = (jnp.broadcast_to(flags, pair.shape) for flags in (touches, will_touch))

    crashed = collisions.crashed.at[pair].max(touches)
    # The maximum over partners does not depend on the order of pairs. The displacement by the partner with the maximum
    # index is written; all other writes have indices beyond the end of the array and are dropped.
    partner = collisions.partner.at[pair].max(jnp.where(will_touch, partner_of_each, NO_VEHICLE))
    written = jnp.where(will_touch & (partner[pair] == partner_of_each), pair, partner.size)
    push_x, push_y = (
        push.at[written].set(jnp.stack([shift / 2, -shift / 2]), mode="drop")
        for push, shift in ((collisions.push_x, shift_x), (collisions.push_y, shift_y))
    )
    return Collisions(crashed, partner, push_x, push_y)
