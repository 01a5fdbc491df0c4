"""Vehicles as rectangles: which of them overlap, now or in the coming tick, and how far apart they must be shifted.

A separating-axis test in the very order of operations of highway-env. In float64 the outcome must be the same to the
last place: vehicles that rest against each other touch or do not touch by that much.

Source: highway-env 1.12.1, `RoadObject.polygon`, `utils.are_polygons_intersecting`, `Vehicle.velocity`.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.core.double_double import rounded
from rearl_jax.core.model import TrafficModel

_Vector = tuple[Array, Array]
"""Components along and across the road."""


class Rectangle(eqx.Module):
    """A vehicle as the collision test sees it: centre [m], heading [-], speed [m/s], half sizes [m].

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        cos: Cosine of the heading [-].
        sin: Sine of the heading [-].
        speed: Speed [m/s].
        half_length: Half the length [m].
        half_width: Half the width [m].
        collides: Whether the vehicle looks for collisions.
    """

    x: Float[Array, "rows *scenarios"]
    y: Float[Array, "rows *scenarios"]
    cos: Float[Array, "rows *scenarios"]
    sin: Float[Array, "rows *scenarios"]
    speed: Float[Array, "rows *scenarios"]
    half_length: Float[Array, "rows *scenarios"]
    half_width: Float[Array, "rows *scenarios"]
    collides: Bool[Array, "rows *scenarios"]


def separate(one: Rectangle, other: Rectangle, model: TrafficModel) -> tuple[Array, Array, Array, Array]:
    """Whether rectangles overlap, whether they will within a tick, and the shift of `one` that prevents it (x, y) [m].

    Both directions of each edge normal are tested, as they can give different depths where one interval holds the
    other; on equal depths the first counts.

    Args:
        one: Rectangles, of one or all rows.
        other: The rectangles they are held against.
        model: The tick.
    """
    corners, other_corners = _corners(one), _corners(other)
    between = _difference(_mean(corners), _mean(other_corners))
    moved = _difference(_displacement(one, model), _displacement(other, model))
    touches, will_touch = [], []
    depth = jnp.full_like(other.x, jnp.inf)
    shift_x = shift_y = jnp.zeros_like(other.x)
    for normal in _normals(corners) + _normals(other_corners):
        (low, high), (other_low, other_high) = _project(corners, normal), _project(other_corners, normal)
        touches.append(_gap(low, high, other_low, other_high) <= 0)
        lengthened = _dot(normal, moved)
        low, high = jnp.where(lengthened < 0, low + lengthened, low), jnp.where(lengthened < 0, high, high + lengthened)
        distance = _gap(low, high, other_low, other_high)
        will_touch.append(distance <= 0)
        size = jnp.abs(distance)
        outwards = jnp.where(_dot(between, normal) > 0, size, -size)
        shift_x = jnp.where(size < depth, rounded(outwards * normal[0]), shift_x)
        shift_y = jnp.where(size < depth, rounded(outwards * normal[1]), shift_y)
        depth = jnp.minimum(size, depth)
    return functools.reduce(jnp.logical_and, touches), functools.reduce(jnp.logical_and, will_touch), shift_x, shift_y


def _dot(one: _Vector, other: _Vector) -> Array:
    """Scalar product; NumPy, too, rounds the first product and may fuse the second into the sum."""
    return rounded(one[0] * other[0]) + one[1] * other[1]


def _difference(one: _Vector, other: _Vector) -> _Vector:
    return one[0] - other[0], one[1] - other[1]


def _corners(rectangle: Rectangle) -> list[_Vector]:
    """Corners in order around the rectangle, from the rear right one."""
    length, width = rectangle.half_length, rectangle.half_width
    along, across = (rectangle.cos, -rectangle.sin), (rectangle.sin, rectangle.cos)
    return [
        (_dot(along, corner) + rectangle.x, _dot(across, corner) + rectangle.y)
        for corner in ((-length, -width), (-length, width), (length, width), (length, -width))
    ]


def _normals(corners: list[_Vector]) -> list[_Vector]:
    """Unit normals of the edges."""
    normals = []
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        across = (start[1] - end[1], end[0] - start[0])
        length = jnp.sqrt(_dot(across, across))
        normals.append((across[0] / length, across[1] / length))
    return normals


def _mean(corners: list[_Vector]) -> _Vector:
    """Centre of four corners."""
    first, second, third, fourth = corners
    x, y = (((first[k] + second[k]) + third[k] + fourth[k]) / 4 for k in (0, 1))
    return x, y


def _displacement(rectangle: Rectangle, model: TrafficModel) -> _Vector:
    """Way of one tick [m]."""
    along, across = rounded(rectangle.speed * rectangle.cos), rounded(rectangle.speed * rectangle.sin)
    return rounded(along * model.tick), rounded(across * model.tick)


def _project(corners: list[_Vector], axis: _Vector) -> _Vector:
    """Ends of a rectangle's shadow on an axis."""
    shadows = [_dot(corner, axis) for corner in corners]
    return functools.reduce(jnp.minimum, shadows), functools.reduce(jnp.maximum, shadows)


def _gap(low: Array, high: Array, other_low: Array, other_high: Array) -> Array:
    """Gap between two intervals, negative where they overlap."""
    return jnp.where(low < other_low, other_low - high, low - other_high)
