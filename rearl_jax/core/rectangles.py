"""Vehicles as rectangles: overlap now or in the coming time step, and the shift that prevents it.

A separating-axis test in the order of operations of highway-env. In float64 the result must be equal to the last place,
because it decides whether vehicles at rest touch. Projections on an axis are therefore computed from
corners, as in highway-env. In float32 they are computed from half sizes and headings relative to one of the rectangles,
which costs a tenth and avoids the loss of digits in corner positions on a long road.

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


_Projections = tuple[_Vector, _Vector, _Vector, Array]
"""An edge normal, the ends of both projections on it, and the distance along it from the second centre to the first."""


class Rectangle(eqx.Module):
    """Rectangle of a vehicle in the collision test.

    Attributes:
        x: Position of the centre along the road [m].
        y: Lateral position of the centre [m].
        cos: Cosine of the heading [-].
        sin: Sine of the heading [-].
        speed: Speed [m/s].
        half_length: Half the length [m].
        half_width: Half the width [m].
        collides: Whether the vehicle checks for collisions.
    """

    x: Float[Array, "rows *scenarios"]
    y: Float[Array, "rows *scenarios"]
    cos: Float[Array, "rows *scenarios"]
    sin: Float[Array, "rows *scenarios"]
    speed: Float[Array, "rows *scenarios"]
    half_length: Float[Array, "#rows *#scenarios"]
    half_width: Float[Array, "#rows *#scenarios"]
    collides: Bool[Array, "#rows *#scenarios"]


def separate(first: Rectangle, second: Rectangle, model: TrafficModel) -> tuple[Array, Array, Array, Array]:
    """Overlap now, overlap within a time step, and the shift of `first` that prevents it (x, y) [m].

    Both directions of each edge normal are tested, as they can give different depths if one interval contains the
    other; on equal depths the first counts.

    Args:
        first: Rectangles, of one or all rows.
        second: Partners of `first`, in the same order.
        model: Traffic model; only its time step is used.
    """
    relative_displacement = _difference(_displacement(first, model), _displacement(second, model))
    touches, will_touch = [], []
    depth = jnp.full_like(second.x, jnp.inf)
    shift_x = shift_y = jnp.zeros_like(second.x)
    for normal, (low, high), (second_low, second_high), between in _projections(first, second):
        touches.append(_gap(low, high, second_low, second_high) <= 0)
        extension = _dot(normal, relative_displacement)
        low, high = jnp.where(extension < 0, low + extension, low), jnp.where(extension < 0, high, high + extension)
        distance = _gap(low, high, second_low, second_high)
        will_touch.append(distance <= 0)
        size = jnp.abs(distance)
        outwards = jnp.where(between > 0, size, -size)
        shift_x = jnp.where(size < depth, rounded(outwards * normal[0]), shift_x)
        shift_y = jnp.where(size < depth, rounded(outwards * normal[1]), shift_y)
        depth = jnp.minimum(size, depth)
    return functools.reduce(jnp.logical_and, touches), functools.reduce(jnp.logical_and, will_touch), shift_x, shift_y


def _projections(first: Rectangle, second: Rectangle) -> Iterator[_Projections]:
    """The projections on every edge normal, those of `first` first."""
    return _project_corners(first, second) if second.x.dtype == jnp.float64 else _project_sizes(first, second)


def _project_corners(first: Rectangle, second: Rectangle) -> Iterator[_Projections]:
    """Projections of the corners, in the order of operations of highway-env."""
    corners, second_corners = _corners(first), _corners(second)
    between = _difference(_mean(corners), _mean(second_corners))
    for normal in _normals(corners) + _normals(second_corners):
        yield normal, _project(corners, normal), _project(second_corners, normal), _dot(between, normal)


def _project_sizes(first: Rectangle, second: Rectangle) -> Iterator[_Projections]:
    """Projections counted from the centre of `first`; edges in the order of `_corners`: rear, left, front, right."""
    between = first.x - second.x, first.y - second.y
    cos = jnp.abs(first.cos * second.cos + first.sin * second.sin)
    sin = jnp.abs(first.sin * second.cos - first.cos * second.sin)

    def on_normals_of(owner: Rectangle, other: Rectangle) -> Iterator[tuple[_Vector, Array, Array]]:
        """Each edge normal of the owner, half the owner's projection on it, half that of the other."""
        along, across = (owner.cos, owner.sin), (-owner.sin, owner.cos)
        other_along = other.half_length * cos + other.half_width * sin
        other_across = other.half_length * sin + other.half_width * cos
        yield (-along[0], -along[1]), owner.half_length, other_along
        yield across, owner.half_width, other_across
        yield along, owner.half_length, other_along
        yield (-across[0], -across[1]), owner.half_width, other_across

    of_first = on_normals_of(first, second)
    of_second = ((normal, half, own_half) for normal, own_half, half in on_normals_of(second, first))
    for normal, half, second_half in itertools.chain(of_first, of_second):
        towards = _dot(between, normal)
        yield normal, (-half, half), (-towards - second_half, -towards + second_half), towards


def _dot(a: _Vector, b: _Vector) -> Array:
    """Scalar product; NumPy, too, rounds the first product and may fuse the second into the sum."""
    return rounded(a[0] * b[0]) + a[1] * b[1]


def _difference(a: _Vector, b: _Vector) -> _Vector:
    return a[0] - b[0], a[1] - b[1]


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
    """Displacement in one time step [m]."""
    along, across = rounded(rectangle.speed * rectangle.cos), rounded(rectangle.speed * rectangle.sin)
    return rounded(along * model.dt), rounded(across * model.dt)


def _project(corners: list[_Vector], axis: _Vector) -> _Vector:
    """Ends of a rectangle's projection on an axis."""
    along = [_dot(corner, axis) for corner in corners]
    return functools.reduce(jnp.minimum, along), functools.reduce(jnp.maximum, along)


def _gap(low: Array, high: Array, other_low: Array, other_high: Array) -> Array:
    """Gap between two intervals, negative if they overlap."""
    return jnp.where(low < other_low, other_low - high, low - other_high)
