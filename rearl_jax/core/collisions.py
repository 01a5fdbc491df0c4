"""Collisions: which rectangles touch, and by how much they are pushed apart in the next tick.

Contact is rare, so the work is split. A cheap test of bounding boxes finds the vehicles that may touch somebody behind
them in the list; only those are then tested in full, in small traffic one vehicle per scenario at a time against all
others, in large traffic pair by pair (`rearl_jax.core.pile_ups`). A push is the last one written: the partner with the
highest list index counts.

Source: highway-env 1.12.1, `Road.step`, `RoadObject.handle_collisions`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Int

from rearl_jax.core.affected import if_any, on_affected
from rearl_jax.core.contacts import Extent, Marks, contact, extent_of, may_touch
from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import for_each_vehicle, is_large, row
from rearl_jax.core.order import pick
from rearl_jax.core.pile_ups import collide_along_road
from rearl_jax.core.rectangles import Rectangle
from rearl_jax.core.state import TrafficState


def collide(state: TrafficState, body: Body, model: TrafficModel) -> TrafficState:
    """State with everybody marked who touches somebody, and with the pushes of the coming tick.

    Args:
        state: The traffic; its order along the road is up to date.
        body: Sizes of the vehicles.
        model: The tick.
    """
    shape = state.x.shape
    marks = lax.stop_gradient((state.crashed, state.is_pushed, state.push_x, state.push_y))
    placed = lax.stop_gradient((state.x, state.y, state.heading, state.speed, body))
    if is_large(shape[0]):
        by_place = _rectangles(*jax.tree.map(lambda values: pick(values, state.order), placed))
        marks = collide_along_road(state.order, by_place, marks, model)
    else:
        rectangles = jax.tree.map(lambda values: jnp.broadcast_to(values, shape), _rectangles(*placed))
        marks = _collide_in_list(extent_of(rectangles, model), rectangles, marks, model)
    return eqx.tree_at(lambda s: (s.crashed, s.is_pushed, s.push_x, s.push_y), state, marks)


def _rectangles(x: Array, y: Array, heading: Array, speed: Array, body: Body) -> Rectangle:
    """Vehicles as the collision test sees them."""
    nothing = jnp.zeros_like(heading)
    cos, sin = if_any(body.collides, lambda: (cosine(heading), sine(heading)), (nothing, nothing))
    return Rectangle(x, y, cos, sin, speed, body.length / 2, body.width / 2, body.collides)


def _collide_in_list(extent: Extent, rectangles: Rectangle, marks: Marks, model: TrafficModel) -> Marks:
    """Marks after everybody has been held against everybody."""
    shape = extent.x.shape
    # Half the list once more behind its end, so that everybody can be held against those who come after.
    cycle = jax.tree.map(lambda values: jnp.concatenate([values, values[: shape[0] // 2]]), extent)
    close = if_any(rectangles.collides, lambda: _may_touch_next(extent, cycle), jnp.zeros(shape, bool))
    work = extent, rectangles, marks
    return on_affected(jnp.any(close, axis=0), lambda work: _collide_all(*work, model), work, marks)


def _collide_all(
    extent: Extent,
    rectangles: Rectangle,
    marks: Marks,
    model: TrafficModel,
) -> Marks:
    """Crash marks and pushes after all vehicles that may touch have been tested, the lowest index of each scenario
    first.
    """
    pending = _may_touch_later(extent)
    index = lax.broadcasted_iota(jnp.int32, pending.shape, 0)

    def is_unfinished(work: tuple[Array, Marks]) -> Array:
        return jnp.any(work[0])

    def take_next(work: tuple[Array, Marks]) -> tuple[Array, Marks]:
        pending, marks = work
        first = jnp.argmax(pending, axis=0, keepdims=True).astype(jnp.int32)
        has_one = jnp.any(pending, axis=0, keepdims=True)
        return pending & (index != first), _collide_one(marks, rectangles, first, has_one, model)

    return lax.while_loop(is_unfinished, take_next, (pending, marks))[1]


def _may_touch_next(all_: Extent, cycle: Extent) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle may touch, now or in the coming tick, one of the half of all vehicles that come next.

    The list is a circle here, so every pair is looked at, in one direction.
    """
    n_vehicles = all_.x.shape[0]
    found = jnp.zeros(all_.x.shape, bool)
    for places in range(1, n_vehicles // 2 + 1):
        found = found | may_touch(all_, jax.tree.map(lambda values, k=places: values[k : k + n_vehicles], cycle))
    return found


def _may_touch_later(all_: Extent) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle may touch, now or in the coming tick, one that comes after it in the list."""
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)

    def look_at(number: Int[Array, ""], found: Array) -> Array:
        other = jax.tree.map(lambda values: row(values, number), all_)
        return found | (may_touch(all_, other) & (index < number))

    return for_each_vehicle(all_.x.shape[0], look_at, jnp.zeros(all_.x.shape, bool))


def _collide_one(
    marks: Marks,
    all_: Rectangle,
    chosen: Int[Array, "1 *scenarios"],
    is_chosen: Bool[Array, "1 *scenarios"],
    model: TrafficModel,
) -> Marks:
    """Crash marks and pushes after one vehicle per scenario has been tested against all that come after it in the
    list.
    """
    crashed, is_pushed, push_x, push_y = marks
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)
    one = jax.tree.map(lambda values: jnp.take_along_axis(values, chosen, axis=0), all_)
    touches, will_touch, shift_x, shift_y = contact(one, all_, (index > chosen) & is_chosen, model)

    last = jnp.max(jnp.where(will_touch, index, -1), axis=0, keepdims=True)
    is_last = (index == last) & will_touch
    is_self = (index == chosen) & is_chosen
    pushes_self = is_self & jnp.any(will_touch, axis=0, keepdims=True)
    self_x = jnp.sum(jnp.where(is_last, shift_x, 0.0), axis=0, keepdims=True)
    self_y = jnp.sum(jnp.where(is_last, shift_y, 0.0), axis=0, keepdims=True)
    return (
        crashed | touches | (is_self & jnp.any(touches, axis=0, keepdims=True)),
        is_pushed | will_touch | pushes_self,
        jnp.where(pushes_self, self_x / 2, jnp.where(will_touch, -shift_x / 2, push_x)),
        jnp.where(pushes_self, self_y / 2, jnp.where(will_touch, -shift_y / 2, push_y)),
    )
