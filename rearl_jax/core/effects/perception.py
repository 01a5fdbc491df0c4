"""Effects on what a driver perceives."""

import math
from dataclasses import replace
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.car_following.model import CarFollowing
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

LONGEST_DELAY = 1.5
"""Longest reaction delay that is remembered [s]."""

DELAYED = ("speed", "has_leader", "gap", "leader_speed")


class ReactionDelay(Effect):
    """The driver acts on the gap and the speeds of a moment ago. A negative delay is anticipation by extrapolation."""

    delay: Float[Array, "*#n"]

    name: ClassVar[str] = "reaction_delay"
    depends_on: ClassVar[tuple[str, ...]] = ("gap", "approach_rate", "speed")
    equation: ClassVar[str] = "a(t) = f(s, v, dv at t - delay)"
    source: ClassVar[str] = "Treiber, Kesting & Helbing, Physica A 360 (2006) 71, eq. 9"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("delay", "s", "reaction time", off=0.0, low=-0.09, high=LONGEST_DELAY - 0.1, scale=0.5),
    )

    def begin(
        self, seen: Stimulus, driver: CarFollowing, dt: float
    ) -> tuple[Int[Array, ""], Float[Array, "fields past *n"], Float[Array, "fields *n"]]:
        """A past in which the present stimulus has always been the same."""
        length = math.ceil(LONGEST_DELAY / dt) + 2
        now = _stacked(seen)
        return jnp.zeros((), jnp.int32), jnp.broadcast_to(now[:, None], (len(DELAYED), length, *now.shape[1:])), now

    def remember(
        self,
        memory: tuple[Int[Array, ""], Float[Array, "fields past *n"], Float[Array, "fields *n"]],
        seen: Stimulus,
        driver: CarFollowing,
        dt: float,
    ) -> tuple[Int[Array, ""], Float[Array, "fields past *n"], Float[Array, "fields *n"]]:
        """The past in a ring, and in it the moment `delay` ago, interpolated."""
        count, past = memory[0], memory[1]
        past = lax.dynamic_update_index_in_dim(past, _stacked(seen), count % past.shape[1], axis=1)
        ticks = self.delay / dt
        floor = jnp.floor(jnp.maximum(ticks, 0.0))
        whole, share = floor.astype(jnp.int32), jnp.broadcast_to(ticks - floor, past.shape[2:])[None]

        def ago(ticks_before: Int[Array, "*#n"]) -> Float[Array, "fields *n"]:
            place = jnp.broadcast_to((count - ticks_before) % past.shape[1], past.shape[2:])
            return jnp.take_along_axis(past, place[None, None], axis=1)[:, 0]

        return count + 1, past, ago(whole) * (1 - share) + ago(whole + 1) * share

    def perceive(self, seen: Stimulus, memory: tuple[Array, Array, Array]) -> Stimulus:
        """The remembered moment in the place of the present."""
        return replace(seen, **dict(zip(DELAYED, memory[2], strict=True)))


def _stacked(seen: Stimulus) -> Float[Array, "fields *n"]:
    return jnp.stack(jnp.broadcast_arrays(*(getattr(seen, name) for name in DELAYED)))
