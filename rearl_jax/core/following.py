"""One driver model of measured and simulated traffic: the Intelligent Driver Model with effects at their hooks.

Effects act in the order in which they are listed; none of them leaves the published model.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.stimulus import Stimulus
from rearl_jax.core.gap_idm import FollowingParams, free_term, gap_interaction

HARDEST_BRAKING, HARDEST_ACCELERATION = -9.0, 6.0
"""Bounds of what a vehicle can do [m/s^2]: tyre grip on a dry road; the strongest engine."""


def begin_effects(
    effects: tuple[Effect, ...], seen: Stimulus, params: FollowingParams, tick: float
) -> tuple[PyTree, ...]:
    """What the effects remember at the start, one entry per effect.

    Args:
        effects: The effects of the model.
        seen: What the drivers see at the start.
        params: Of the drivers.
        tick: Time from one call of `follow` to the next [s].
    """
    return tuple(effect.begin(seen, params, tick) for effect in effects)


def follow(
    seen: Stimulus,
    params: FollowingParams,
    effects: tuple[Effect, ...],
    memory: tuple[PyTree, ...],
    tick: float,
) -> tuple[Float[Array, "*n"], tuple[PyTree, ...]]:
    """Acceleration [m/s^2], bounded, and what the effects remember afterwards.

    Args:
        seen: What each driver sees now.
        params: Of the drivers.
        effects: What acts on them beyond IDM.
        memory: What the effects remember.
        tick: Time since the last call [s].
    """
    seen, memory = take_in(seen, params, effects, memory, tick)
    return respond(seen, present_params(seen, params, effects, memory), effects, memory), memory


def take_in(
    seen: Stimulus, params: FollowingParams, effects: tuple[Effect, ...], memory: tuple[PyTree, ...], tick: float
) -> tuple[Stimulus, tuple[PyTree, ...]]:
    """What the drivers take the situation for, and what the effects remember of it.

    Each effect sees what those before it have made of the situation: errors are delayed, a delayed situation is kept in
    mind. Arguments as of `follow`.
    """
    remembered = []
    for effect, held in zip(effects, memory, strict=True):
        remembered.append(effect.remember(held, seen, params, tick))
        seen = effect.perceive(seen, remembered[-1])
    return seen, tuple(remembered)


def present_params(
    seen: Stimulus, params: FollowingParams, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> FollowingParams:
    """The drivers' parameters with desired speed and time gap as the effects leave them.

    Args:
        seen: What the drivers take the situation for.
        params: Of the drivers.
        effects: What acts on them beyond IDM.
        memory: What the effects remember, this moment included.
    """
    desired_speed, time_gap = params.desired_speed, params.time_gap
    for effect, held in zip(effects, memory, strict=True):
        desired_speed = effect.desired_speed(desired_speed, seen, held)
        time_gap = effect.time_gap(time_gap, seen, held)
    return eqx.tree_at(lambda p: (p.desired_speed, p.time_gap), params, (desired_speed, time_gap))


def respond(
    seen: Stimulus, params: FollowingParams, effects: tuple[Effect, ...], memory: tuple[PyTree, ...]
) -> Float[Array, "*n"]:
    """Acceleration [m/s^2], bounded, of drivers with the parameters of `present_params`; other arguments as there."""
    behind = seen.has_leader * gap_interaction(seen.gap, seen.speed, seen.speed - seen.leader_speed, params)
    for effect, held in zip(effects, memory, strict=True):
        behind = effect.interaction(behind, seen, held, params)
    acceleration = params.max_accel * (1 - free_term(seen.speed, params.desired_speed) - behind)
    for effect, held in zip(effects, memory, strict=True):
        acceleration = effect.acceleration(acceleration, seen, held)
    return jnp.clip(acceleration, HARDEST_BRAKING, HARDEST_ACCELERATION)
