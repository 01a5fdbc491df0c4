"""Two tests of contact: axis-aligned boxes for the broad phase, rectangles for the narrow phase.

The test of boxes is fast and misses no contact; pairs that pass it are tested as rectangles, in the order of operations
of highway-env.
"""

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
"""Addition to the boxes [m], far above the rounding errors of distances, so that rounding cannot hide a contact."""


class BoundingBox(eqx.Module):
    """Axis-aligned bounding box of a vehicle, and its displacement in a time step, all in m.

    Attributes:
        x: Centre along the road.
        y: Centre across the road.
        reach_x: Half the length of the box, plus the bound of the error of `scaled_displacement` and ROUNDING_MARGIN.
        reach_y: Half the width of the box, plus the same.
        scaled_displacement: sqrt(2) times the displacement in a time step, as if the vehicle drove along the road.
    """

    x: Float[Array, "vehicles *scenarios"]
    y: Float[Array, "vehicles *scenarios"]
    reach_x: Float[Array, "vehicles *scenarios"]
    reach_y: Float[Array, "vehicles *scenarios"]
    scaled_displacement: Float[Array, "vehicles *scenarios"]


def bounding_boxes(state: TrafficState, body: Body, model: TrafficModel) -> BoundingBox:
    """Boxes of all vehicles.

    For a heading h, bounds that are faster to compute replace sine and cosine: |sin h| <= min(|h|, 1), and
    1 - cos h <= min(h^2 / 2, 2).

    Args:
        state: The traffic.
        body: Sizes of the vehicles.
        model: Traffic model; only its time step is used.
    """
    abs_heading = jnp.abs(state.heading)
    sine_bound, one_minus_cosine_bound = jnp.minimum(abs_heading, 1.0), jnp.minimum(abs_heading * abs_heading / 2, 2.0)
    scaled_displacement = state.speed * (float(np.sqrt(2)) * model.dt)
    displacement_error = jnp.abs(scaled_displacement) * (sine_bound + one_minus_cosine_bound) + ROUNDING_MARGIN
    return BoundingBox(
        x=state.x,
        y=state.y,
        reach_x=body.length / 2 + body.width / 2 * sine_bound + displacement_error,
        reach_y=body.length / 2 * sine_bound + body.width / 2 + displacement_error,
        scaled_displacement=scaled_displacement,
    )


def may_touch(first: BoundingBox, second: BoundingBox) -> Array:
    """Necessary condition for two vehicles to touch now or in the coming time step.

    If the distance between two rectangles is D, their projections on one of their edge normals are at least
    D / sqrt(2) apart. The narrow phase lengthens these projections by at most the length |r| of the relative
    displacement in a time step. So the vehicles cannot touch if their boxes are more than sqrt(2) |r| apart in x or in
    y. sqrt(2) |r| is at most the difference of the scaled displacements, plus the errors of both, which the boxes
    already include.
    """
    relative_displacement = jnp.abs(second.scaled_displacement - first.scaled_displacement)
    near_x = jnp.abs(second.x - first.x) <= second.reach_x + first.reach_x + relative_displacement
    near_y = jnp.abs(second.y - first.y) <= second.reach_y + first.reach_y + relative_displacement
    return near_x & near_y


def overlaps_next(boxes: BoundingBox, following: BoundingBox, n_next: int) -> UInt32[Array, "vehicles *scenarios"]:
    """Overlaps (`may_touch`) of each box with the next ones in the array, as bits: the lowest bit is the next box.

    Args:
        boxes: Boxes in the order of the array.
        following: The boxes from the second on, and `n_next` boxes after the last.
        n_next: Number of next boxes that each is tested against.
    """
    n_boxes = boxes.x.shape[0]
    overlaps = jnp.zeros(boxes.x.shape, jnp.uint32)
    for offset in range(n_next):
        other = jax.tree.map(lambda values, k=offset: values[k : k + n_boxes], following)
        overlaps = overlaps | jnp.where(may_touch(boxes, other), jnp.uint32(1 << offset), jnp.uint32(0))
    return overlaps


def contact(
    first: Rectangle, second: Rectangle, is_pair: Bool[Array, " pairs"], model: TrafficModel
) -> tuple[Array, Array, Array, Array]:
    """Contact of pairs of vehicles.

    Args:
        first: First vehicle of each pair, the one with the lower list index.
        second: Second vehicle of each pair.
        is_pair: Whether each pair is tested.
        model: Traffic model; only its time step is used.

    Returns:
        Whether the vehicles touch, whether they will touch within the time step, and the shift of the first vehicle
        along and across the road [m] that prevents the contact.
    """

    def test() -> tuple[Array, Array, Array, Array]:
        touches, will_touch, shift_x, shift_y = separate(first, second, model)
        diagonals = jnp.hypot(first.half_length, first.half_width) + jnp.hypot(second.half_length, second.half_width)
        is_near = jnp.hypot(second.x - first.x, second.y - first.y) <= diagonals + first.speed * model.dt
        is_tested = is_pair & is_near & (first.collides | second.collides)
        return touches & is_tested, will_touch & is_tested, shift_x, shift_y

    no_contact, no_shift = jnp.zeros(second.x.shape, bool), jnp.zeros_like(second.x)
    # A branch is compiled separately, so the test rounds in the same way for all callers. If XLA fused it with the code
    # around it, the last digit, which decides about vehicles that just touch, could depend on the caller.
    return if_any(is_pair, test, (no_contact, no_contact, no_shift, no_shift))
