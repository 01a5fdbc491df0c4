"""Continuous Frechet distance of pairs of polylines, by bisection; for small data and tests."""

import numpy as np
from jaxtyping import Bool, Float

from rearl_jax.clustering.frechet import coupled_distances

_HALVINGS = 45
"""Halvings of the bracket; leaves 3e-14 of it."""


def continuous_distances(
    curves: Float[np.ndarray, "features points curves"], centres: Float[np.ndarray, "centres features vertices"]
) -> Float[np.ndarray, "centres curves"]:
    """Continuous Frechet distance of every curve to every centre.

    The smallest e for which the free space, the pairs of points of both curves at most e apart, contains a path that is
    monotone in both curves from start to end.

    Source: Alt & Godau, Computing the Frechet distance between two polygonal curves, Int. J. Comput. Geom. Appl. 5
    (1995) 75; bisection instead of their search over critical values.
    """
    curves = np.asarray(curves, dtype=np.float64)
    return np.stack([_to_centre(curves, np.asarray(centre, dtype=np.float64)[..., None]) for centre in centres])


def _to_centre(
    curves: Float[np.ndarray, "features points curves"], centre: Float[np.ndarray, "features vertices 1"]
) -> Float[np.ndarray, " curves"]:
    end_distances = [np.sqrt(((curves[:, end] - centre[:, end]) ** 2).sum(axis=0)) for end in (0, -1)]
    low = np.maximum(*end_distances)
    # Any monotone coupling of vertices is a path in the free space: the discrete distance is an upper bound.
    high = coupled_distances(np.sqrt(((curves[:, :, None] - centre[:, None]) ** 2).sum(axis=0)))[-1, -1]
    is_lowest = _is_within(curves, centre, low)
    high = np.where(is_lowest, low, high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        within = _is_within(curves, centre, middle)
        low, high = np.where(within, low, middle), np.where(within, middle, high)
    return high


def _is_within(
    curves: Float[np.ndarray, "features points curves"],
    centre: Float[np.ndarray, "features vertices 1"],
    radius: Float[np.ndarray, " curves"],
) -> Bool[np.ndarray, " curves"]:
    """True if the distance is at most the radius.

    `bottom[j]` is the reachable part of the side between cells (i-1, j) and (i, j), as shares of edge j of the centre;
    `left` the same between (i, j-1) and (i, j), as shares of edge i of the curve. Empty parts have low > high.
    """
    n_edges, n_sides = curves.shape[1] - 1, centre.shape[1] - 1
    slack = radius * (1.0 + 1e-12) + 1e-15  # the radius itself counts as inside despite rounding
    at_start = ((curves[:, 0] - centre[:, 0]) ** 2).sum(axis=0) <= slack**2
    at_end = ((curves[:, -1] - centre[:, -1]) ** 2).sum(axis=0) <= slack**2
    free_below = _free(curves[:, 0, None], centre[:, :-1], centre[:, 1:], slack)
    bottom = _from_start(free_below, at_start)
    free_left = _free(centre[:, :1], curves[:, :-1], curves[:, 1:], slack)
    left_border = _from_start(free_left, at_start)
    for i in range(n_edges):
        left = left_border[0][i], left_border[1][i]
        free_top = _free(curves[:, i + 1, None], centre[:, :-1], centre[:, 1:], slack)
        top_low, top_high = np.empty_like(free_top[0]), np.empty_like(free_top[1])
        for j in range(n_sides):
            right_free = _free(centre[:, j + 1], curves[:, i], curves[:, i + 1], slack)
            below = bottom[0][j], bottom[1][j]
            from_left, from_below = left[0] <= left[1], below[0] <= below[1]
            top_low[j], top_high[j] = _reachable(free_top[0][j], free_top[1][j], from_left, from_below, below[0])
            left = _reachable(*right_free, from_below, from_left, left[0])
        bottom = top_low, top_high
    return at_start & at_end & (bottom[0][-1] <= bottom[1][-1]) & (bottom[1][-1] >= 1.0)


def _reachable(
    low: Float[np.ndarray, " curves"],
    high: Float[np.ndarray, " curves"],
    across: Bool[np.ndarray, " curves"],
    along: Bool[np.ndarray, " curves"],
    along_from: Float[np.ndarray, " curves"],
) -> tuple[Float[np.ndarray, " curves"], Float[np.ndarray, " curves"]]:
    """Reachable part of a side of a cell whose free part is [low, high].

    All of it if the neighbouring side is reachable (`across`); else, if the opposite side is reachable from
    `along_from` on (`along`), what is not behind that.
    """
    start = np.where(across, low, np.where(along, np.maximum(low, along_from), np.inf))
    return start, high


def _from_start(free: tuple[np.ndarray, np.ndarray], at_start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reachable parts of the sides at the border: up to the first side that is not free from end to end."""
    low, high = free
    whole = (low <= 0.0) & (high >= 1.0)
    open_before = np.concatenate([at_start[None], at_start & np.logical_and.accumulate(whole, axis=0)[:-1]])
    return np.where(open_before & (low <= 0.0), low, np.inf), high


def _free(point: np.ndarray, start: np.ndarray, end: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares [low, high] of segments within a radius of a point; low > high where there are none."""
    edge, offset = end - start, start - point
    # The squared distance of start + s edge from the point is a s^2 + 2 b s + c + radius^2.
    a, b = (edge**2).sum(axis=0), (edge * offset).sum(axis=0)
    c = (offset**2).sum(axis=0) - radius**2
    a, b, c = np.broadcast_arrays(a, b, c)
    root = b * b - a * c
    hit = root >= 0.0
    spread = np.sqrt(np.where(hit, root, 0.0))
    length = np.where(a > 0.0, a, 1.0)
    low, high = (-b - spread) / length, (-b + spread) / length
    # A segment of no length is free as a whole or not at all.
    low, high = np.where(a > 0.0, low, 0.0), np.where(a > 0.0, high, 1.0)
    free = np.where(a > 0.0, hit, c <= 0.0) & (low <= 1.0) & (high >= 0.0)
    return np.where(free, np.maximum(low, 0.0), np.inf), np.where(free, np.minimum(high, 1.0), -np.inf)
