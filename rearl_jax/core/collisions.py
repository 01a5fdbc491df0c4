"""Collisions: detects rectangles that touch, and computes their displacement in the next time step.

Contact is rare, so detection has two phases. The broad phase (`rearl_jax.core.broad_phase`) finds pairs whose bounding
boxes overlap, the narrow phase (`rearl_jax.core.narrow_phase`) tests only those in full.

Source: highway-env 1.12.1, `Road.step`, `RoadObject.handle_collisions`.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax

from rearl_jax.core.broad_phase import candidates_in_list, sweep_and_prune
from rearl_jax.core.compaction import if_any
from rearl_jax.core.contacts import bounding_boxes
from rearl_jax.core.drivers import Body
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.narrow_phase import Collisions, Places, check_candidates
from rearl_jax.core.neighbours import is_large
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.core.state import TrafficState


def collide(state: TrafficState, body: Body, model: TrafficModel) -> TrafficState:
    """State with colliding vehicles marked, and with their displacements in the next time step.

    Args:
        state: The traffic; its order along the road is up to date.
        body: Sizes of the vehicles.
        model: Traffic model; only its time step is used.
    """
    # Contact has no derivative. Sizes must carry none into the loops either, because loops of unknown length have no
    # reverse mode; the barrier of `rollout` gives all values that pass it a derivative, even if it is zero.
    shape = state.x.shape
    before, body = lax.stop_gradient((state, body))
    no_vehicle = jnp.full(state.x.size, NO_VEHICLE, jnp.int32)
    collisions = Collisions(before.crashed.ravel(), no_vehicle, before.push_x.ravel(), before.push_y.ravel())
    boxes = bounding_boxes(before, body, model)
    if is_large(shape[0]):
        collisions = sweep_and_prune(boxes, before, body, collisions, model)
    else:
        candidates = if_any(body.collides, lambda: candidates_in_list(boxes), jnp.zeros(shape, jnp.uint32))
        collisions = check_candidates(candidates, Places(before, body, vehicle=None), collisions, model)
    collisions = jax.tree.map(lambda values: values.reshape(shape), collisions)
    is_pushed = before.is_pushed | (collisions.partner != NO_VEHICLE)
    return replace(
        state, crashed=collisions.crashed, is_pushed=is_pushed, push_x=collisions.push_x, push_y=collisions.push_y
    )
