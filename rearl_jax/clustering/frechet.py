"""Discrete Frechet distance of many curves to a few centres, and the alignment behind it."""

from functools import cache

import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float, Float32

from rearl_jax.core.batch import ScenarioMap
from rearl_jax.metrics.frechet import frechet_distances, reversed_between_infinities

_CHUNK = 512
"""Curves per device at a time. Equally fast from 64 to 1024; with 512 the state stays within 1 MiB."""


def discrete_distances(
    curves: Float32[np.ndarray, "features points curves"], centres: Float[np.ndarray, "centres features vertices"]
) -> Float32[np.ndarray, "centres curves"]:
    """Discrete Frechet distance of every curve to every centre."""
    return _map()((centres.astype(np.float32)[..., None], curves))


@cache
def _map() -> ScenarioMap:
    return ScenarioMap(_to_centres, chunk=_CHUNK)


def _to_centres(
    arguments: tuple[Float[Array, "centres features vertices 1"], Float[Array, "features points curves"]],
) -> Float[Array, "centres curves"]:
    """One centre after the other, so that a chunk of curves stays in the cache."""
    centres, curves = arguments
    backwards = reversed_between_infinities(curves, centres.shape[2])
    return lax.map(lambda centre: frechet_distances(centre, backwards), centres)


def coupled_distances(distance: Float[np.ndarray, "n m curves"]) -> Float[np.ndarray, "n+1 m+1 curves"]:
    """Discrete Frechet distance of all beginnings of two sequences, from the distances of their points; inf in the
    first row and column, 0 in their corner.

    Source: Eiter & Mannila, Computing discrete Frechet distance, TU Wien CD-TR 94/64 (1994).
    """
    n, m, n_curves = distance.shape
    reached = np.full((n + 1, m + 1, n_curves), np.inf)
    reached[0, 0] = 0.0
    for i in range(n):
        for j in range(m):
            best = np.minimum(np.minimum(reached[i, j], reached[i, j + 1]), reached[i + 1, j])
            reached[i + 1, j + 1] = np.maximum(distance[i, j], best)
    return reached


def aligned(
    curves: Float[np.ndarray, "features points curves"], vertices: Float[np.ndarray, "features vertices"]
) -> Bool[np.ndarray, "vertices points curves"]:
    """Points of every curve that are coupled with each vertex in an optimal discrete coupling.

    The coupling is traced back from the end. Where several steps back are equally good, it steps back along both
    sequences rather than along the curve alone, and along the curve rather than along the vertices.
    """
    squared = ((curves[:, None] - vertices[:, :, None, None]) ** 2).sum(axis=0)
    n_vertices, n_points, n_curves = squared.shape
    reached = coupled_distances(squared)
    coupled = np.zeros(squared.shape, dtype=bool)
    curve = np.arange(n_curves)
    vertex, point = np.full(n_curves, n_vertices), np.full(n_curves, n_points)
    for _ in range(n_vertices + n_points - 1):
        coupled[vertex - 1, point - 1, curve] = True
        previous = ((vertex - 1, point - 1), (vertex, point - 1), (vertex - 1, point))
        choice = np.stack([reached[*cell, curve] for cell in previous]).argmin(axis=0)
        back_vertex, back_point = choice != 1, choice != 2  # 1 keeps the vertex, 2 keeps the point
        # At the start the first cell is the only one left; curves that have reached it stay.
        started = (vertex == 1) & (point == 1)
        vertex = np.where(started, 1, vertex - back_vertex)
        point = np.where(started, 1, point - back_point)
    return coupled


def subdivided(
    centres: Float[np.ndarray, "centres features vertices"], n_points: int
) -> Float[np.ndarray, "centres features points"]:
    """The same polylines with points inserted on their edges, always on the edge with the longest pieces."""
    n_centres, n_features, n_vertices = centres.shape
    edges = np.diff(centres, axis=2)
    length = np.sqrt((edges**2).sum(axis=1))
    pieces = np.ones((n_centres, n_vertices - 1), dtype=np.int64)
    centre_index = np.arange(n_centres)
    for _ in range(n_points - n_vertices):
        pieces[centre_index, (length / pieces).argmax(axis=1)] += 1
    result = np.empty((n_centres, n_features, n_points))
    for centre in range(n_centres):
        edge = np.repeat(np.arange(n_vertices - 1), pieces[centre])
        first_piece = np.concatenate([[0], np.cumsum(pieces[centre])[:-1]])
        share = (np.arange(len(edge)) - first_piece[edge]) / pieces[centre][edge]
        result[centre, :, :-1] = centres[centre][:, edge] + share * edges[centre][:, edge]
        result[centre, :, -1] = centres[centre, :, -1]
    return result
