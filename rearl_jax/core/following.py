"""One driver model of measured and simulated traffic: a car-following model with effects at their hooks.

Effects act in the order in which they are listed; none of them leaves the bare model.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus

HARDEST_BRAKING, HARDEST_ACCELERATION = -9.0, 6.0
"""Bounds of what a vehicle can do [m/s^2]: tyre grip on a dry road; the strongest engine."""


def begin_effects(effects: tuple[Effect, ...], seen: Stimulus, driver: CarFollowing, dt: float) -> tuple[PyTree, ...]:
    """What the effects remember at the start, one entry per effect.

    Args:
        effects: The effects of the model.
        seen: What the drivers see at the start.
        driver: Their car-following model.
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
    """Acceleration [m/s^2], bounded, and what the effects remember afterwards.

    Args:
        seen: What each driver sees now.
        driver: Their car-following model.
        effects: What acts on them beyond it.
        memory: What the effects remember.
        last: Acceleration of the last call [m/s^2].
        dt: Time since then [s].
    """
    seen, memory = take_in(seen, driver, effects, memory, dt)
    wanted = respond(seen, with_wishes(seen, driver, effects, memory), effects, memory)
    return actuate(wanted, last, effects, dt), memory


def take_in(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...], dt: float
) -> tuple[Stimulus, tuple[PyTree, ...]]:
    """What the drivers take the situation for, and what the effects remember of it.

    Each effect sees what those before it have made of the situation: errors are delayed, a delayed situation is kept in
    mind. Arguments as of `follow`.
    """
    remembered = []
    for effect, held in zip(effects, memory, strict=True):
        remembered.append(effect.remember(held, seen, driver, dt))
        seen = effect.perceive(seen, remembered[-1])
    return seen, tuple(remembered)


def with_wishes(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> CarFollowing:
    """The drivers with desired speed, time gap and gap at standstill as the effects leave them.

    Args:
        seen: What the drivers take the situation for.
        driver: Their car-following model.
        effects: What acts on them beyond it.
        memory: What the effects remember, this moment included.
    """
    desired_speed, time_gap, jam_gap = driver.desired_speed, driver.time_gap, driver.jam_gap
    for effect, held in zip(effects, memory, strict=True):
        desired_speed = effect.desired_speed(desired_speed, seen, held)
        time_gap = effect.time_gap(time_gap, seen, held)
        jam_gap = effect.standstill_gap(jam_gap, seen, held)
    return driver.with_wishes(desired_speed, time_gap, jam_gap)


def respond(
    seen: Stimulus, driver: CarFollowing, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> Float[Array, "*n"]:
    """Acceleration that drivers want [m/s^2], within what a vehicle can do.

    `driver` is that of `with_wishes`; the other arguments as there.
    """
    behind = seen.has_leader * driver.interaction(seen.gap, seen.speed, seen.speed - seen.leader_speed)
    for effect, held in zip(effects, memory, strict=True):
        behind = effect.leaders(behind, seen, held, driver)
    acceleration = driver.free_acceleration(seen.speed) - behind
    for effect, held in zip(effects, memory, strict=True):
        acceleration = effect.acceleration(acceleration, seen, held)
    return jnp.clip(acceleration, HARDEST_BRAKING, HARDEST_ACCELERATION)


def actuate(
    wanted: Float[Array, "*n"], last: Float[Array, "*#n"], effects: tuple[Effect, ...], dt: float
) -> Float[Array, "*n"]:
    """Acceleration that vehicles execute [m/s^2].

    Args:
        wanted: Acceleration that the drivers want [m/s^2].
        last: Acceleration executed in the last time step [m/s^2].
        effects: What acts on the vehicles.
        dt: Time step [s].
    """
    for effect in effects:
        wanted = effect.actuate(wanted, last, dt)
    return wanted
