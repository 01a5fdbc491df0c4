"""Replayed vehicles beside a few simulated ones.

Few vehicles look at other lanes in a time step: one in 16 decides about its lane, and a few are changing lanes. These
are treated in blocks, with the replayed vehicles of their scenarios copied beside them.
"""

import math

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.compaction import Block, gather, list_vehicles, process_in_blocks, scatter
from rearl_jax.core.neighbours import DerivedState, for_each_vehicle
from rearl_jax.core.replayed import Nearest, ReplayedBeside, ReplayedVehicles
from rearl_jax.core.state import TrafficState

ONE_IN_ASKED = 8
"""One vehicle in this many fits into a block: those that decide and those that change lanes, in busy traffic."""

SIDES = (-1, +1)
"""The lanes beside, relative to the own lane."""

_Found = tuple[Nearest, Nearest, Nearest, Nearest]
"""Ahead on the left and on the right lane, then behind on both."""


def search_beside(
    state: TrafficState, derived: DerivedState, asked: Bool[Array, "vehicles *scenarios"]
) -> ReplayedBeside:
    """The nearest replayed vehicles ahead and behind on the lanes beside those of some vehicles.

    Their positions count as constants in derivatives, those of the simulated vehicles do not.

    Args:
        state: The traffic.
        derived: Derived quantities of the traffic, with the replayed vehicles.
        asked: Vehicles that search; for all others there is nobody.
    """
    assert derived.replayed is not None  # nobody asks otherwise
    x, replayed = lax.stop_gradient((state.x, derived.replayed))
    nobody = Nearest(jnp.full_like(x, jnp.inf), jnp.zeros_like(x))

    def search(block: Block, found: _Found) -> _Found:
        own_x, own_lane = (gather(values, block.index, x.shape) for values in (x, derived.lane))
        near = _nearest(own_x, own_lane, _beside_block(replayed, block.index, x.shape))
        return tuple(  # type: ignore[return-value] # as many as there were
            Nearest(*(scatter(new, block.index, block.is_filled, old) for new, old in zip(*both, strict=True)))
            for both in zip(near, found, strict=True)
        )

    found = process_in_blocks(list_vehicles(asked), x.size // ONE_IN_ASKED + 2, search, (nobody,) * 4)
    moved = state.x - x  # zero, with the derivative of the position
    ahead = tuple(Nearest(one.distance - moved, one.speed) for one in found[:2])
    behind = tuple(Nearest(one.distance + moved, one.speed) for one in found[2:])
    return ReplayedBeside(derived.lane, ahead, behind)


def _beside_block(
    replayed: ReplayedVehicles, index: Int[Array, " block"], shape: tuple[int, ...]
) -> tuple[Float[Array, "replayed block"], Float[Array, "replayed block"], Int[Array, "replayed block"]]:
    """Positions, speeds and lanes of the replayed vehicles in the scenario of each vehicle of a block."""
    scenario = index % math.prod(shape[1:])
    columns = (values.reshape(len(values), -1) for values in (replayed.x, replayed.speed, replayed.lane))
    x, speed, lane = (values.at[:, scenario].get(mode="promise_in_bounds") for values in columns)
    return x, speed, lane


def _nearest(
    x: Float[Array, " block"],
    lane: Int[Array, " block"],
    replayed: tuple[Float[Array, "replayed block"], Float[Array, "replayed block"], Int[Array, "replayed block"]],
) -> _Found:
    """The nearest ones of each vehicle, the first in the list of equally near ones."""

    def visit(other: Int[Array, ""], found: _Found) -> _Found:
        other_x, other_speed, other_lane = (
            lax.dynamic_index_in_dim(values, other, 0, keepdims=False) for values in replayed
        )
        ahead_by, beside = other_x - x, other_lane - lane
        kept = []
        for distance, is_along, ends in ((ahead_by, ahead_by >= 0, found[:2]), (-ahead_by, ahead_by < 0, found[2:])):
            for side, nearest in zip(SIDES, ends, strict=True):
                is_nearer = (beside == side) & is_along & (distance < nearest.distance)
                pair = ((distance, nearest.distance), (other_speed, nearest.speed))
                kept.append(Nearest(*(jnp.where(is_nearer, new, old) for new, old in pair)))
        return tuple(kept)  # type: ignore[return-value] # four

    nobody = Nearest(jnp.full_like(x, jnp.inf), jnp.zeros_like(x))
    return for_each_vehicle(len(replayed[0]), visit, (nobody,) * 4)
