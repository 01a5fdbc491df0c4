"""Effects of position and time (road, weather) on all drivers."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

NO_LIMIT = 100.0
"""Speed [m/s] that limits no vehicle."""

FAR_AWAY = 1.0e5
"""Position [m] beyond every section."""

_SECTION = (
    Parameter(
        "start", "m", "beginning of the section", off=0.0, low=-FAR_AWAY, high=FAR_AWAY, scale=500.0, is_strength=False
    ),
    Parameter(
        "end", "m", "end of the section", off=FAR_AWAY, low=-FAR_AWAY, high=FAR_AWAY, scale=500.0, is_strength=False
    ),
    Parameter(
        "edge",
        "m",
        "length over which the section begins and ends",
        off=6.0,
        low=1.0,
        high=80.0,
        scale=6.0,
        is_strength=False,
    ),
)


def inside(
    position: Float[Array, "*#n"], start: Float[Array, "*#n"], end: Float[Array, "*#n"], edge: Float[Array, "*#n"]
) -> Float[Array, "*n"]:
    """Weight of a section of the road at a position, 0 to 1; it rises and falls over a few times `edge`."""
    return jax.nn.sigmoid((position - start) / edge) * jax.nn.sigmoid((end - position) / edge)


def limited(desired_speed: Float[Array, "*#n"], limit: Float[Array, "*#n"]) -> Float[Array, "*n"]:
    """The smaller of desired speed and limit [m/s], smooth over half a metre per second."""
    return desired_speed - jax.nn.softplus(2.0 * (desired_speed - limit)) / 2.0


class Grade(Effect):
    """A slope, or another section of the road that decelerates or accelerates all vehicles."""

    kind: ClassVar[str] = "road"

    push: Float[Array, "*#n"]
    start: Float[Array, "*#n"]
    end: Float[Array, "*#n"]
    edge: Float[Array, "*#n"]

    name: ClassVar[str] = "grade"
    equation: ClassVar[str] = "a + push between start and end; push = -g sin(slope)"
    source: ClassVar[str] = "mechanics of the inclined plane"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("push", "m/s^2", "acceleration on the section", off=0.0, low=-2.0, high=2.0, scale=0.3),
        *_SECTION,
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration, larger downhill and smaller uphill."""
        return value + self.push * inside(seen.position, self.start, self.end, self.edge)


class SpeedLimit(Effect):
    """A section on which no driver wants to exceed a limit."""

    kind: ClassVar[str] = "road"

    limit: Float[Array, "*#n"]
    start: Float[Array, "*#n"]
    end: Float[Array, "*#n"]
    edge: Float[Array, "*#n"]

    name: ClassVar[str] = "speed_limit"
    equation: ClassVar[str] = "v0 -> min(v0, limit) between start and end"
    source: ClassVar[str] = "Treiber & Kesting, Traffic Flow Dynamics (2013), section 11.3"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("limit", "m/s", "the limit", off=NO_LIMIT, low=3.0, high=NO_LIMIT, scale=10.0),
        *_SECTION,
    )

    def desired_speed(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Desired speed, at most the limit."""
        cut = value - limited(value, self.limit)
        return value - inside(seen.position, self.start, self.end, self.edge) * cut


class Bend(Effect):
    """A bend that is taken at no more than a comfortable lateral acceleration."""

    kind: ClassVar[str] = "road"

    lateral_acceleration: Float[Array, "*#n"]
    radius: Float[Array, "*#n"]
    start: Float[Array, "*#n"]
    end: Float[Array, "*#n"]
    edge: Float[Array, "*#n"]

    name: ClassVar[str] = "bend"
    equation: ClassVar[str] = "v0 -> min(v0, sqrt(lateral_acceleration radius)) between start and end"
    source: ClassVar[str] = "after Reymond et al., Human Factors 43 (2001) 483 (lateral acceleration margin)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "lateral_acceleration",
            "m/s^2",
            "comfortable lateral acceleration",
            off=100.0,
            low=0.5,
            high=100.0,
            scale=2.0,
        ),
        Parameter(
            "radius", "m", "radius of the bend", off=500.0, low=20.0, high=5000.0, scale=300.0, is_strength=False
        ),
        *_SECTION,
    )

    def desired_speed(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Desired speed, at most the comfortable speed in the bend."""
        limit = jnp.sqrt(self.lateral_acceleration * self.radius)
        cut = value - limited(value, limit)
        return value - inside(seen.position, self.start, self.end, self.edge) * cut


class LaneDesiredSpeed(Effect):
    """The same driver wants to drive faster on the left and slower on the right lane."""

    kind: ClassVar[str] = "road"

    leftmost: Float[Array, "*#n"]
    rightmost: Float[Array, "*#n"]

    name: ClassVar[str] = "lane_desired_speed"
    depends_on: ClassVar[tuple[str, ...]] = ("lane",)
    equation: ClassVar[str] = "v0 exp(leftmost) on the leftmost, v0 exp(rightmost) on the rightmost lane"
    source: ClassVar[str] = "after Krajewski et al., ITSC 2018 (highD: speeds by lane)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("leftmost", "-", "growth of log v0 on the leftmost lane", off=0.0, low=-0.6, high=0.6, scale=0.15),
        Parameter("rightmost", "-", "growth of log v0 on the rightmost lane", off=0.0, low=-0.6, high=0.6, scale=0.15),
    )

    def desired_speed(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Desired speed, higher on left and lower on right lanes."""
        return value * jnp.exp(self.leftmost * seen.is_leftmost + self.rightmost * seen.is_rightmost)


class Weather(Effect):
    """Conditions change for all drivers at once, as with rain: drivers want lower speeds and larger distances."""

    kind: ClassVar[str] = "road"

    slower: Float[Array, "*#n"]
    wider: Float[Array, "*#n"]
    onset: Float[Array, "*#n"]
    ramp: Float[Array, "*#n"]

    name: ClassVar[str] = "weather"
    equation: ClassVar[str] = "v0 exp(-slower c), T exp(wider c), c = 1 / (1 + exp((onset - t) / ramp))"
    source: ClassVar[str] = "after Hoogendoorn et al., Transp. Res. Rec. 2096 (2009) 35 (adverse weather)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slower", "-", "fall of log v0", off=0.0, low=-1.0, high=1.5, scale=0.2),
        Parameter("wider", "-", "growth of log T", off=0.0, low=-1.0, high=1.5, scale=0.2),
        Parameter(
            "onset",
            "s",
            "time at which half of the change is reached",
            off=0.0,
            low=-FAR_AWAY,
            high=FAR_AWAY,
            scale=30.0,
            is_strength=False,
        ),
        Parameter("ramp", "s", "time scale of the change", off=2.0, low=0.3, high=60.0, scale=3.0, is_strength=False),
    )

    def desired_speed(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Desired speed, lower in bad weather."""
        return value * jnp.exp(-self.slower * self._share(seen))

    def time_gap(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Time gap, longer in bad weather."""
        return value * jnp.exp(self.wider * self._share(seen))

    def _share(self, seen: Stimulus) -> Float[Array, "*n"]:
        return jax.nn.sigmoid((seen.time - self.onset) / self.ramp)


class ClosedCourse(Effect):
    """Acceleration as a function of the position on a closed course, such as slopes and bends of a test track."""

    kind: ClassVar[str] = "road"

    values: Float[Array, "knots *#n"]
    lap: Float[Array, "*#n"]

    name: ClassVar[str] = "closed_course"
    equation: ClassVar[str] = "a + curve(x mod lap), periodic, piecewise linear between equidistant knots"
    source: ClassVar[str] = (
        "found in data, such as the test tracks of Makridis et al., Transp. Res. C 125 (2021) 103047"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "values",
            "m/s^2",
            "the curve at its knots, the first at x = 0",
            off=0.0,
            low=-3.0,
            high=3.0,
            scale=0.3,
            is_list=True,
        ),
        Parameter("lap", "m", "length of the course", off=1000.0, low=10.0, high=1e5, scale=500.0, is_strength=False),
    )

    def acceleration(self, value: Float[Array, "*n"], seen: Stimulus, memory: None) -> Float[Array, "*n"]:
        """Acceleration plus the curve."""
        n_knots = self.values.shape[0]
        position = jnp.mod(seen.position / self.lap, 1.0) * n_knots  # in knot distances
        knot = jnp.arange(n_knots, dtype=position.dtype).reshape(-1, *(1,) * position.ndim)
        # Shortest distance around the course to each knot; the last knot is next to the first.
        distance = jnp.abs(position[None] - knot)
        weight = jnp.maximum(0.0, 1.0 - jnp.minimum(distance, n_knots - distance))
        return value + jnp.sum(self.values * weight, axis=0)
