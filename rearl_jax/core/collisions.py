"""Collisions: which rectangles touch, and by how much they are pushed apart in the next tick.

Contact is rare, so the work is split. A cheap test of bounding boxes finds the vehicles that may touch
somebody behind them in the list; only those are then tested in full, one vehicle per scenario at a time against
all others. A push is the last one written: the partner with the highest list index counts, which is why the vehicles
are taken in rising order.

Source: highway-env 1.12.1, `Road.step`, `RoadObject.handle_collisions`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.affected import if_any, on_affected
from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import for_each_vehicle, is_large, row
from rearl_jax.core.order import within_reach
from rearl_jax.core.rectangles import Rectangle, separate
from rearl_jax.core.state import TrafficState

ROUNDING_MARGIN = 1e-3
"""Slack [m] of the cheap test, far above any rounding error of a distance between vehicles that touch."""


_Marks = tuple[Array, Array, Array, Array]
"""Who has crashed, who is pushed, and the pushes in x and y [m]."""


class _Extent(eqx.Module):
    """Upright bounding box of a vehicle: centre, half sizes, and sqrt(2) times its displacement in a tick, all in m."""

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    reach_x: Float[Array, "vehicles *scenarios"]
    reach_y: Float[Array, "vehicles *scenarios"]
    moved_x: Float[Array, "vehicles *scenarios"]
    moved_y: Float[Array, "vehicles *scenarios"]
    collides: Bool[Array, "vehicles *scenarios"]


def collide(state: TrafficState, body: Body, model: TrafficModel) -> TrafficState:
    """State with everybody marked who touches somebody, and with the pushes of the coming tick."""
    shape = state.x.shape
    rectangles = lax.stop_gradient(
        Rectangle(
            x=state.x,
            y=state.y,
            cos=cosine(state.heading),
            sin=sine(state.heading),
            speed=state.speed,
            half_length=jnp.broadcast_to(body.length / 2, shape),
            half_width=jnp.broadcast_to(body.width / 2, shape),
            collides=jnp.broadcast_to(body.collides, shape),
        )
    )
    extent = _extent(rectangles, model)
    if is_large(shape[0]):
        reach = extent.reach_x + jnp.abs(extent.moved_x) + jnp.abs(extent.moved_y)
        may_touch = within_reach(state.order, extent.x, reach, extent, _may_touch)
    else:
        # Half the list once more behind its end, so that everybody can be held against those who come after.
        cycle = jax.tree.map(lambda values: jnp.concatenate([values, values[: shape[0] // 2]]), extent)
        may_touch = if_any(rectangles.collides, lambda: _may_touch_next(extent, cycle), jnp.zeros(shape, bool))
    marks = lax.stop_gradient((state.crashed, state.is_pushed, state.push_x, state.push_y))
    marks = on_affected(
        jnp.any(may_touch, axis=0),
        lambda work: _collide_all(*work, model),
        (extent, rectangles, marks),
        marks,
    )
    return eqx.tree_at(lambda s: (s.crashed, s.is_pushed, s.push_x, s.push_y), state, marks)


def _collide_all(
    extent: _Extent,
    rectangles: Rectangle,
    marks: _Marks,
    model: TrafficModel,
) -> _Marks:
    """Crash marks and pushes after all vehicles that may touch have been tested, the lowest index of each scenario
    first.
    """
    pending = _may_touch_later(extent)
    index = lax.broadcasted_iota(jnp.int32, pending.shape, 0)

    def is_unfinished(work: tuple[Array, _Marks]) -> Array:
        return jnp.any(work[0])

    def take_next(work: tuple[Array, _Marks]) -> tuple[Array, _Marks]:
        pending, marks = work
        first = jnp.argmax(pending, axis=0, keepdims=True).astype(jnp.int32)
        has_one = jnp.any(pending, axis=0, keepdims=True)
        return pending & (index != first), _collide_one(marks, rectangles, first, has_one, model)

    return lax.while_loop(is_unfinished, take_next, (pending, marks))[1]


def _extent(all_: Rectangle, model: TrafficModel) -> _Extent:
    """Bounding boxes of all vehicles."""
    cos, sin = jnp.abs(all_.cos), jnp.abs(all_.sin)
    moved = all_.speed * (float(np.sqrt(2)) * model.tick)
    return _Extent(
        x=all_.x,
        y=all_.y,
        reach_x=all_.half_length * cos + all_.half_width * sin + ROUNDING_MARGIN,
        reach_y=all_.half_length * sin + all_.half_width * cos + ROUNDING_MARGIN,
        moved_x=moved * all_.cos,
        moved_y=moved * all_.sin,
        collides=all_.collides,
    )


def _may_touch_next(all_: _Extent, cycle: _Extent) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle may touch, now or in the coming tick, one of the half of all vehicles that come next.

    The list is a circle here, so every pair is looked at, in one direction.
    """
    n_vehicles = all_.x.shape[0]
    found = jnp.zeros(all_.x.shape, bool)
    for places in range(1, n_vehicles // 2 + 1):
        found = found | _may_touch(all_, jax.tree.map(lambda values, k=places: values[k : k + n_vehicles], cycle))
    return found


def _may_touch_later(all_: _Extent) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle may touch, now or in the coming tick, one that comes after it in the list."""
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)

    def look_at(number: Int[Array, ""], found: Array) -> Array:
        other = jax.tree.map(lambda values: row(values, number), all_)
        return found | (_may_touch(all_, other) & (index < number))

    return for_each_vehicle(all_.x.shape[0], look_at, jnp.zeros(all_.x.shape, bool))


def _may_touch(one: _Extent, other: _Extent) -> Array:
    """Whether two vehicles may touch now or in the coming tick.

    A necessary condition. Rectangles a distance D apart have a gap of at least D / sqrt(2) along one of their edge
    normals, and the full test lengthens intervals by no more than the relative displacement r of one tick. So they
    cannot touch where their upright bounding boxes are more than sqrt(2) |r| apart in x or in y.
    """
    moved_apart = jnp.abs(other.moved_x - one.moved_x) + jnp.abs(other.moved_y - one.moved_y)
    near_x = jnp.abs(other.x - one.x) <= other.reach_x + one.reach_x + moved_apart
    near_y = jnp.abs(other.y - one.y) <= other.reach_y + one.reach_y + moved_apart
    return near_x & near_y & (other.collides | one.collides)


def _collide_one(
    marks: _Marks,
    all_: Rectangle,
    chosen: Int[Array, "1 *scenarios"],
    is_chosen: Bool[Array, "1 *scenarios"],
    model: TrafficModel,
) -> _Marks:
    """Crash marks and pushes after one vehicle per scenario has been tested against all that come after it in the
    list.
    """
    crashed, is_pushed, push_x, push_y = marks
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)
    one = jax.tree.map(lambda values: jnp.take_along_axis(values, chosen, axis=0), all_)
    nowhere, nothing = jnp.zeros(all_.x.shape, bool), jnp.zeros_like(all_.x)
    apart = (nowhere, nowhere, nothing, nothing)
    touches, will_touch, shift_x, shift_y = if_any(is_chosen, lambda: separate(one, all_, model), apart)

    diagonals = jnp.hypot(one.half_length, one.half_width) + jnp.hypot(all_.half_length, all_.half_width)
    is_near = jnp.hypot(all_.x - one.x, all_.y - one.y) <= diagonals + one.speed * model.tick
    is_pair = is_near & (index > chosen) & is_chosen & (one.collides | all_.collides)
    touches, will_touch = touches & is_pair, will_touch & is_pair

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
