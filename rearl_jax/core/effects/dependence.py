"""An effect outside the library: a term that depends on one variable of the stimulus through a smooth curve."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

VARIABLES = {
    "time": ("s", lambda seen: seen.time),
    "position": ("m", lambda seen: seen.position),
    "lane": ("-", lambda seen: seen.lane),
    "lateral_offset": ("m", lambda seen: jnp.abs(seen.lateral_offset)),
    "speed": ("m/s", lambda seen: seen.speed),
    "gap": ("m", lambda seen: jnp.minimum(seen.gap, 200.0)),
    "approach_rate": ("m/s", lambda seen: seen.has_leader * (seen.speed - seen.leader_speed)),
    "leader_acceleration": ("m/s^2", lambda seen: seen.has_leader * seen.leader_acceleration),
    "length": ("m", lambda seen: seen.length),
    "leader_length": ("m", lambda seen: seen.leader_length),
    "second_gap": ("m", lambda seen: jnp.minimum(seen.second_gap, 300.0)),
    "follower_gap": ("m", lambda seen: jnp.minimum(seen.follower_gap, 100.0)),
    "speed_beside": ("m/s", lambda seen: jnp.clip(seen.speed - seen.beside_speed, -10.0, 15.0)),
    "vehicles_beside": ("-", lambda seen: seen.n_beside),
    "time_since_change": ("s", lambda seen: jnp.minimum(seen.time_since_change, 20.0)),
}
"""Variables of a curve: unit and value in the stimulus; bounded if large values carry no further information."""


def hat_weights(value: Float[Array, "*n"], knots: Float[Array, " knots"]) -> Float[Array, "knots *n"]:
    """Weights of the equidistant knots in linear interpolation at `value`, constant beyond the outer knots [-]."""
    step = knots[1] - knots[0]
    inside = jnp.clip(value, knots[0], knots[-1])
    knot = knots.reshape(-1, *(1,) * inside.ndim)
    return jnp.maximum(0.0, 1.0 - jnp.abs(inside[None] - knot) / step)


_KNOTS = Parameter(
    "knots",
    "that of the variable",
    "equidistant",
    off=0.0,
    low=-1e6,
    high=1e6,
    scale=1.0,
    is_strength=False,
    is_list=True,
)


class Dependence(Effect):
    """The acceleration depends on a variable through a curve estimated from data."""

    kind: ClassVar[str] = "generic"

    values: Float[Array, "knots *#n"]
    knots: Float[Array, " knots"]
    variable: str = eqx.field(static=True)

    name: ClassVar[str] = "dependence"
    equation: ClassVar[str] = "a + curve(variable), piecewise linear between knots"
    source: ClassVar[str] = "found in data"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("values", "m/s^2", "the curve at its knots", off=0.0, low=-5.0, high=5.0, scale=0.3, is_list=True),
        _KNOTS,
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration plus the curve."""
        return value + curve_at(self.values, self.knots, VARIABLES[self.variable][1](seen))


class TimeGapDependence(Dependence):
    """The time gap depends on a variable through a curve estimated from data."""

    name: ClassVar[str] = "time_gap_dependence"
    equation: ClassVar[str] = "T exp(curve(variable)), piecewise linear between knots"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("values", "-", "the curve at its knots", off=0.0, low=-3.0, high=3.0, scale=0.3, is_list=True),
        _KNOTS,
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """The acceleration, unchanged."""
        return value

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap changed by the curve."""
        return value * jnp.exp(curve_at(self.values, self.knots, VARIABLES[self.variable][1](seen)))


def curve_at(
    values: Float[Array, "knots *#n"], knots: Float[Array, " knots"], value: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """A piecewise linear curve, constant beyond its outer knots."""
    return jnp.sum(values * hat_weights(value, knots), axis=0)
