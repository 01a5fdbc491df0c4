"""Broad phase of collision detection: pairs of vehicles whose bounding boxes overlap.

In small traffic the boxes of every pair are tested. In large traffic that would cost a pass over all vehicles for every
crashed vehicle, and among a thousand vehicles some have usually crashed. Therefore the vehicles are sorted along the
road and swept (sweep and prune): every vehicle is tested against the next WINDOW vehicles ahead. If vehicles have piled
up, a vehicle beyond this window may still be within reach. The few vehicles concerned are tested against further
windows, in blocks, until no vehicle is left within reach.

Source: Cohen et al., I-COLLIDE, Symposium on Interactive 3D Graphics (1995) (sweep and prune).
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, UInt32

from rearl_jax.core.compaction import Block, if_any, list_vehicles, process_in_blocks
from rearl_jax.core.contacts import BoundingBox, may_touch, overlaps_next
from rearl_jax.core.drivers import Body
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.narrow_phase import Collisions, Places, check_ahead, check_candidates
from rearl_jax.core.order import flat_index, take_vehicles
from rearl_jax.core.state import TrafficState

WINDOW = 8
"""Number of vehicles ahead that are tested in one pass; each vehicle has one bit per tested vehicle."""

VEHICLES_PER_SWEPT = 64
"""A block of vehicles that are tested further ahead has room for one of this many vehicles."""


def candidates_in_list(boxes: BoundingBox) -> UInt32[Array, "vehicles *scenarios"]:
    """For each vehicle, as bits, those among the next half of all vehicles in the list whose boxes overlap its box.

    The list is treated as circular, so every pair is tested once.
    """
    n_next = boxes.x.shape[0] // 2
    following = jax.tree.map(lambda values: jnp.concatenate([values[1:], values[:n_next]]), boxes)
    return overlaps_next(boxes, following, n_next)


def sweep_and_prune(
    boxes: BoundingBox, state: TrafficState, body: Body, collisions: Collisions, model: TrafficModel
) -> Collisions:
    """Collisions after all pairs whose boxes overlap have been tested in full.

    Args:
        boxes: Boxes of all vehicles, by vehicle.
        state: The traffic; its order along the road is up to date.
        body: Sizes of the vehicles.
        collisions: Collisions found so far.
        model: Traffic model; only its time step is used.
    """
    order = state.order
    by_place = jax.tree.map(lambda values: take_vehicles(values, order), boxes)
    reach = by_place.reach_x + jnp.abs(by_place.scaled_displacement)
    farthest = by_place.x + reach + _largest(reach)
    no_vehicle = jnp.zeros(order.shape, jnp.uint32), jnp.zeros(order.shape, bool)
    candidates, has_more = if_any(body.collides, lambda: _first_window(by_place, farthest), no_vehicle)
    places = Places(state, body, flat_index(order).ravel())
    collisions = check_candidates(candidates, places, collisions, model)
    return lax.cond(
        jnp.any(has_more),
        lambda collisions: _sweep_further(has_more, by_place, farthest, places, collisions, model),
        lambda collisions: collisions,
        collisions,
    )


def _largest(values: Float[Array, "vehicles *scenarios"]) -> Float[Array, "1 *scenarios"]:
    """The largest value of each scenario, by repeated halving; XLA's reduction along this axis is ten times as slow on
    a CPU.
    """
    while (n := values.shape[0]) > 1:
        values = jnp.maximum(values[: (n + 1) // 2], values[n // 2 :])
    return values


def _first_window(
    by_place: BoundingBox, farthest: Float[Array, "vehicles *scenarios"]
) -> tuple[UInt32[Array, "vehicles *scenarios"], Bool[Array, "vehicles *scenarios"]]:
    """By place, the overlaps with the next WINDOW vehicles, as bits, and whether there may be overlaps further ahead.

    Args:
        by_place: Boxes of all vehicles.
        farthest: Position beyond which no vehicle can be touched [m].
    """
    scenario_axes = by_place.x.shape[1:]

    def from_next(values: Array, filling: float = 0) -> Array:
        return jnp.pad(values[1:], [(0, WINDOW)] + [(0, 0)] * len(scenario_axes), constant_values=filling)

    # The places filled in after the last vehicle are infinitely far away.
    ahead = replace(jax.tree.map(from_next, by_place), x=from_next(by_place.x, jnp.inf))
    # Positions rise with the place, so if the last vehicle of a window is out of reach, all further vehicles are.
    return overlaps_next(by_place, ahead, WINDOW), ahead.x[WINDOW - 1 :] <= farthest


def _sweep_further(
    has_more: Bool[Array, "vehicles *scenarios"],
    by_place: BoundingBox,
    farthest: Float[Array, "vehicles *scenarios"],
    places: Places,
    collisions: Collisions,
    model: TrafficModel,
) -> Collisions:
    """Collisions after the pairs beyond the first window have also been tested.

    Args:
        has_more: By place, whether a vehicle beyond the first window may be touched.
        by_place: Boxes of all vehicles.
        farthest: Position beyond which no vehicle can be touched [m].
        places: The traffic by place.
        collisions: Collisions found so far.
        model: Traffic model; only its time step is used.
    """
    n_places = has_more.size
    flat_boxes, flat_farthest = jax.tree.map(jnp.ravel, (by_place, farthest))
    window = lax.iota(jnp.int32, WINDOW)
    bit = (jnp.uint32(1) << window.astype(jnp.uint32))[None]

    def sweep(block: Block, collisions: Collisions) -> Collisions:
        place = block.index[:, None]
        rear, farthest = jax.tree.map(lambda values: values[place], (flat_boxes, flat_farthest))

        def check_window(progress: tuple[Array, Array, Collisions]) -> tuple[Array, Array, Collisions]:
            first, has_more, collisions = progress
            ahead = place + (first + window)[None] * places.n_scenarios
            is_there = (ahead < n_places) & has_more[:, None]
            other = jax.tree.map(lambda values: values[jnp.minimum(ahead, n_places - 1)], flat_boxes)
            bits = jnp.where(may_touch(rear, other) & is_there, bit, jnp.uint32(0))
            collisions = check_ahead(
                block.index, jnp.sum(bits, axis=1, dtype=jnp.uint32), first, places, collisions, model
            )
            return first + WINDOW, (is_there & (other.x <= farthest))[:, -1], collisions

        start = jnp.int32(1 + WINDOW), block.is_filled, collisions
        return lax.while_loop(lambda progress: jnp.any(progress[1]), check_window, start)[2]

    return process_in_blocks(list_vehicles(has_more), n_places // VEHICLES_PER_SWEPT + 1, sweep, collisions)
