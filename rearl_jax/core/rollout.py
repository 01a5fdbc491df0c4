"""Rollouts: simulation of many scenarios in lockstep, second by second; decisions are taken between two seconds."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.boundary import Boundary, BoundarySecond, Motion, enter, replayed_vehicles
from rearl_jax.core.drivers import Drivers
from rearl_jax.core.meta_actions import apply_meta_actions
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.neighbours import sort_if_large
from rearl_jax.core.replayed import ReplayedVehicles
from rearl_jax.core.state import TrafficState, nearest_lane
from rearl_jax.core.step import step_in_order


class Frames(eqx.Module):
    """The traffic after each second, `[seconds, vehicles, *scenarios]`; one frame has no axis of seconds.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        heading: Heading [rad].
        speed: Speed [m/s].
        acceleration: Acceleration executed in the last time step of the second [m/s^2].
        lane: Nearest lane.
        crashed: Whether the vehicle has been in a collision.
        n_crashed_replaced: Crashed vehicles in the slot replaced by entering ones so far [count]; None if none enters.
    """

    x: Float[Array, "*frames"]
    y: Float[Array, "*frames"]
    heading: Float[Array, "*frames"]
    speed: Float[Array, "*frames"]
    acceleration: Float[Array, "*frames"]
    lane: Int[Array, "*frames"]
    crashed: Bool[Array, "*frames"]
    n_crashed_replaced: Int[Array, "*frames"] | None = None


def frame_of(state: TrafficState, model: TrafficModel) -> Frames:
    """Frame of a state."""
    return Frames(
        x=state.x,
        y=state.y,
        heading=state.heading,
        speed=state.speed,
        acceleration=state.acceleration,
        lane=nearest_lane(state.y, model),
        crashed=state.crashed,
        n_crashed_replaced=state.n_crashed_replaced,
    )


def simulate_second(
    state: TrafficState, drivers: Drivers, model: TrafficModel, boundary_second: BoundarySecond | None = None
) -> TrafficState:
    """State one second later.

    Args:
        state: The traffic.
        drivers: Parameters of all vehicles.
        model: Road, clock and stages.
        boundary_second: Recorded traffic around the vehicles in this second; None for a free road. The result
            contains the vehicles that enter at the end of the second.
    """
    if boundary_second is not None:
        return simulate_watched_second(state, drivers, model, boundary_second, lambda before, replayed: None)[0]
    state = sort_if_large(state)
    return lax.fori_loop(0, model.ticks_per_second, lambda _, before: step_in_order(before, drivers, model), state)


def simulate_watched_second(
    state: TrafficState,
    drivers: Drivers,
    model: TrafficModel,
    boundary_second: BoundarySecond,
    watch: Callable[[TrafficState, ReplayedVehicles], Any],
) -> tuple[TrafficState, Any]:
    """State one second later, and the results of `watch` at the beginning of each time step, step axis first.

    Args:
        state: The traffic.
        drivers: Parameters of all vehicles.
        model: Road, clock and stages.
        boundary_second: Recorded traffic around the vehicles in this second.
        watch: Function of the traffic and the replayed vehicles at the beginning of a step.
    """

    def step(before: TrafficState, motion: Motion) -> tuple[TrafficState, Any]:
        replayed = replayed_vehicles(motion, boundary_second.identity)
        return step_in_order(before, drivers, model, replayed), watch(before, replayed)

    after, results = lax.scan(step, sort_if_large(state), boundary_second.motion)
    return enter(after, boundary_second, drivers, model), results


def rollout(
    state: TrafficState,
    drivers: Drivers,
    model: TrafficModel,
    *,
    n_seconds: int,
    actions: Int[Array, "steps vehicles *scenarios"] | None = None,
    boundary: Boundary | None = None,
) -> tuple[TrafficState, Frames]:
    """State after some seconds, and a frame after each of them.

    Args:
        state: Initial state.
        drivers: Parameters of all vehicles.
        model: Road, clock and stages.
        n_seconds: Seconds to simulate [s].
        actions: Meta-actions at the start of each second, for META vehicles; None for none.
        boundary: Recorded traffic around the vehicles; None for a free road.

    Raises:
        ValueError: The boundary is shorter than the rollout.
    """

    # Without the barrier XLA propagates constants of the initial state into the loop, which costs a third of the speed.
    state, drivers = lax.optimization_barrier((state, drivers))

    @jax.checkpoint  # a gradient recomputes each second instead of keeping every time step of the rollout
    def second(before: TrafficState, inputs: Any) -> tuple[TrafficState, Frames]:
        action, boundary_second = inputs, None
        if boundary is not None:
            action, second_number = inputs
            boundary_second = boundary.second(second_number)
        if action is not None:
            before = apply_meta_actions(before, action, model)
        after = simulate_second(before, drivers, model, boundary_second)
        return after, frame_of(after, model)

    inputs = actions
    if boundary is not None:
        boundary.require_seconds(n_seconds)
        inputs = actions, jnp.arange(n_seconds, dtype=jnp.int32)
    return lax.scan(second, state, inputs, length=n_seconds)
