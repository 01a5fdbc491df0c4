"""Collisions: which rectangles touch, and by how much they are pushed apart in the next tick.

Contact is rare, so the work is split. A cheap test on two of the eight separating axes finds the vehicles that may touch
somebody behind them in the list; only those are then tested in full, one vehicle per scenario at a time against
all others. A push is the last one written: the partner with the highest list index counts, which is why the vehicles
are taken in rising order.

Source: highway-env 1.12.1, `Road.step`, `RoadObject.handle_collisions`, `utils.are_polygons_intersecting`.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.drivers import Body
from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import TrafficState

ROUNDING_MARGIN = 1e-3
"""Slack [m] of the cheap test, far above any rounding error of a distance between vehicles that touch."""


class _Rectangle(eqx.Module):
    """A vehicle as the collision test sees it: place [m], heading, speed [m/s], half sizes [m]."""

    x: Float[Array, "rows *scenarios"]
    y: Float[Array, "rows *scenarios"]
    cos: Float[Array, "rows *scenarios"]
    sin: Float[Array, "rows *scenarios"]
    speed: Float[Array, "rows *scenarios"]
    half_length: Float[Array, "rows *scenarios"]
    half_width: Float[Array, "rows *scenarios"]
    collides: Bool[Array, "rows *scenarios"]


def collide(state: TrafficState, body: Body, model: TrafficModel) -> TrafficState:
    """State with everybody marked who touches somebody, and with the pushes of the coming tick."""
    shape = state.x.shape
    rectangles = lax.stop_gradient(
        _Rectangle(
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
    pending = _may_touch_later(rectangles, model)

    def is_unfinished(work: tuple[Array, TrafficState]) -> Array:
        return jnp.any(work[0])

    def take_next(work: tuple[Array, TrafficState]) -> tuple[Array, TrafficState]:
        pending, outcome = work
        first = jnp.argmax(pending, axis=0, keepdims=True).astype(jnp.int32)
        has_one = jnp.any(pending, axis=0, keepdims=True)
        index = lax.broadcasted_iota(jnp.int32, shape, 0)
        return pending & (index != first), _collide_one(outcome, rectangles, first, has_one, model)

    marks = (state.crashed, state.is_pushed, state.push_x, state.push_y)
    _, marks = lax.while_loop(is_unfinished, take_next, (pending, lax.stop_gradient(marks)))
    return eqx.tree_at(lambda s: (s.crashed, s.is_pushed, s.push_x, s.push_y), state, marks)


def _may_touch_later(all_: _Rectangle, model: TrafficModel) -> Bool[Array, "vehicles *scenarios"]:
    """Whether a vehicle may touch, now or in the coming tick, one that comes after it in the list.

    Necessary conditions only: no gap along the vehicle's own two axes, which are among the eight of the full test.
    """
    n_vehicles = all_.x.shape[0]
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)

    def look_at(number: Int[Array, ""], found: Array) -> Array:
        other = jax.tree.map(lambda values: lax.dynamic_index_in_dim(values, number, 0, keepdims=True), all_)
        dx, dy = other.x - all_.x, other.y - all_.y
        cos = all_.cos * other.cos + all_.sin * other.sin
        sin = all_.cos * other.sin - all_.sin * other.cos
        along, across = dx * all_.cos + dy * all_.sin, dy * all_.cos - dx * all_.sin
        long_reach = other.half_length * jnp.abs(cos) + other.half_width * jnp.abs(sin) + all_.half_length
        wide_reach = other.half_length * jnp.abs(sin) + other.half_width * jnp.abs(cos) + all_.half_width
        long_reach = long_reach + jnp.abs(all_.speed - other.speed * cos) * model.tick + ROUNDING_MARGIN
        wide_reach = wide_reach + jnp.abs(other.speed * sin) * model.tick + ROUNDING_MARGIN
        near = (jnp.abs(along) <= long_reach) & (jnp.abs(across) <= wide_reach)
        return found | (near & (index < number) & (all_.collides | other.collides))

    nobody = jnp.zeros(all_.x.shape, bool)
    return lax.fori_loop(0, n_vehicles, look_at, nobody, unroll=min(n_vehicles, 16))


def _collide_one(
    marks: tuple[Array, Array, Array, Array],
    all_: _Rectangle,
    chosen: Int[Array, "1 *scenarios"],
    is_chosen: Bool[Array, "1 *scenarios"],
    model: TrafficModel,
) -> tuple[Array, Array, Array, Array]:
    """Crash marks and pushes after one vehicle per scenario has been tested against all that come after it in the list."""
    crashed, is_pushed, push_x, push_y = marks
    index = lax.broadcasted_iota(jnp.int32, all_.x.shape, 0)
    one = jax.tree.map(lambda values: jnp.take_along_axis(values, chosen, axis=0), all_)
    touches, will_touch, shift_x, shift_y = _separate(one, all_, model)

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


def _separate(one: _Rectangle, other: _Rectangle, model: TrafficModel) -> tuple[Array, Array, Array, Array]:
    """Whether rectangles touch, whether they will within a tick, and the shift of `one` that prevents it [m].

    Separating-axis test with the outward normals of all eight edges. A normal and its negative can give different
    depths when one interval holds the other, so both are tested; on equal depths the first counts.
    """
    moved_x = (one.speed * one.cos - other.speed * other.cos) * model.tick
    moved_y = (one.speed * one.sin - other.speed * other.sin) * model.tick
    axes = []
    for rectangle in (one, other):
        cos, sin = rectangle.cos, rectangle.sin
        axes += [(-cos, -sin), (-sin, cos), (cos, sin), (sin, -cos)]

    def project(rectangle: _Rectangle, nx: Array, ny: Array) -> tuple[Array, Array]:
        centre = rectangle.x * nx + rectangle.y * ny
        reach = rectangle.half_length * jnp.abs(rectangle.cos * nx + rectangle.sin * ny)
        reach = reach + rectangle.half_width * jnp.abs(rectangle.cos * ny - rectangle.sin * nx)
        return centre - reach, centre + reach

    def gap(low: Array, high: Array, other_low: Array, other_high: Array) -> Array:
        return jnp.where(low < other_low, other_low - high, low - other_high)

    touches, will_touch, depth, shift_x, shift_y = [], [], None, None, None
    for nx, ny in axes:
        (low, high), (other_low, other_high) = project(one, nx, ny), project(other, nx, ny)
        touches.append(gap(low, high, other_low, other_high) <= 0)
        moved = moved_x * nx + moved_y * ny
        low, high = jnp.minimum(low, low + moved), jnp.maximum(high, high + moved)
        distance = gap(low, high, other_low, other_high)
        will_touch.append(distance <= 0)
        is_beyond = (one.x - other.x) * nx + (one.y - other.y) * ny > 0
        size = jnp.abs(distance)
        signed = jnp.where(is_beyond, size, -size)
        if depth is None:
            depth, shift_x, shift_y = size, signed * nx, signed * ny
        else:
            shift_x = jnp.where(size < depth, signed * nx, shift_x)
            shift_y = jnp.where(size < depth, signed * ny, shift_y)
            depth = jnp.minimum(size, depth)
    return (
        functools.reduce(jnp.logical_and, touches),
        functools.reduce(jnp.logical_and, will_touch),
        shift_x,
        shift_y,
    )
