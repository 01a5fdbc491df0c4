"""The tests of contact: the cheap one, by upright bounding boxes, and the full one."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from rearl_jax.core.affected import if_any
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rectangles import Rectangle, separate

ROUNDING_MARGIN = 1e-3
"""Slack [m] of the cheap test, far above any rounding error of a distance between vehicles that touch."""

Marks = tuple[Array, Array, Array, Array]
"""Who has crashed, who is pushed, and the pushes in x and y [m]."""


class Extent(eqx.Module):
    """Upright bounding box of a vehicle: centre, half sizes, and sqrt(2) times its displacement in a tick, all in m."""

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    reach_x: Float[Array, "vehicles *scenarios"]
    reach_y: Float[Array, "vehicles *scenarios"]
    moved_x: Float[Array, "vehicles *scenarios"]
    moved_y: Float[Array, "vehicles *scenarios"]
    collides: Bool[Array, "vehicles *scenarios"]


def extent_of(all_: Rectangle, model: TrafficModel) -> Extent:
    """Bounding boxes of all vehicles."""
    cos, sin = jnp.abs(all_.cos), jnp.abs(all_.sin)
    moved = all_.speed * (float(np.sqrt(2)) * model.tick)
    return Extent(
        x=all_.x,
        y=all_.y,
        reach_x=all_.half_length * cos + all_.half_width * sin + ROUNDING_MARGIN,
        reach_y=all_.half_length * sin + all_.half_width * cos + ROUNDING_MARGIN,
        moved_x=moved * all_.cos,
        moved_y=moved * all_.sin,
        collides=jnp.broadcast_to(all_.collides, all_.x.shape),
    )


def may_touch(one: Extent, other: Extent) -> Array:
    """Whether two vehicles may touch now or in the coming tick.

    A necessary condition. Rectangles a distance D apart have a gap of at least D / sqrt(2) along one of their edge
    normals, and the full test lengthens intervals by no more than the relative displacement r of one tick. So they
    cannot touch where their upright bounding boxes are more than sqrt(2) |r| apart in x or in y.
    """
    moved_apart = jnp.abs(other.moved_x - one.moved_x) + jnp.abs(other.moved_y - one.moved_y)
    near_x = jnp.abs(other.x - one.x) <= other.reach_x + one.reach_x + moved_apart
    near_y = jnp.abs(other.y - one.y) <= other.reach_y + one.reach_y + moved_apart
    return near_x & near_y & (other.collides | one.collides)


def contact(
    one: Rectangle, other: Rectangle, is_pair: Bool[Array, "#rows *#scenarios"], model: TrafficModel
) -> tuple[Array, Array, Array, Array]:
    """Whether vehicles touch, whether they will within a tick, and the shift of `one` that prevents it (x, y) [m].

    Args:
        one: Vehicles of lower list index, of one or all rows.
        other: Those they are held against.
        is_pair: Which of the pairs are looked at.
        model: The tick.
    """

    def test() -> tuple[Array, Array, Array, Array]:
        touches, will_touch, shift_x, shift_y = separate(one, other, model)
        diagonals = jnp.hypot(one.half_length, one.half_width) + jnp.hypot(other.half_length, other.half_width)
        is_near = jnp.hypot(other.x - one.x, other.y - one.y) <= diagonals + one.speed * model.tick
        is_tested = is_pair & is_near & (one.collides | other.collides)
        return touches & is_tested, will_touch & is_tested, shift_x, shift_y

    nowhere, nothing = jnp.zeros(other.x.shape, bool), jnp.zeros_like(other.x)
    # Behind a branch it is a program of its own, which rounds to the last place alike wherever it is asked.
    return if_any(is_pair, test, (nowhere, nowhere, nothing, nothing))
