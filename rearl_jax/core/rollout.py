"""Rollouts: simulation of many scenarios in lockstep, in seconds between decisions."""

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
from rearl_jax.core.state import TrafficState, nearest_lane
from rearl_jax.core.step import step_in_order


class Frames(eqx.Module):
    """The traffic after each decision second, `[n_steps, n_vehicles, *n_scenarios]`; one frame has no steps axis.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        heading: Heading [rad].
        speed: Speed [m/s].
        acceleration: Acceleration executed in the last time step of the second [m/s^2].
        lane: Nearest lane.
        crashed: Whether the vehicle has been in a collision.
        left_crashed: Vehicles of the place that had been in one when others took their place, so far; None if none do.
    """

    x: Float[Array, "*frames"]
    y: Float[Array, "*frames"]
    heading: Float[Array, "*frames"]
    speed: Float[Array, "*frames"]
    acceleration: Float[Array, "*frames"]
    lane: Int[Array, "*frames"]
    crashed: Bool[Array, "*frames"]
    left_crashed: Int[Array, "*frames"] | None = None


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
        left_crashed=state.left_crashed,
    )


def simulate_second(
    state: TrafficState, drivers: Drivers, model: TrafficModel, around: BoundarySecond | None = None
) -> TrafficState:
    """State one decision second later.

    Args:
        state: The traffic.
        drivers: Parameters of all vehicles.
        model: Road, clock and stages.
        around: What was recorded around the traffic in this second; None for a free road. Vehicles that enter at its
            end are in the state.
    """
    state = sort_if_large(state)
    if around is not None:

        def step(before: TrafficState, motion: Motion) -> tuple[TrafficState, None]:
            replayed = replayed_vehicles(motion, around.identity)
            return step_in_order(before, drivers, model, replayed), None

        return enter(lax.scan(step, state, around.motion)[0], around, drivers, model)
    return lax.fori_loop(0, model.ticks_per_second, lambda _, before: step_in_order(before, drivers, model), state)


def rollout(
    state: TrafficState,
    drivers: Drivers,
    model: TrafficModel,
    *,
    n_seconds: int,
    actions: Int[Array, "steps vehicles *scenarios"] | None = None,
    boundary: Boundary | None = None,
) -> tuple[TrafficState, Frames]:
    """State after some decision seconds, and a frame after each of them.

    Args:
        state: Initial state.
        drivers: Parameters of all vehicles.
        model: Road, clock and stages.
        n_seconds: Decision seconds to simulate [s].
        actions: Meta-actions at the start of each second, for META vehicles; None for none.
        boundary: What was recorded around the traffic; None for a free road.

    Raises:
        ValueError: The boundary is shorter than the rollout.
    """

    # Without the barrier XLA propagates constants of the initial state into the loop, which costs a third of the speed.
    state, drivers = lax.optimization_barrier((state, drivers))

    @jax.checkpoint  # a gradient recomputes each second instead of keeping every time step of the rollout
    def second(before: TrafficState, inputs: Any) -> tuple[TrafficState, Frames]:
        action, around = inputs, None
        if boundary is not None:
            action, number = inputs
            around = boundary.second(number)
        if action is not None:
            before = apply_meta_actions(before, action, model)
        after = simulate_second(before, drivers, model, around)
        return after, frame_of(after, model)

    inputs = actions
    if boundary is not None:
        boundary.require(n_seconds)
        inputs = actions, jnp.arange(n_seconds, dtype=jnp.int32)
    return lax.scan(second, state, inputs, length=n_seconds)
