"""Vehicles as rectangles: which of them overlap, now or in the coming tick, and how far apart they must be shifted.

A separating-axis test in the order of operations of highway-env. In float64 the outcome must be the same to the last
place: vehicles that rest against each other touch or do not touch by that much. So there the shadows are those of the
corners, as in highway-env. In float32 they follow from half sizes and headings, seen from one of the rectangles, which
is a tenth of the work and does not lose the places that a long road takes from a corner's position.

Source: highway-env 1.12.1, `RoadObject.polygon`, `utils.are_polygons_intersecting`, `Vehicle.velocity`.
"""

import functools
import itertools
from collections.abc import Iterator

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.core.double_double import rounded
from rearl_jax.core.model import TrafficModel

_Vector = tuple[Array, Array]
"""Components along and across the road."""


_Shadows = tuple[_Vector, _Vector, _Vector, Array]
"""An edge normal, the ends of both rectangles' shadows on it, and how far the first centre lies beyond the second."""


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
    half_length: Float[Array, "#rows *#scenarios"]
    half_width: Float[Array, "#rows *#scenarios"]
    collides: Bool[Array, "#rows *#scenarios"]


def separate(one: Rectangle, other: Rectangle, model: TrafficModel) -> tuple[Array, Array, Array, Array]:
    """Whether rectangles overlap, whether they will within a tick, and the shift of `one` that prevents it (x, y) [m].

    Both directions of each edge normal are tested, as they can give different depths where one interval holds the
    other; on equal depths the first counts.

    Args:
        one: Rectangles, of one or all rows.
        other: The rectangles they are held against.
        model: The tick.
    """
    moved = _difference(_displacement(one, model), _displacement(other, model))
    touches, will_touch = [], []
    depth = jnp.full_like(other.x, jnp.inf)
    shift_x = shift_y = jnp.zeros_like(other.x)
    for normal, (low, high), (other_low, other_high), between in _all_shadows(one, other):
        touches.append(_gap(low, high, other_low, other_high) <= 0)
        lengthened = _dot(normal, moved)
        low, high = jnp.where(lengthened < 0, low + lengthened, low), jnp.where(lengthened < 0, high, high + lengthened)
        distance = _gap(low, high, other_low, other_high)
        will_touch.append(distance <= 0)
        size = jnp.abs(distance)
        outwards = jnp.where(between > 0, size, -size)
        shift_x = jnp.where(size < depth, rounded(outwards * normal[0]), shift_x)
        shift_y = jnp.where(size < depth, rounded(outwards * normal[1]), shift_y)
        depth = jnp.minimum(size, depth)
    return functools.reduce(jnp.logical_and, touches), functools.reduce(jnp.logical_and, will_touch), shift_x, shift_y


def _all_shadows(one: Rectangle, other: Rectangle) -> Iterator[_Shadows]:
    """The shadows on every edge normal, those of `one` first."""
    return _shadows_of_corners(one, other) if other.x.dtype == jnp.float64 else _shadows_of_sizes(one, other)


def _shadows_of_corners(one: Rectangle, other: Rectangle) -> Iterator[_Shadows]:
    corners, other_corners = _corners(one), _corners(other)
    between = _difference(_mean(corners), _mean(other_corners))
    for normal in _normals(corners) + _normals(other_corners):
        yield normal, _project(corners, normal), _project(other_corners, normal), _dot(between, normal)


def _shadows_of_sizes(one: Rectangle, other: Rectangle) -> Iterator[_Shadows]:
    """The same, counted from the centre of `one`; edges in the order of `_corners`: rear, left, front, right."""
    between = one.x - other.x, one.y - other.y
    cos = jnp.abs(one.cos * other.cos + one.sin * other.sin)
    sin = jnp.abs(one.sin * other.cos - one.cos * other.sin)

    def seen_from(owner: Rectangle, seen: Rectangle) -> Iterator[tuple[_Vector, Array, Array]]:
        """Each edge normal of the owner, half the owner's own shadow on it, half that of the other."""
        along, across = (owner.cos, owner.sin), (-owner.sin, owner.cos)
        seen_along = seen.half_length * cos + seen.half_width * sin
        seen_across = seen.half_length * sin + seen.half_width * cos
        yield (-along[0], -along[1]), owner.half_length, seen_along
        yield across, owner.half_width, seen_across
        yield along, owner.half_length, seen_along
        yield (-across[0], -across[1]), owner.half_width, seen_across

    of_one = seen_from(one, other)
    of_other = ((normal, half, own_half) for normal, own_half, half in seen_from(other, one))
    for normal, half, other_half in itertools.chain(of_one, of_other):
        towards = _dot(between, normal)
        yield normal, (-half, half), (-towards - other_half, -towards + other_half), towards


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
