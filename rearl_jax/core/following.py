"""The driver model of measured and simulated traffic: a car-following model with effects.

Effects act in the order in which they are listed.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from rearl_jax.core.car_following.model import LEAST_DESIRED_SPEED, LEAST_TIME_GAP, CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus

HARDEST_BRAKING, HARDEST_ACCELERATION = -9.0, 6.0
"""Bounds of the acceleration of vehicles [m/s^2]: tyre grip on a dry road; the strongest engine."""


def begin_effects(effects: tuple[Effect, ...], seen: Stimulus, driver: CarFollowing, dt: float) -> tuple[PyTree, ...]:
    """Memory of the effects at the start, one entry per effect.

    Args:
        effects: The effects of the model.
        seen: Stimulus at the start.
        driver: Car-following model of the drivers.
        dt: Time from one call of `follow` to the next [s].
    """
    return tuple(effect.begin(seen, driver, dt) for effect in effects)


def follow(
    seen: Stimulus,
    driver: CarFollowing,
    effects: tuple[Effect, ...],
    memory: tuple[PyTree, ...],
    last: Float[Array, "*#n"],
    dt: float,
) -> tuple[Float[Array, "*n"], tuple[PyTree, ...]]:
    """Bounded acceleration [m/s^2], and the memory of the effects after this time step.

    Args:
        seen: Present stimulus of each driver.
        driver: Car-following model of the drivers.
        effects: Effects that act on the model.
        memory: Memory of the effects.
        last: Acceleration at the last call [m/s^2].
        dt: Time since the last call [s].
    """
    seen, memory = perceive(seen, driver, effects, memory, dt)
    wanted = respond(seen, adjust_setpoints(seen, driver, effects, memory), effects, memory)
    return actuate(wanted, last, effects, dt), memory


def perceive(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...], dt: float
) -> tuple[Stimulus, tuple[PyTree, ...]]:
    """Perceived stimulus, and the memory of the effects including it.

    Each effect receives the stimulus changed by the effects before it; for example, a delay also delays errors of
    perception listed before it, and action points listed after it hold the delayed stimulus. Arguments as in `follow`.
    """
    updated = []
    for effect, own_memory in zip(effects, memory, strict=True):
        updated.append(effect.remember(own_memory, seen, driver, dt))
        seen = effect.perceive(seen, updated[-1])
    return seen, tuple(updated)


def adjust_setpoints(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> CarFollowing:
    """The drivers with desired speed, time gap and standstill gap changed by the effects.

    Args:
        seen: Stimulus as the drivers perceive it.
        driver: Car-following model of the drivers.
        effects: Effects that act on the model.
        memory: Memory of the effects, this time step included.
    """
    desired_speed, time_gap, jam_gap = driver.desired_speed, driver.time_gap, driver.jam_gap
    for effect, own_memory in zip(effects, memory, strict=True):
        desired_speed = effect.desired_speed(desired_speed, seen, own_memory)
        time_gap = effect.time_gap(time_gap, seen, own_memory)
        jam_gap = effect.standstill_gap(jam_gap, seen, own_memory)
    # Reductions by several effects, or shares above 1, could make these values negative.
    desired_speed = jnp.maximum(desired_speed, LEAST_DESIRED_SPEED)
    time_gap, jam_gap = jnp.maximum(time_gap, LEAST_TIME_GAP), jnp.maximum(jam_gap, 0.0)
    return driver.with_setpoints(desired_speed, time_gap, jam_gap)


def respond(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> Float[Array, "*n"]:
    """Wanted acceleration [m/s^2], within the bounds of a vehicle.

    `driver` is the result of `adjust_setpoints`; the other arguments are those of this function.
    """
    interaction = seen.has_leader * driver.interaction(seen.gap, seen.speed, seen.speed - seen.leader_speed)
    for effect, own_memory in zip(effects, memory, strict=True):
        interaction = effect.leaders(interaction, seen, own_memory, driver)
    acceleration = driver.free_acceleration(seen.speed) - interaction
    for effect, own_memory in zip(effects, memory, strict=True):
        acceleration = effect.acceleration(acceleration, seen, own_memory)
    return jnp.clip(acceleration, HARDEST_BRAKING, HARDEST_ACCELERATION)


def actuate(
    wanted: Float[Array, "*n"], last: Float[Array, "*#n"], effects: tuple[Effect, ...], dt: float
) -> Float[Array, "*n"]:
    """Acceleration that vehicles execute [m/s^2].

    Args:
        wanted: Acceleration that the drivers want [m/s^2].
        last: Acceleration executed in the last time step [m/s^2].
        effects: Effects on the vehicles.
        dt: Time step [s].
    """
    for effect in effects:
        wanted = effect.actuate(wanted, last, dt)
    return wanted
