"""The tests of contact: the cheap one, by upright boxes that are large enough, and the full one."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt32

from rearl_jax.core.affected import if_any
from rearl_jax.core.drivers import Body
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rectangles import Rectangle, separate
from rearl_jax.core.state import TrafficState

ROUNDING_MARGIN = 1e-3
"""Slack [m] of the cheap test, far above any rounding error of a distance between vehicles that touch."""


class Extent(eqx.Module):
    """An upright box that holds the vehicle, and how far it moves in a tick, all in m.

    Attributes:
        x: Centre along the road.
        y: Centre across the road.
        reach_x: Half the length of the box, and what a tick may add to it beyond `moved`.
        reach_y: The same across the road.
        moved: sqrt(2) times the way of a tick, as if along the road.
    """

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    reach_x: Float[Array, "vehicles *scenarios"]
    reach_y: Float[Array, "vehicles *scenarios"]
    moved: Float[Array, "vehicles *scenarios"]


def extent_of(state: TrafficState, body: Body, model: TrafficModel) -> Extent:
    """Boxes of all vehicles.

    No sine is needed for a box that is large enough: |sin h| <= min(|h|, 1), and 1 - cos h <= min(h^2 / 2, 2).
    """
    size = jnp.abs(state.heading)
    sine, missing_cosine = jnp.minimum(size, 1.0), jnp.minimum(size * size / 2, 2.0)
    moved = state.speed * (float(np.sqrt(2)) * model.tick)
    aside = jnp.abs(moved) * (sine + missing_cosine) + ROUNDING_MARGIN
    return Extent(
        x=state.x,
        y=state.y,
        reach_x=body.length / 2 + body.width / 2 * sine + aside,
        reach_y=body.length / 2 * sine + body.width / 2 + aside,
        moved=moved,
    )


def may_touch(one: Extent, other: Extent) -> Array:
    """Whether two vehicles may touch now or in the coming tick.

    A necessary condition. Rectangles a distance D apart have a gap of at least D / sqrt(2) along one of their edge
    normals, and the full test lengthens intervals by no more than the relative displacement r of one tick. So they
    cannot touch where upright boxes that hold them are more than sqrt(2) |r| apart in x or in y. |r| is at most the
    difference of the ways, as if both were along the road, and what the boxes have been enlarged by for their headings.
    """
    moved_apart = jnp.abs(other.moved - one.moved)
    near_x = jnp.abs(other.x - one.x) <= other.reach_x + one.reach_x + moved_apart
    near_y = jnp.abs(other.y - one.y) <= other.reach_y + one.reach_y + moved_apart
    return near_x & near_y


def close_to_next(all_: Extent, following: Extent, n_next: int) -> UInt32[Array, "places *scenarios"]:
    """Which of the next places each vehicle may touch somebody in, as bits, the next one lowest.

    Args:
        all_: The vehicles by place.
        following: Those after the first place, by place, with as many beyond the last as are looked at.
        n_next: Places that are looked at.
    """
    n_places = all_.x.shape[0]
    close = jnp.zeros(all_.x.shape, jnp.uint32)
    for places in range(n_next):
        other = jax.tree.map(lambda values, k=places: values[k : k + n_places], following)
        close = close | jnp.where(may_touch(all_, other), jnp.uint32(1 << places), jnp.uint32(0))
    return close


def contact(
    one: Rectangle, other: Rectangle, is_pair: Bool[Array, " pairs"], model: TrafficModel
) -> tuple[Array, Array, Array, Array]:
    """Whether vehicles touch, whether they will within a tick, and the shift of `one` that prevents it (x, y) [m].

    Args:
        one: Vehicles of lower list index.
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
