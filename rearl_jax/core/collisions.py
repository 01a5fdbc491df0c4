"""Collisions: which rectangles touch, and by how much they are pushed apart in the next tick.

Contact is rare, so the work is split. A cheap test of upright boxes (`rearl_jax.core.contacts`) tells who may touch
whom: in small traffic everybody is held against those who come next in the list, in large traffic against those who
come next along the road (`rearl_jax.core.pile_ups`). Only pairs that may touch are tested in full
(`rearl_jax.core.pairs`).

Source: highway-env 1.12.1, `Road.step`, `RoadObject.handle_collisions`.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, UInt32

from rearl_jax.core.affected import if_any
from rearl_jax.core.contacts import Extent, close_to_next, extent_of
from rearl_jax.core.drivers import Body
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import is_large
from rearl_jax.core.order import NOBODY
from rearl_jax.core.pairs import Found, Road, settle_close
from rearl_jax.core.pile_ups import settle_along_road
from rearl_jax.core.state import TrafficState


def collide(state: TrafficState, body: Body, model: TrafficModel) -> TrafficState:
    """State with everybody marked who touches somebody, and with the pushes of the coming tick.

    Args:
        state: The traffic; its order along the road is up to date.
        body: Sizes of the vehicles.
        model: The tick.
    """
    # Contact has no slope. Sizes must not carry one into the loops either, which, of unknown length, have no reverse
    # mode: the barrier of `rollout` gives everything that passes it a derivative, if only of zeros.
    shape = state.x.shape
    before, body = lax.stop_gradient((state, body))
    nobody = jnp.full(state.x.size, NOBODY, jnp.int32)
    found = Found(before.crashed.ravel(), nobody, before.push_x.ravel(), before.push_y.ravel())
    extent = extent_of(before, body, model)
    if is_large(shape[0]):
        found = settle_along_road(extent, before, body, found, model)
    else:
        close = if_any(body.collides, lambda: _close_in_list(extent), jnp.zeros(shape, jnp.uint32))
        found = settle_close(close, Road(before, body, vehicle=None), found, model)
    found = jax.tree.map(lambda values: values.reshape(shape), found)
    is_pushed = before.is_pushed | (found.partner != NOBODY)
    return replace(state, crashed=found.crashed, is_pushed=is_pushed, push_x=found.push_x, push_y=found.push_y)


def _close_in_list(extent: Extent) -> UInt32[Array, "vehicles *scenarios"]:
    """Which of the half of all vehicles that come next in the list each may touch, as bits.

    The list is a circle here, so every pair is looked at.
    """
    n_next = extent.x.shape[0] // 2
    following = jax.tree.map(lambda values: jnp.concatenate([values[1:], values[:n_next]]), extent)
    return close_to_next(extent, following, n_next)
