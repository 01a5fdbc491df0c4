"""Recorded traffic around simulated vehicles: replayed vehicles, and vehicles that enter the simulation.

Replayed vehicles are not part of the simulated state. They have no driver, so only the searches for neighbours visit
them. All times are time steps of the simulation; the maker of a `Boundary` interpolates between recorded frames.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.compaction import take_columns
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.gap_driving import begin_driving, limited_desired_speed
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import Controller, TrafficState


class Motion(eqx.Module):
    """Motion of replayed vehicles at one time or several; fields as in `ReplayedVehicles`."""

    x: Float[Array, "*times replayed scenes"]
    speed: Float[Array, "*times replayed scenes"]
    acceleration: Float[Array, "*times replayed scenes"]
    lane: Int[Array, "*times replayed scenes"]


class Identity(eqx.Module):
    """Vehicles in the slots of the arrays during one second or several; fields as in `ReplayedVehicles`."""

    length: Float[Array, "*seconds replayed scenes"]
    is_truck: Float[Array, "*seconds replayed scenes"]
    number: Int[Array, "*seconds replayed scenes"]


class Entrants(eqx.Module):
    """Vehicles that enter the simulation in the slots of others, at the end of one second or several.

    Attributes:
        is_new: Whether a vehicle enters the slot; where it is false, the other values are undefined.
        x: Position of the centre along the road [m].
        lane: Lane.
        speed: Speed [m/s].
        highest_speed: Highest recorded speed of the vehicle [m/s], the upper bound of its driver's desired speed.
        wait: Time to the first lane-change decision as a share of the decision period, in [0, 1) [-].
    """

    is_new: Bool[Array, "*seconds vehicles scenes"]
    x: Float[Array, "*seconds vehicles scenes"]
    lane: Int[Array, "*seconds vehicles scenes"]
    speed: Float[Array, "*seconds vehicles scenes"]
    highest_speed: Float[Array, "*seconds vehicles scenes"]
    wait: Float[Array, "*seconds vehicles scenes"]


class BoundarySecond(eqx.Module):
    """Recorded traffic around the simulated vehicles in one second.

    Attributes:
        motion: Replayed vehicles at the beginning of each step.
        identity: Identity of the replayed vehicles.
        entrants: Vehicles that enter at the end of the second.
        after: Replayed vehicles at the end of the second, after the entrants have entered.
    """

    motion: Motion
    identity: Identity
    entrants: Entrants
    after: ReplayedVehicles


class Boundary(eqx.Module):
    """Recorded traffic around the simulated vehicles of some scenes.

    Attributes:
        motion: Replayed vehicles at the beginning of each step of each second, `[seconds, steps, replayed, scenes]`.
        identity: Identity of the replayed vehicles, `[seconds, replayed, scenes]`; a slot may hold
            another vehicle in the next second.
        entrants: Vehicles that enter at the end of each second, `[seconds, vehicles, scenes]`.
        scene: Index of the recorded scene that surrounds each simulated scenario.
    """

    motion: Motion
    identity: Identity
    entrants: Entrants
    scene: Int[Array | np.ndarray, " scenarios"]

    def require_seconds(self, n_seconds: int) -> None:
        """Raise ValueError if the surrounding traffic is not recorded up to the end of the last second."""
        n_recorded = self.motion.x.shape[0]
        if n_seconds >= n_recorded:
            raise ValueError(f"n_seconds = {n_seconds} exceeds the {n_recorded - 1} s of recorded surrounding traffic")

    def at_start(self) -> ReplayedVehicles:
        """Replayed vehicles at the beginning."""
        return replayed_vehicles(*self._of_scenarios((_at(_at(self.motion, 0), 0), _at(self.identity, 0))))

    def second(self, number: Int[Array, ""] | int) -> BoundarySecond:
        """One second, by its number from 0, for every scenario."""
        parts = _at(self.motion, number), _at(self.identity, number), _at(self.entrants, number)
        after = _at(_at(self.motion, number + 1), 0), _at(self.identity, number + 1)
        motion, identity, entrants, *after = self._of_scenarios((*parts, *after))
        return BoundarySecond(motion, identity, entrants, replayed_vehicles(*after))

    def _of_scenarios(self, values: tuple) -> tuple:
        """Values of the recorded scene around each scenario."""
        return jax.tree.map(lambda leaf: take_columns(leaf, jnp.asarray(self.scene)), values)


def replayed_vehicles(motion: Motion, identity: Identity) -> ReplayedVehicles:
    """Replayed vehicles from their motion and identity at one time."""
    return ReplayedVehicles(
        x=motion.x,
        speed=motion.speed,
        acceleration=motion.acceleration,
        lane=motion.lane,
        length=identity.length,
        is_truck=identity.is_truck,
        number=identity.number,
    )


def enter(state: TrafficState, boundary_second: BoundarySecond, drivers: Drivers, model: TrafficModel) -> TrafficState:
    """State at the end of a second after entering vehicles have replaced others in their slots.

    A vehicle enters in the middle of its lane at its recorded speed. Its driver has the parameters of the slot and an
    empty memory.
    """
    entrants = boundary_second.entrants
    zeros, no_vehicle = jnp.zeros_like(state.x), jnp.zeros_like(state.crashed)
    period = drivers.mobil.decision_period
    entered = replace(
        state,
        x=entrants.x,
        y=entrants.lane.astype(state.y.dtype) * model.lane_width,
        x_lost=zeros,
        y_lost=zeros,
        heading=zeros,
        speed=entrants.speed,
        acceleration=zeros,
        desired_speed=limited_desired_speed(entrants.highest_speed, drivers),
        target_lane=entrants.lane,
        ticks_to_decision=1 + jnp.floor(entrants.wait * period.astype(entrants.wait.dtype)).astype(jnp.int32),
        controller=jnp.full_like(state.controller, int(Controller.IDM)),
        crashed=no_vehicle,
        is_pushed=no_vehicle,
        push_x=zeros,
        push_y=zeros,
        memory=None,
    )
    shape, memory = state.x.shape, state.memory

    def where_entering(entered: Array, unchanged: Array) -> Array:
        """New values of entering vehicles; all others, and arrays without an axis of vehicles, are unchanged."""
        is_of_vehicles = unchanged.shape[-len(shape) :] == shape
        return jnp.where(entrants.is_new, entered, unchanged) if is_of_vehicles else unchanged

    n_crashed_replaced = state.n_crashed_replaced
    if n_crashed_replaced is not None:
        n_crashed_replaced = n_crashed_replaced + (entrants.is_new & state.crashed).astype(n_crashed_replaced.dtype)
    state = replace(
        jax.tree.map(where_entering, entered, replace(state, memory=None)), n_crashed_replaced=n_crashed_replaced
    )
    fresh = begin_driving(state, drivers, model, boundary_second.after, entrants.highest_speed)
    return replace(state, memory=jax.tree.map(where_entering, fresh.memory, memory))


def _at(values, index: Int[Array, ""] | int):
    """Values at an index of their first axis."""
    return jax.tree.map(lambda leaf: lax.dynamic_index_in_dim(leaf, index, 0, keepdims=False), values)
