"""Do two rectangles touch, and how far must they be moved apart: the separating-axis test.

In float64 every operation is rounded as highway-env rounds it. Vehicles that rest against each other are pushed by gaps
of the last place, and those behind them carry what it decides into the whole scene. In float32 the same quantities
are computed from centres and half sizes, which is shorter.

Source: highway-env 1.12.1, `RoadObject.polygon` and `utils.are_polygons_intersecting`.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from rearl_jax.core.elementary import rounded, sum_of_products

Vector = tuple[Array, Array]


class Rectangle(eqx.Module):
    """A vehicle as the collision test sees it: place [m], heading, speed [m/s], half sizes [m]."""

    x: Float[Array, "rows *scenarios"]
    y: Float[Array, "rows *scenarios"]
    cos: Float[Array, "rows *scenarios"]
    sin: Float[Array, "rows *scenarios"]
    speed: Float[Array, "rows *scenarios"]
    half_length: Float[Array, "rows *scenarios"]
    half_width: Float[Array, "rows *scenarios"]
    collides: Bool[Array, "rows *scenarios"]


class _Outline(NamedTuple):
    """A rectangle for the test: its centre [m], the normals of its edges, and its interval along any of them [m]."""

    centre: Vector
    normals: list[Vector]
    project: Callable[[Vector], Vector]


def separate(one: Rectangle, other: Rectangle, tick: float) -> tuple[Array, Array, Array, Array]:
    """Whether rectangles touch, whether they will within a tick, and the shift of `one` that prevents it [m].

    Tested along the outward normals of all eight edges. A normal and its negative can give different depths when one
    interval holds the other, so both are tested; on equal depths the first counts.

    Args:
        one: One row.
        other: Any number of rows.
        tick: Duration of a tick [s].
    """
    outline_of = _outline_of_corners if one.x.dtype == jnp.float64 else _outline_of_halves
    first, second = outline_of(one), outline_of(other)
    (vx, vy), (other_vx, other_vy) = _displacement(one, tick), _displacement(other, tick)
    moved = (vx - other_vx, vy - other_vy)
    apart = (first.centre[0] - second.centre[0], first.centre[1] - second.centre[1])
    touches, will_touch, depth, shift_x, shift_y = [], [], None, None, None
    for normal in first.normals + second.normals:
        (low, high), (other_low, other_high) = first.project(normal), second.project(normal)
        touches.append(_gap(low, high, other_low, other_high) <= 0)
        step = _dot(normal, moved)
        low, high = jnp.minimum(low, low + step), jnp.maximum(high, high + step)
        distance = _gap(low, high, other_low, other_high)
        will_touch.append(distance <= 0)
        size = jnp.abs(distance)
        signed = jnp.where(_dot(apart, normal) > 0, size, -size)
        if depth is None:
            depth, shift_x, shift_y = size, signed * normal[0], signed * normal[1]
        else:
            shift_x = jnp.where(size < depth, signed * normal[0], shift_x)
            shift_y = jnp.where(size < depth, signed * normal[1], shift_y)
            depth = jnp.minimum(size, depth)
    return (
        functools.reduce(jnp.logical_and, touches),
        functools.reduce(jnp.logical_and, will_touch),
        shift_x,
        shift_y,
    )


def _displacement(rectangle: Rectangle, tick: float) -> Vector:
    """Displacement within a tick [m]."""
    speed, cos, sin = rectangle.speed, rectangle.cos, rectangle.sin
    return rounded(rounded(speed * cos) * tick), rounded(rounded(speed * sin) * tick)


def _gap(low: Array, high: Array, other_low: Array, other_high: Array) -> Array:
    """Distance between two intervals [m], negative where they overlap."""
    return jnp.where(low < other_low, other_low - high, low - other_high)


def _dot(a: Vector, b: Vector) -> Array:
    return sum_of_products(a[0], b[0], a[1], b[1])


def _outline_of_halves(rectangle: Rectangle) -> _Outline:
    cos, sin = rectangle.cos, rectangle.sin

    def project(normal: Vector) -> Vector:
        nx, ny = normal
        centre = rectangle.x * nx + rectangle.y * ny
        reach = rectangle.half_length * jnp.abs(cos * nx + sin * ny)
        reach = reach + rectangle.half_width * jnp.abs(cos * ny - sin * nx)
        return centre - reach, centre + reach

    return _Outline((rectangle.x, rectangle.y), [(-cos, -sin), (-sin, cos), (cos, sin), (sin, -cos)], project)


def _outline_of_corners(rectangle: Rectangle) -> _Outline:
    cos, sin, length, width = rectangle.cos, rectangle.sin, rectangle.half_length, rectangle.half_width
    offsets = [(-length, -width), (-length, width), (length, width), (length, -width)]
    corners = [
        (_dot((cos, -sin), offset) + rectangle.x, _dot((sin, cos), offset) + rectangle.y) for offset in offsets
    ]

    def normal_of(start: Vector, end: Vector) -> Vector:
        edge = (-end[1] + start[1], end[0] - start[0])
        norm = jnp.sqrt(_dot(edge, edge))
        return edge[0] / norm, edge[1] / norm

    def project(normal: Vector) -> Vector:
        places = [_dot(corner, normal) for corner in corners]
        return functools.reduce(jnp.minimum, places), functools.reduce(jnp.maximum, places)

    def mean(values: list[Array]) -> Array:
        return functools.reduce(jnp.add, values) / 4

    centre = (mean([x for x, _ in corners]), mean([y for _, y in corners]))
    following = corners[1:] + corners[:1]
    return _Outline(centre, [normal_of(*ends) for ends in zip(corners, following, strict=True)], project)
