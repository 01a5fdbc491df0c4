"""What the policy sees: the vehicle itself and the four nearest others, as 25 numbers."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.core.elementary import cosine, sine
from rearl_jax.core.neighbours import for_each_vehicle, row
from rearl_jax.core.state import Controller, TrafficState

N_ROWS = 5
"""Vehicles in an observation, the observer first. Source: highway-env 1.12.1, `KinematicObservation`."""

COLUMNS = ("presence", "x", "y", "vx", "vy")
"""What is seen of each. Source: highway-env 1.12.1, `KinematicObservation.FEATURES`."""

N_FEATURES = N_ROWS * len(COLUMNS)
"""Numbers in an observation."""

RANGES = {"x": 100.0, "y": 16.0, "vx": 30.0, "vy": 30.0}
"""Values that become 1 [m, m, m/s, m/s]; beyond them an observation is cut. Own choice, narrower than highway-env's,
so that the small differences between neighbours are seen; y is highway-env's for four lanes of 4 m.
"""

PERCEPTION = 200.0
"""Distance [m] within which others are seen. Source: highway-env 1.12.1, `AbstractEnv.PERCEPTION_DISTANCE`."""


class _Seen(eqx.Module):
    """One other vehicle, as every vehicle sees it: distance along the road, and relative position and speed.

    The distance is inf where there is nobody.
    """

    distance: Float[Array, "vehicles scenarios"]
    x: Float[Array, "vehicles scenarios"]
    y: Float[Array, "vehicles scenarios"]
    vx: Float[Array, "vehicles scenarios"]
    vy: Float[Array, "vehicles scenarios"]

    @property
    def columns(self) -> list[Float[Array, "vehicles scenarios"]]:
        """A row of the observation, in the order of `COLUMNS`; all zero where there is nobody."""
        presence = jnp.isfinite(self.distance)
        scaled = [jnp.clip(getattr(self, name) / reach, -1.0, 1.0) for name, reach in RANGES.items()]
        return [presence.astype(self.x.dtype), *(jnp.where(presence, values, 0.0) for values in scaled)]


def observe_neighbours(state: TrafficState) -> Float[Array, "features vehicles scenarios"]:
    """Observation of every vehicle, float32: `N_ROWS` rows of `COLUMNS`, one after the other.

    The first row is the observer's own: present, x = 0, y across the road, both speeds absolute. The others are the
    nearest along the road, ahead or behind, on any lane, the nearest first, relative to the observer; crashed ones
    among them.

    Source: highway-env 1.12.1, `KinematicObservation` with see_behind=True and order="sorted"; its own row has the
    absolute x, which is 1 after 100 m.
    """
    is_there = state.controller != Controller.ABSENT
    vx, vy = state.speed * cosine(state.heading), state.speed * sine(state.heading)
    index = lax.broadcasted_iota(jnp.int32, state.x.shape, 0)

    def look_at(other: Int[Array, ""], nearest: tuple[_Seen, ...]) -> tuple[_Seen, ...]:
        x, y = row(state.x, other) - state.x, row(state.y, other) - state.y
        is_seen = row(is_there, other) & (index != other) & (x * x + y * y < PERCEPTION**2)
        seen = _Seen(jnp.where(is_seen, jnp.abs(x), jnp.inf), x, y, row(vx, other) - vx, row(vy, other) - vy)
        ranked = []
        for known in nearest:
            is_nearer = seen.distance < known.distance
            ranked.append(_where(is_nearer, seen, known))
            seen = _where(is_nearer, known, seen)
        return tuple(ranked)

    zeros = jnp.zeros_like(state.x)
    nobody = _Seen(jnp.full_like(state.x, jnp.inf), zeros, zeros, zeros, zeros)
    others = for_each_vehicle(state.x.shape[0], look_at, (nobody,) * (N_ROWS - 1))
    own = _Seen(zeros, zeros, state.y, vx, vy)
    return jnp.stack([column for seen in (own, *others) for column in seen.columns]).astype(jnp.float32)


def _where(condition: Bool[Array, "vehicles scenarios"], one: _Seen, other: _Seen) -> _Seen:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), one, other)
