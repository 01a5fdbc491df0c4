"""Pairs of vehicles that may touch, tested in full, a lot at a time.

A push is the last one written in highway-env: of all that push a vehicle, the one with the highest list index counts.
Pairs come in any sequence here, so each push is written only where nobody with a higher index has pushed so far.

Source: highway-env 1.12.1, `RoadObject.handle_collisions`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from rearl_jax.core.contacts import contact
from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.lots import Lot, in_lots, list_bits, list_vehicles, take
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.order import NOBODY
from rearl_jax.core.rectangles import Rectangle
from rearl_jax.core.state import TrafficState

TESTED = 64
"""Vehicles of all scenarios for each of a lot whose pairs are tested together; own choice."""


class Found(NamedTuple):
    """Crash marks and pushes so far, and of all that push a vehicle the one with the highest index, NOBODY for none.

    All vehicles of all scenarios are in a row, by their indices.
    """

    crashed: Bool[Array, " all"]
    partner: Int[Array, " all"]
    push_x: Float[Array, " all"]
    push_y: Float[Array, " all"]


class Road(NamedTuple):
    """Who stands where, all places of all scenarios in a row.

    Attributes:
        state: The traffic.
        body: Sizes of the vehicles.
        vehicle: Where the vehicle of each place stands among all; None where places are vehicles.
    """

    state: TrafficState
    body: Body
    vehicle: Int[Array, " all"] | None

    @property
    def n_scenarios(self) -> int:
        """Number of scenarios, which is how far the next place of the same one is away."""
        return self.state.x.size // self.state.x.shape[0]

    def vehicle_at(self, place: Int[Array, " lot"]) -> Int[Array, " lot"]:
        """Who stands at some places."""
        return place if self.vehicle is None else self.vehicle[place]

    def rectangles(self, vehicle: Int[Array, "*lot"]) -> Rectangle:
        """Some vehicles as the collision test sees them."""
        state, body = self.state, self.body
        wanted = state.x, state.y, state.heading, state.speed, body.length, body.width, body.collides
        x, y, heading, speed, length, width, collides = (take(values, vehicle, state.x.shape) for values in wanted)
        return Rectangle(x, y, cosine(heading), sine(heading), speed, length / 2, width / 2, collides)


def settle_close(close: UInt32[Array, "places *scenarios"], road: Road, found: Found, model: TrafficModel) -> Found:
    """What is found once every vehicle has been tested against those ahead that it may touch.

    Args:
        close: Of each place the places ahead, as bits, the next one lowest.
        road: The traffic.
        found: So far.
        model: The tick.
    """
    in_a_row = close.ravel()

    def settle_lot(lot: Lot, found: Found) -> Found:
        its_close = jnp.where(lot.is_there, in_a_row[lot.place], jnp.uint32(0))
        return settle_ahead(lot.place, its_close, 1, road, found, model)

    return in_lots(list_vehicles(close != 0), in_a_row.size // TESTED + 1, settle_lot, found)


def settle_ahead(
    place: Int[Array, " lot"],
    close: UInt32[Array, " lot"],
    first: Int[Array, ""] | int,
    road: Road,
    found: Found,
    model: TrafficModel,
) -> Found:
    """What is found once some vehicles have been tested against those ahead that they may touch.

    Args:
        place: Where they stand.
        close: The places ahead as bits.
        first: Places ahead of the lowest bit.
        road: The traffic.
        found: So far.
        model: The tick.
    """
    n_all = road.state.x.size

    def settle_some(lot: Lot, found: Found) -> Found:
        rear = place[lot.number]
        front = rear + (first + lot.bit) * road.n_scenarios
        front = jnp.where(front < n_all, front, front - n_all)  # the list is a circle
        return _test(road.vehicle_at(rear), road.vehicle_at(front), lot.is_there, road, found, model)

    return in_lots(list_bits(close), place.size, settle_some, found)


def _test(
    rear: Int[Array, " lot"],
    front: Int[Array, " lot"],
    is_pair: Bool[Array, " lot"],
    road: Road,
    found: Found,
    model: TrafficModel,
) -> Found:
    """What is found after some pairs of vehicles."""
    pair = jnp.stack([jnp.minimum(rear, front), jnp.maximum(rear, front)])
    partner_of_each = pair[::-1]
    rectangles = road.rectangles(pair)
    # The first row and the last: of what is one for all there is a single one, which is both.
    one, other = (jax.tree.map(lambda values, k=k: values[k], rectangles) for k in (0, -1))
    touches, will_touch, shift_x, shift_y = contact(one, other, is_pair, model)
    touches, will_touch = (jnp.broadcast_to(whether, pair.shape) for whether in (touches, will_touch))

    crashed = found.crashed.at[pair].max(touches)
    partner = found.partner.at[pair].max(jnp.where(will_touch, partner_of_each, NOBODY))
    written = jnp.where(will_touch & (partner[pair] == partner_of_each), pair, partner.size)
    push_x, push_y = (
        push.at[written].set(jnp.stack([shift / 2, -shift / 2]), mode="drop")
        for push, shift in ((found.push_x, shift_x), (found.push_y, shift_y))
    )
    return Found(crashed, partner, push_x, push_y)
