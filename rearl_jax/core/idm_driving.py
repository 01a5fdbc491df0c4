"""Traffic with highway-env's drivers: IDM for car following, MOBIL for lane changes."""

import math
from dataclasses import replace
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.car_following.highway_env_idm import HighwayEnvIDM
from rearl_jax.core.compaction import (
    Block,
    gather,
    if_any,
    list_vehicles,
    process_in_blocks,
    scatter,
    take_columns,
)
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.driving import Driving
from rearl_jax.core.mobil import acceleration_behind, decide_lanes, evaluate_lanes, is_due, lane_gains
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import Candidates, DerivedState, find_leader
from rearl_jax.core.state import Controller, TrafficState

VEHICLES_PER_SEARCHER = 12
"""A block of vehicles that search other lanes has room for one of this many vehicles: in a time step one vehicle in 16
decides about its lane, and at most as many are changing lanes.
"""

Values = TypeVar("Values")

_Followers = tuple[TrafficState, DerivedState, Float[Array, "n *s"], Drivers]
"""Vehicles, their derived quantities, their accelerations on a free road [m/s^2], their parameters."""

_Deciders = tuple[TrafficState, DerivedState, Float[Array, "n *s"], Float[Array, "n *s"], Drivers]
"""Vehicles, their derived quantities, their accelerations on a free road and behind their leaders [m/s^2], their
parameters.
"""


def drive_by_idm(state: TrafficState, derived: DerivedState, drivers: Drivers, model: TrafficModel) -> Driving:
    """Accelerations behind the leaders, and target lanes."""
    follows = state.controller == Controller.IDM
    if model.meta_follows:
        follows = state.controller != Controller.ABSENT
    assert isinstance(drivers.car_following, HighwayEnvIDM)  # all others drive by gaps
    free = drivers.car_following.free_acceleration_at(speed_ratio=derived.speed_ratio)

    all_vehicles = state, derived, free, drivers
    own_acceleration = if_any(follows, lambda: _behind_leader(all_vehicles, derived.lane), jnp.zeros_like(state.x))

    def acceleration_on(lane: Int[Array, "vehicles *scenarios"]) -> Float[Array, "vehicles *scenarios"]:
        return _behind_other_leader(all_vehicles, lane, follows & (lane != derived.lane))

    target_lane = state.target_lane
    if model.lane_changes:
        target_lane = _choose_lanes(state, derived, free, own_acceleration, drivers, model)
    return Driving(state, own_acceleration, target_lane, acceleration_on)


def _behind_leader(followers: _Followers, lane: Array, among: Candidates | None = None) -> Float[Array, "n *s"]:
    """Acceleration behind the leader on a lane [m/s^2]."""
    state, derived, free, drivers = followers
    return acceleration_behind(free, state, derived, find_leader(state, derived, lane, among), drivers)


def _behind_other_leader(all_vehicles: _Followers, lane: Array, searches: Bool[Array, "n *s"]) -> Float[Array, "n *s"]:
    """Acceleration on another lane [m/s^2] for the vehicles that search it, few in large traffic; 0 for all others."""
    zeros = jnp.zeros_like(all_vehicles[0].x)

    def of_all() -> Float[Array, "n *s"]:
        return if_any(searches, lambda: _behind_leader(all_vehicles, lane), zeros)

    state, derived, free, drivers = all_vehicles
    if not _is_treated_in_blocks(derived):
        return of_all()
    members = list_vehicles(searches)
    block = members.block(0, _block_size(state))

    def of_block() -> Float[Array, "n *s"]:
        own_state, own_derived, candidates = _of_block(block, state, derived)
        own_free, own_drivers, own_lane = _gathered(block.index, (free, drivers, lane), state)
        followers = own_state, own_derived, own_free, own_drivers
        return scatter(_behind_leader(followers, own_lane, candidates), block.index, block.is_filled, zeros)

    return lax.cond(members.count <= _block_size(state), of_block, of_all)


def _choose_lanes(
    state: TrafficState,
    derived: DerivedState,
    free: Array,
    own_acceleration: Array,
    drivers: Drivers,
    model: TrafficModel,
) -> Int[Array, "vehicles *scenarios"]:
    """Target lanes.

    In large traffic, and in small traffic among replayed vehicles, only drivers whose decision is due search the
    adjacent lanes, block by block. No decision depends on another, so it does not matter which vehicles share a block.
    """
    due = is_due(state, derived, drivers)
    if not _is_treated_in_blocks(derived) and not _is_small_among_replayed(derived):
        return _decided_lanes((state, derived, free, own_acceleration, drivers), due, model)
    # A decision has no derivative.
    state, derived, free, own_acceleration, drivers = lax.stop_gradient(
        (state, derived, free, own_acceleration, drivers)
    )

    is_large = _is_treated_in_blocks(derived)
    of_block = _of_block if is_large else _of_block_among_replayed

    def decide(block: Block, target_lane: Array) -> Array:
        own_state, own_derived, candidates = of_block(block, state, derived)
        index = block.index if is_large else block.index[None]
        deciders = own_state, own_derived, *_gathered(index, (free, own_acceleration, drivers), state)
        decided = _decided_lanes(deciders, block.is_filled.reshape(index.shape), model, candidates)
        return scatter(decided.ravel(), block.index, block.is_filled, target_lane)

    return process_in_blocks(list_vehicles(due), _block_size(state), decide, state.target_lane)


def _is_treated_in_blocks(derived: DerivedState) -> bool:
    """True in large traffic without replayed vehicles; the arrays of these cannot be gathered by simulated vehicle."""
    return derived.nearest is not None and derived.replayed is None


def _is_small_among_replayed(derived: DerivedState) -> bool:
    """True in small traffic with replayed vehicles: to search these for all vehicles costs more than to copy them for
    the few vehicles that decide.
    """
    return derived.nearest is None and derived.replayed is not None


def _block_size(state: TrafficState) -> int:
    """Places of a block of vehicles that search other lanes."""
    return state.x.size // VEHICLES_PER_SEARCHER + 2


def _gathered(index: Int[Array, "*block"], values: Values, state: TrafficState) -> Values:
    """Values of the vehicles in a block."""
    return jax.tree.map(lambda leaf: gather(leaf, index, state.x.shape), values)


def _of_block(
    block: Block, state: TrafficState, derived: DerivedState
) -> tuple[TrafficState, DerivedState, Candidates]:
    """The vehicles of a block in large traffic, their derived quantities, and the candidates that they search."""
    assert derived.nearest is not None  # always set in large traffic
    # Not gathered: memory has other axes than the vehicles, and the tables of neighbours have a block of their own.
    candidates = Candidates(replace(state, memory=None), replace(derived, nearest=None))
    gathered = _gathered(block.index, candidates, state)
    return gathered.state, replace(gathered.derived, nearest=derived.nearest.of_block(block.index)), candidates


def _of_block_among_replayed(
    block: Block, state: TrafficState, derived: DerivedState
) -> tuple[TrafficState, DerivedState, Candidates]:
    """Vehicles of a block and their candidates in small traffic with replayed vehicles: the candidates of each vehicle
    are those of its own scenario.
    """
    n_scenarios = math.prod(state.x.shape[1:])
    scenario = block.index % n_scenarios

    def of_scenarios(values: Values) -> Values:
        return jax.tree.map(lambda leaf: take_columns(leaf.reshape(-1, n_scenarios), scenario), values)

    candidates = Candidates(replace(state, memory=None), replace(derived, replayed=None))
    gathered = _gathered(block.index[None], candidates, state)
    among = of_scenarios(candidates)
    own_derived = replace(gathered.derived, replayed=of_scenarios(derived.replayed))
    return gathered.state, own_derived, Candidates(among.state, among.derived, block.index[None] // n_scenarios)


def _decided_lanes(
    deciders: _Deciders, due: Bool[Array, "n *s"], model: TrafficModel, among: Candidates | None = None
) -> Int[Array, "n *s"]:
    """Target lanes of the vehicles that decide; `among` as in `evaluate_lanes`."""
    state, derived, free, own_acceleration, drivers = deciders
    accelerations = evaluate_lanes(state, derived, free, own_acceleration, due, drivers, model, among)
    return decide_lanes(state, derived, due, accelerations, lane_gains(accelerations, drivers, model), drivers, model)
