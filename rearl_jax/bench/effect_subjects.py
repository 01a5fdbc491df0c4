"""What an effect costs: Base with one effect after the other switched on, as subjects of a measurement.

Effects act on the Intelligent Driver Model on gaps between bumpers, which highway-env's drivers do not use; so that
model without any effect is a subject too.
"""

from dataclasses import fields, replace
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Key

from rearl_jax.bench.batches import Batches
from rearl_jax.bench.loop_programs import effects_in, policy_in
from rearl_jax.bench.loop_subjects import BASE_MODEL, Batch, Scenes, loop_subject, rollout_subject
from rearl_jax.bench.synthetic_references import synthetic_references
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.detection.detector import DetectionOptions
from rearl_jax.detection.table import tabulate

DRIVER = (30.0, 1.5, 2.0, 1.4, 2.0)
"""Desired speed [m/s], time gap [s], jam gap [m], acceleration and deceleration [m/s^2] of all; own choice near
Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805.
"""

KNOTS = (5.0, 15.0, 25.0, 35.0)
"""Speeds at which the curves have their values [m/s]; own choice."""


def effect_rollouts(
    name: str, *, n_vehicles: int, density: float, seconds: int, batch: int, references: dict[str, int]
) -> Batches:
    """Rollouts with effects, ready to be measured.

    Args:
        name: One of `loop_programs.effect_programs`.
        n_vehicles: Vehicles per scenario.
        density: highway-env's `vehicles_density` [-].
        seconds: Simulated time of a rollout [s].
        batch: Scenarios at a time.
        references: Arguments of `synthetic_references`, for programs that hold the traffic against them.
    """
    scenes = Scenes(n_vehicles, density, tabulate(synthetic_references(**references), DetectionOptions().hist))
    effects = tuple(usual(effect) for effect in effects_in(name))
    following = IDM(*(jnp.full((1, 1), value) for value in DRIVER))

    def prepare(keys: Key[Array, " scenarios"]) -> Batch:
        drawn = scenes.draw(keys)
        drivers = replace(drawn.drivers, car_following=following, effects=effects)
        return replace(drawn, drivers=drivers, state=begin_driving(drawn.state, drivers, BASE_MODEL))

    policy = policy_in(name)
    subject = rollout_subject(prepare, seconds) if policy is None else loop_subject(policy, prepare, seconds)
    return Batches(subject, batch=batch, n_vehicles=n_vehicles, seconds=seconds)


def usual(name: str) -> Effect:
    """The effect at a strength that is often found: as far from off as a standard deviation of what is usual."""
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
    further = min(parameter.off + parameter.scale, parameter.high)
    return further if further != parameter.off else max(parameter.off - parameter.scale, parameter.low)
