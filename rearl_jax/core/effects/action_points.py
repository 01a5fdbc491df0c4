"""Drivers who act at discrete times only."""

from dataclasses import field, replace
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.randomness import no_seed, standard_uniform
from rearl_jax.core.effects.stimulus import Stimulus

SITUATION = (
    *("speed", "has_leader", "gap", "leader_speed", "leader_acceleration", "has_second", "second_gap"),
    *("second_speed", "has_third", "third_speed", "has_follower", "follower_gap", "follower_speed"),
    *("has_left", "left_gap", "left_speed", "beside_speed", "n_beside"),
)
"""Fields of the stimulus that stay constant between two decisions; position and time change."""


class LastDecision(eqx.Module):
    """Memory of the last decision.

    Attributes:
        count: Time steps so far.
        situation: Stimulus at the last decision, in the order of `SITUATION`.
    """

    count: Int[Array, ""]
    situation: Float[Array, "fields *n"]


class ActionPoints(Effect):
    """Drivers observe at random times, or when the acceleration of the bare model has changed much."""

    mean_time: Float[Array, "*#n"]
    threshold: Float[Array, "*#n"]
    seed: Int[Array, "*#seeds"] = field(default_factory=no_seed)

    name: ClassVar[str] = "action_points"
    kind: ClassVar[str] = "random"
    equation: ClassVar[str] = (
        "a = f(situation at the last action point); a new one at rate 1 / mean_time, and if the bare model's f has "
        "changed by more than threshold"
    )
    source: ClassVar[str] = "after Treiber & Kesting, Transp. Res. B 117 (2018) 613 (action points)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mean_time", "s", "mean time between random decisions", off=0.0, low=0.0, high=10.0, scale=1.0),
        Parameter(
            "threshold",
            "m/s^2",
            "change that triggers a decision at once",
            off=0.5,
            low=0.0,
            high=5.0,
            scale=0.3,
            is_strength=False,
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> LastDecision:
        """A decision at the start."""
        return LastDecision(jnp.zeros((), jnp.int32), _situation(seen))

    def remember(self, memory: LastDecision, seen: Stimulus, driver: CarFollowing, dt: float) -> LastDecision:
        """Memory with the stimulus of the driver's last observation."""
        count = memory.count + 1
        # With mean_time = 0 every time step is a decision, because draws are below 1.
        chance = 1 - jnp.exp(-dt / jnp.maximum(self.mean_time, 1e-6))
        situation, change = (
            _situation(seen),
            _bare_acceleration(seen, driver) - _bare_acceleration(_restored(seen, memory), driver),
        )
        is_new_leader = seen.has_leader != memory.situation[SITUATION.index("has_leader")]
        decides = standard_uniform(self.seed, 3, count, situation[0]) < chance
        decides = decides | (jnp.abs(change) > self.threshold) | is_new_leader
        return LastDecision(count, jnp.where(decides, situation, memory.situation))

    def perceive(self, seen: Stimulus, memory: LastDecision) -> Stimulus:
        """The stimulus of the last decision."""
        return _restored(seen, memory)


def _situation(seen: Stimulus) -> Float[Array, "fields *n"]:
    return jnp.stack(jnp.broadcast_arrays(*(getattr(seen, name) for name in SITUATION)))


def _restored(seen: Stimulus, memory: LastDecision) -> Stimulus:
    return replace(seen, **dict(zip(SITUATION, memory.situation, strict=True)))


def _bare_acceleration(seen: Stimulus, driver: CarFollowing) -> Float[Array, "*n"]:
    """Acceleration of the bare model [m/s^2]."""
    interaction = driver.interaction(seen.gap, seen.speed, seen.speed - seen.leader_speed)
    return driver.free_acceleration(seen.speed) - seen.has_leader * interaction
