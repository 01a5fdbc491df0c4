"""Two tests of contact: bounding boxes for the broad phase, rectangles for the narrow phase."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt32

from rearl_jax.core.compaction import if_any
from rearl_jax.core.drivers import Body
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rectangles import Rectangle, separate
from rearl_jax.core.state import TrafficState

ROUNDING_MARGIN = 1e-3
"""Margin [m] of the bounding-box test, far above rounding errors of distances between touching vehicles."""


class BoundingBox(eqx.Module):
    """Axis-aligned bounding box of a vehicle with its displacement in a time step, all in m.

    Attributes:
        x: Centre along the road.
        y: Centre across the road.
        reach_x: Half the length of the box, plus the part of a time step's displacement not contained in `moved`.
        reach_y: Half the width of the box, plus the corresponding part of a time step's displacement.
        moved: sqrt(2) times the displacement in a time step, taken as if it were along the road.
    """

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    reach_x: Float[Array, "vehicles *scenarios"]
    reach_y: Float[Array, "vehicles *scenarios"]
    moved: Float[Array, "vehicles *scenarios"]


def bounding_boxes(state: TrafficState, body: Body, model: TrafficModel) -> BoundingBox:
    """Boxes of all vehicles.

    Upper bounds replace sine and cosine: |sin h| <= min(|h|, 1), and 1 - cos h <= min(h^2 / 2, 2).

    Args:
        state: The traffic.
        body: Sizes of the vehicles.
        model: Traffic model; only its time step is used.
    """
    size = jnp.abs(state.heading)
    sine, missing_cosine = jnp.minimum(size, 1.0), jnp.minimum(size * size / 2, 2.0)
    moved = state.speed * (float(np.sqrt(2)) * model.dt)
    aside = jnp.abs(moved) * (sine + missing_cosine) + ROUNDING_MARGIN
    return BoundingBox(
        x=state.x,
        y=state.y,
        reach_x=body.length / 2 + body.width / 2 * sine + aside,
        reach_y=body.length / 2 * sine + body.width / 2 + aside,
        moved=moved,
    )


def may_touch(first: BoundingBox, second: BoundingBox) -> Array:
    """Necessary condition for two vehicles to touch now or in the coming time step.

    Rectangles a distance D apart have a gap of at least D / sqrt(2) along one of their edge normals, and the full test
    lengthens intervals by no more than the relative displacement r of one time step. So they cannot touch if boxes
    around them are more than sqrt(2) |r| apart in x or in y. |r| is at most the difference of the displacements, as if
    both were along the road, and what the boxes have been enlarged by for their headings.
    """
    moved_apart = jnp.abs(second.moved - first.moved)
    near_x = jnp.abs(second.x - first.x) <= second.reach_x + first.reach_x + moved_apart
    near_y = jnp.abs(second.y - first.y) <= second.reach_y + first.reach_y + moved_apart
    return near_x & near_y


def overlaps_next(boxes: BoundingBox, following: BoundingBox, n_next: int) -> UInt32[Array, "places *scenarios"]:
    """For each vehicle the next places whose boxes overlap its own (`may_touch`), as bits, the next one lowest.

    Args:
        boxes: Boxes by place.
        following: Boxes after the first place, by place, with `n_next` beyond the last.
        n_next: Places to test.
    """
    n_places = boxes.x.shape[0]
    overlaps = jnp.zeros(boxes.x.shape, jnp.uint32)
    for places in range(n_next):
        other = jax.tree.map(lambda values, k=places: values[k : k + n_places], following)
        overlaps = overlaps | jnp.where(may_touch(boxes, other), jnp.uint32(1 << places), jnp.uint32(0))
    return overlaps


def contact(
    first: Rectangle, second: Rectangle, is_pair: Bool[Array, " pairs"], model: TrafficModel
) -> tuple[Array, Array, Array, Array]:
    """Contact now, contact within a time step, and the shift of `first` that prevents it (x, y) [m].

    Args:
        first: Vehicles of lower list index.
        second: Partners of `first`, in the same order.
        is_pair: Whether each pair is tested.
        model: Traffic model; only its time step is used.
    """

    def test() -> tuple[Array, Array, Array, Array]:
        touches, will_touch, shift_x, shift_y = separate(first, second, model)
        diagonals = jnp.hypot(first.half_length, first.half_width) + jnp.hypot(second.half_length, second.half_width)
        is_near = jnp.hypot(second.x - first.x, second.y - first.y) <= diagonals + first.speed * model.dt
        is_tested = is_pair & is_near & (first.collides | second.collides)
        return touches & is_tested, will_touch & is_tested, shift_x, shift_y

    nowhere, nothing = jnp.zeros(second.x.shape, bool), jnp.zeros_like(second.x)
    # A branch is compiled separately, so the test has the same rounding wherever it is called. If it were fused into
    # its callers, vehicles in resting contact could be pushed by one caller and not by another.
    return if_any(is_pair, test, (nowhere, nowhere, nothing, nothing))
