"""Curves simplified to polylines through few of their points, with the least possible Frechet error of any edge."""

import numpy as np
from jaxtyping import Bool, Float, Int

_HALVINGS = 30
"""Halvings of the bracket of a shortcut's error; leaves 1e-9 of it."""


def shortcut_errors(curves: Float[np.ndarray, "features points curves"]) -> Float[np.ndarray, "curves points points"]:
    """Frechet distance of the segment from point i to point j to the piece of the curve between them; inf for i >= j.

    The distance to a segment s is the smallest e for which the points in between have points on s within e that, in
    order, never step back. Projections on s are such points if they never step back; otherwise e is found by bisection.

    Source: Alt & Godau (1995) for the decision.
    """
    points = np.moveaxis(np.asarray(curves, dtype=np.float64), 2, 0)
    n_points = points.shape[2]
    errors = np.full((len(points), n_points, n_points), np.inf)
    for i in range(n_points - 1):
        errors[:, i, i + 1 :] = _from_point(points[:, :, i:])
    return errors


def simplify(errors: Float[np.ndarray, "curves points points"], n_vertices: int) -> Int[np.ndarray, "curves vertices"]:
    """Indices of the vertices of every curve: start, end, and the points that minimise the largest error of an edge.

    Curves with too few points repeat some of them, as edges of no length.

    Source: vertex-restricted min-error simplification, Imai & Iri, in Computational Morphology (1988).
    """
    n_curves, n_points, _ = errors.shape
    # A vertex may stay where it is, so that "at most n_vertices" is covered too.
    errors = np.where(np.eye(n_points, dtype=bool), 0.0, errors)
    best = np.where(np.arange(n_points) == 0, 0.0, np.inf) * np.ones((n_curves, 1))
    before = []
    for _ in range(n_vertices - 1):
        through = np.maximum(best[:, :, None], errors)
        before.append(through.argmin(axis=1))
        best = through.min(axis=1)
    vertices = np.full((n_curves, n_vertices), n_points - 1)
    curve = np.arange(n_curves)
    for vertex in range(n_vertices - 2, -1, -1):
        vertices[:, vertex] = before[vertex][curve, vertices[:, vertex + 1]]
    return vertices


def simplified(
    curves: Float[np.ndarray, "features points curves"],
    errors: Float[np.ndarray, "curves points points"],
    n_vertices: int,
) -> Float[np.ndarray, "curves features vertices"]:
    """The simplifications as polylines."""
    vertices = simplify(errors, n_vertices)
    points = np.moveaxis(np.asarray(curves, dtype=np.float64), 2, 0)
    return np.take_along_axis(points, vertices[:, None, :], axis=2)


def _from_point(points: Float[np.ndarray, "curves features rest"]) -> Float[np.ndarray, "curves ends"]:
    """Errors of the segments from the first point to each of the others."""
    offset = points[:, :, 1:] - points[:, :, :1]
    edge = np.moveaxis(offset, 1, 2)  # curves, ends, features
    squared_length = (edge**2).sum(axis=2)
    # along[., end, between]: projection of the points between on the edge, as share of it.
    along = np.matmul(edge, offset) / np.where(squared_length > 0.0, squared_length, 1.0)[:, :, None]
    between = np.tri(points.shape[2] - 1, k=-1, dtype=bool)
    square = (offset**2).sum(axis=1)[:, None, :]
    # Squared distance of every point from the line through the edge.
    squared_distance = np.maximum(square - along**2 * squared_length[:, :, None], 0.0)

    def largest_distance(share: np.ndarray) -> np.ndarray:
        distance = np.sqrt(squared_distance + (share - along) ** 2 * squared_length[:, :, None])
        return np.where(between, distance, 0.0).max(axis=2)

    nearest_share = np.clip(along, 0.0, 1.0)
    low = largest_distance(nearest_share)
    high = largest_distance(np.maximum.accumulate(np.where(between, nearest_share, 0.0), axis=2))
    curve, end = np.nonzero(high - low > 1e-12)
    if len(curve):
        high[curve, end] = _bisected(
            low[curve, end],
            high[curve, end],
            along[curve, end],
            squared_distance[curve, end],
            squared_length[curve, end],
            between[end],
        )
    return high


def _bisected(
    low: Float[np.ndarray, " shortcuts"],
    high: Float[np.ndarray, " shortcuts"],
    along: Float[np.ndarray, "shortcuts rest"],
    squared_distance: Float[np.ndarray, "shortcuts rest"],
    squared_length: Float[np.ndarray, " shortcuts"],
    between: Bool[np.ndarray, "shortcuts rest"],
) -> Float[np.ndarray, " shortcuts"]:
    """Errors of segments whose points step back when projected."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        half = np.sqrt(
            np.maximum(middle[:, None] ** 2 - squared_distance, 0.0)
            / np.where(squared_length > 0.0, squared_length, 1.0)[:, None]
        )
        first = np.maximum.accumulate(np.where(between, along - half, 0.0), axis=1)
        # Within the radius, and the earliest point in order is not beyond the last one allowed.
        within = (
            ~between | ((middle[:, None] ** 2 >= squared_distance) & (np.maximum(first, 0.0) <= along + half))
        ).all(axis=1)
        within &= (~between | (along - half <= 1.0)).all(axis=1)
        low, high = np.where(within, low, middle), np.where(within, middle, high)
    return high
