"""Rollouts that the loop's benchmark measures, by name: Base, the closed loop in several states, Base with effects.

Effects act on the Intelligent Driver Model with bumper-to-bumper gaps, which highway-env's drivers do not use. So that
model without effects is a program too.
"""

from dataclasses import fields, replace
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Key

from benchmarks.options import LoopPolicy
from rearl_jax.config.decision import MatcherConfig, MatchSpace, PolicyName
from rearl_jax.config.detection import Cues
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.decision.policies import make_policy
from rearl_jax.decision.situation import Policy
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.timing.batches import Batches
from rearl_jax.timing.decision_steps import (
    BASE,
    BASE_MODEL,
    LOOP_MODEL,
    Batch,
    Scenes,
    loop_subject,
    matcher,
    rollout_subject,
    synthetic_table,
)

NEVER = "never"
"""The closed loop that is never triggered: detection.cues=never, so nothing but the detection is left of it."""

FOLLOWING = "following"
"""The Intelligent Driver Model with bumper-to-bumper gaps, without effects."""

TWO_EFFECTS = "two_effects"
"""The same model with the effects `EFFECT_PAIR`."""

LOOP_WITH_TWO = "rank_two_effects"
"""The closed loop of the matcher by rank, triggered every second, on traffic with the effects `EFFECT_PAIR`."""

EFFECT_PAIR = ("reaction_delay", "several_leaders")
"""Two effects of drivers that are often found."""

DRIVER = (30.0, 1.5, 2.0, 1.4, 2.0)
"""Desired speed [m/s], time gap [s], jam gap [m], acceleration and deceleration [m/s^2] of all drivers; near
Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805.
"""

KNOTS = (5.0, 15.0, 25.0, 35.0)
"""Speeds at which the curves have their values [m/s]."""

_QUIET = "_quiet"


def quiet(policy: LoopPolicy) -> str:
    """Name of the closed loop with infinite thresholds: all is computed, no vehicle is asked, the traffic is Base's."""
    return policy.name + _QUIET


def always(policy: LoopPolicy) -> str:
    """Name of the closed loop that is triggered every second, with cues=always."""
    return policy.name


def programs_of(policies: tuple[LoopPolicy, ...]) -> tuple[str, ...]:
    """Names of all programs measured in turn."""
    return (BASE, NEVER, *(quiet(policy) for policy in policies), *(always(policy) for policy in policies))


def effect_programs(chosen: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of programs measured in turn with Base: no effect, each chosen effect, two effects, the loop with these.

    Args:
        chosen: Names of effects; None for all there are, empty for no program at all.

    Raises:
        InvalidInputError: There is no such effect.
    """
    if chosen is not None and (unknown := [name for name in chosen if name not in EFFECTS]):
        fault = f"must be of {', '.join(EFFECTS)}"
        raise InvalidInputError(Problem("choice-unknown", fault, key="loop.effects", value=unknown[0]))
    names = tuple(EFFECTS) if chosen is None else chosen
    return (FOLLOWING, *names, TWO_EFFECTS, LOOP_WITH_TWO) if names else ()


def rollouts(
    name: str, *, n_vehicles: int, density: float, seconds: int, batch: int, references: dict[str, int]
) -> Batches:
    """Rollouts of a program, ready to be measured.

    Raises:
        ValueError: There is no such program.
    """
    with_effects = {FOLLOWING: (), TWO_EFFECTS: EFFECT_PAIR, LOOP_WITH_TWO: EFFECT_PAIR}
    with_effects |= {effect: (effect,) for effect in EFFECTS}
    # `loop_subject` needs a policy also for NEVER, but XLA removes the policy if no vehicle is ever asked.
    loops = {LOOP_WITH_TWO: (LoopPolicy.rank, Cues.always), NEVER: (LoopPolicy.idle, Cues.never)}
    loops |= {quiet(policy): (policy, Cues.both) for policy in LoopPolicy}
    loops |= {always(policy): (policy, Cues.always) for policy in LoopPolicy}
    if name not in {BASE, *with_effects, *loops}:
        raise ValueError(f"there is no program {name!r} to measure")
    scenes = Scenes(n_vehicles, density, synthetic_table(references))
    following = IDM(*(jnp.full((1, 1), value) for value in DRIVER))
    effects = tuple(usual(effect) for effect in with_effects.get(name, ()))

    def prepare(keys: Key[Array, " scenarios"]) -> Batch:
        drawn = scenes.draw(keys)
        if name not in with_effects:
            return drawn
        drivers = replace(drawn.drivers, car_following=following, effects=effects)
        return replace(drawn, drivers=drivers, state=begin_driving(drawn.state, drivers, BASE_MODEL))

    if name in loops:
        policy, cues = loops[name]
        subject = loop_subject(policy_named(policy), prepare, seconds, cues)
    else:
        subject = rollout_subject(prepare, seconds)
    return Batches(subject, batch=batch, n_vehicles=n_vehicles, seconds=seconds)


def policy_named(name: LoopPolicy) -> Policy:
    """The policy of a measured loop, its options at their defaults."""
    if name is LoopPolicy.idle:
        return make_policy(PolicyName.idle, MatcherConfig(), LOOP_MODEL)
    return matcher(MatchSpace[name.name])


def usual(name: str) -> Effect:
    """The effect at a usual strength: one standard deviation of its prior (`Parameter.scale`) from being off."""
    kind = EFFECTS[name]
    numbers: dict[str, Any] = {item.name: jnp.asarray(_usual(item)) for item in kind.parameters}
    if "values" in numbers:
        curve = numbers["values"] * jnp.asarray([1.0, -1.0, 1.0, -1.0])
        numbers |= {"values": curve[:, None, None]}
    if "variable" in {item.name for item in fields(kind)}:
        numbers |= {"knots": jnp.asarray(KNOTS), "variable": "speed"}
    return kind(**numbers)


def _usual(parameter: Parameter) -> float:
    if not parameter.is_strength:
        return parameter.off
    above = min(parameter.off + parameter.scale, parameter.high)
    return above if above != parameter.off else max(parameter.off - parameter.scale, parameter.low)
