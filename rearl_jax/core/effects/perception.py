"""Effects on what a driver perceives."""

import math
from dataclasses import replace
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

LONGEST_DELAY = 1.5
"""Longest possible reaction delay [s]."""

AHEAD = ("has_leader", "gap", "leader_speed")
"""Delayed fields of the vehicle ahead."""


class ReactionDelay(Effect):
    """The driver acts on past values: gap and leader's speed before `delay`, the driver's own speed before `own_delay`.

    Drivers feel their own motion, perhaps without delay. A negative delay is anticipation by extrapolation.
    """

    delay: Float[Array, "*#n"]
    own_delay: Float[Array, "*#n"]

    name: ClassVar[str] = "reaction_delay"
    depends_on: ClassVar[tuple[str, ...]] = ("gap", "approach_rate", "speed")
    equation: ClassVar[str] = "a(t) = f(s, v_leader at t - delay; v at t - own_delay)"
    source: ClassVar[str] = (
        "Treiber, Kesting & Helbing, Physica A 360 (2006) 71, eq. 9, whose drivers extrapolate their own speed (eq. 12)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "delay", "s", "reaction time to the vehicle ahead", off=0.0, low=-0.09, high=LONGEST_DELAY - 0.1, scale=0.5
        ),
        Parameter(
            "own_delay",
            "s",
            "time until the own speed is felt",
            off=0.0,
            low=-0.09,
            high=LONGEST_DELAY - 0.1,
            scale=0.5,
        ),
    )

    def begin(self, seen: Stimulus, driver: CarFollowing, dt: float) -> "StimulusHistory":
        """Memory at the start, as if the stimulus had always been the present one."""
        length = math.ceil(LONGEST_DELAY / dt) + 2
        now = _stacked(seen)
        return StimulusHistory(
            jnp.zeros((), jnp.int32), jnp.broadcast_to(now[:, None], (len(now), length, *now.shape[1:])), now
        )

    def remember(self, memory: "StimulusHistory", seen: Stimulus, driver: CarFollowing, dt: float) -> "StimulusHistory":
        """The memory with the present stimulus added, and the interpolated delayed stimulus."""
        now = _stacked(seen)
        ring = lax.dynamic_update_index_in_dim(memory.ring, now, memory.count % memory.ring.shape[1], axis=1)

        def delayed(rows: slice, delay: Float[Array, "*#n"]) -> Float[Array, "fields *n"]:
            past, n_steps = ring[rows], delay / dt
            floor = jnp.floor(jnp.maximum(n_steps, 0.0))
            whole, share = floor.astype(jnp.int32), jnp.broadcast_to(n_steps - floor, past.shape[2:])[None]

            def at(steps_before: Int[Array, "*#n"]) -> Float[Array, "fields *n"]:
                slot = jnp.broadcast_to((memory.count - steps_before) % past.shape[1], past.shape[2:])
                return jnp.take_along_axis(past, slot[None, None], axis=1)[:, 0]

            return at(whole) * (1 - share) + at(whole + 1) * share

        acted_on = jnp.concatenate([delayed(slice(0, 1), self.own_delay), delayed(slice(1, None), self.delay)])
        return StimulusHistory(memory.count + 1, ring, acted_on)

    def perceive(self, seen: Stimulus, memory: "StimulusHistory") -> Stimulus:
        """The stimulus with delayed values."""
        return replace(seen, **dict(zip(("speed", *AHEAD), memory.acted_on, strict=True)))


class StimulusHistory(NamedTuple):
    """Memory of a delayed driver: stimuli of the last time steps, own speed first, then the fields `AHEAD`.

    Attributes:
        count: Time steps so far.
        ring: Ring buffer of the last time steps, the newest at count - 1 modulo its size.
        acted_on: The delayed values that the driver acts on.
    """

    count: Int[Array, ""]
    ring: Float[Array, "fields past *n"]
    acted_on: Float[Array, "fields *n"]


def _stacked(seen: Stimulus) -> Float[Array, "fields *n"]:
    return jnp.stack(jnp.broadcast_arrays(*(getattr(seen, name) for name in ("speed", *AHEAD))))
