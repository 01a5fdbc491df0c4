"""Traffic whose drivers are those of highway-env: IDM on the lane, MOBIL for the lanes beside."""

from dataclasses import replace
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.highway_env_idm import HighwayEnvIDM
from rearl_jax.core.compaction import Block, gather, if_any, list_vehicles, process_in_blocks, scatter
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.driving import Driving
from rearl_jax.core.mobil import decide_lanes, follow, is_due, lane_gains, weigh_lanes
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import Traffic, View, find_leader
from rearl_jax.core.state import Controller, TrafficState

ONE_IN_ASKED = 12
"""A block of vehicles that search other lanes has room for one in so many: one in 16 decides about its lane in a time
step, and no more are on their way to another lane.
"""

Values = TypeVar("Values")

_Followers = tuple[TrafficState, View, Float[Array, "n *s"], Drivers]
"""Who follows, what can be seen of them, their accelerations on a free road [m/s^2], their parameters."""

_Question = tuple[TrafficState, View, Float[Array, "n *s"], Float[Array, "n *s"], Drivers]
"""Who is asked, what can be seen of them, their accelerations on a free road and on their own lane [m/s^2], their
parameters.
"""


def weigh_idm(state: TrafficState, view: View, drivers: Drivers, model: TrafficModel) -> Driving:
    """What drivers want behind their leaders, and on which lane."""
    follows = state.controller == Controller.IDM
    if model.meta_follows:
        follows = state.controller != Controller.ABSENT
    assert isinstance(drivers.car_following, HighwayEnvIDM)  # only then are these rules used
    free = drivers.car_following.free_acceleration_at(speed_ratio=view.speed_ratio)

    everybody = state, view, free, drivers
    own = if_any(follows, lambda: _behind_leader(everybody, view.lane), jnp.zeros_like(state.x))

    def on_lane(lane: Int[Array, "vehicles *scenarios"]) -> Float[Array, "vehicles *scenarios"]:
        return _behind_other_leader(everybody, lane, follows & (lane != view.lane))

    target_lane = state.target_lane
    if model.lane_changes:
        target_lane = _choose_lanes(state, view, free, own, drivers, model)
    return Driving(state, own, target_lane, on_lane)


def _behind_leader(followers: _Followers, lane: Array, among: Traffic | None = None) -> Float[Array, "n *s"]:
    """Acceleration behind the leader on a lane [m/s^2]."""
    state, view, free, drivers = followers
    return follow(free, state, view, find_leader(state, view, lane, among), drivers)


def _behind_other_leader(everybody: _Followers, lane: Array, looks: Bool[Array, "n *s"]) -> Float[Array, "n *s"]:
    """Acceleration of those who look at another lane [m/s^2], who are few in large traffic; 0 for all others."""
    nothing = jnp.zeros_like(everybody[0].x)

    def of_all() -> Float[Array, "n *s"]:
        return if_any(looks, lambda: _behind_leader(everybody, lane), nothing)

    state, view, free, drivers = everybody
    if view.nearest is None:
        return of_all()
    listed = list_vehicles(looks)
    block = listed.block(0, _block_size(state))

    def of_lot() -> Float[Array, "n *s"]:
        own_state, own_view, traffic = _as_seen_by(block, state, view)
        own_free, own_drivers, own_lane = _taken(block, (free, drivers, lane), state)
        followers = own_state, own_view, own_free, own_drivers
        return scatter(_behind_leader(followers, own_lane, traffic), block.index, block.is_filled, nothing)

    return lax.cond(listed.count <= _block_size(state), of_lot, of_all)


def _choose_lanes(
    state: TrafficState, view: View, free: Array, own: Array, drivers: Drivers, model: TrafficModel
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes. In large traffic only drivers whose decision is due look around, as many at a time as have places.

    Nobody's decision depends on another's, so it does not matter who is asked together.
    """
    due = is_due(state, view, drivers)
    if view.nearest is None:
        return _chosen((state, view, free, own, drivers), due, model)
    # What is decided has no slope.
    state, view, free, own, drivers = lax.stop_gradient((state, view, free, own, drivers))

    def ask(block: Block, target_lane: Array) -> Array:
        own_state, own_view, traffic = _as_seen_by(block, state, view)
        question = own_state, own_view, *_taken(block, (free, own, drivers), state)
        return scatter(_chosen(question, block.is_filled, model, traffic), block.index, block.is_filled, target_lane)

    return process_in_blocks(list_vehicles(due), _block_size(state), ask, state.target_lane)


def _block_size(state: TrafficState) -> int:
    return state.x.size // ONE_IN_ASKED + 2


def _taken(block: Block, values: Values, state: TrafficState) -> Values:
    """A block's own of all vehicles' values."""
    return jax.tree.map(lambda leaf: gather(leaf, block.index, state.x.shape), values)


def _as_seen_by(block: Block, state: TrafficState, view: View) -> tuple[TrafficState, View, Traffic]:
    """Some vehicles of large traffic, what can be seen of them, and the traffic they look at."""
    assert view.nearest is not None  # large traffic is walked along
    # What drivers remember has other axes than those a block is gathered from.
    traffic = Traffic(replace(state, memory=None), replace(view, nearest=None))
    own = _taken(block, traffic, state)
    return own.state, replace(own.view, nearest=view.nearest.of_block(block.index)), traffic


def _chosen(
    question: _Question, due: Bool[Array, "n *s"], model: TrafficModel, among: Traffic | None = None
) -> Int[Array, "n *s"]:
    """Target lanes of those who are asked, all of the traffic or some `among` it."""
    state, view, free, own, drivers = question
    prospects = weigh_lanes(state, view, free, own, due, drivers, model, among)
    return decide_lanes(state, view, due, prospects, lane_gains(prospects, drivers, model), drivers, model)
