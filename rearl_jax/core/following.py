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
    memory = tuple(effect.remember(held, seen, params, tick) for effect, held in zip(effects, memory, strict=True))
    acting = tuple(zip(effects, memory, strict=True))
    for effect, held in acting:
        seen = effect.perceive(seen, held)
    desired_speed, time_gap = params.desired_speed, params.time_gap
    for effect, held in acting:
        desired_speed = effect.desired_speed(desired_speed, seen, held)
        time_gap = effect.time_gap(time_gap, seen, held)
    params = eqx.tree_at(lambda p: (p.desired_speed, p.time_gap), params, (desired_speed, time_gap))
    behind = seen.has_leader * gap_interaction(seen.gap, seen.speed, seen.speed - seen.leader_speed, params)
    for effect, held in acting:
        behind = effect.interaction(behind, seen, held, params)
    acceleration = params.max_accel * (1 - free_term(seen.speed, desired_speed) - behind)
    for effect, held in acting:
        acceleration = effect.acceleration(acceleration, seen, held)
    return jnp.clip(acceleration, HARDEST_BRAKING, HARDEST_ACCELERATION), memory
