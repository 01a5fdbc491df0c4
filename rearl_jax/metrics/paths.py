"""Distances between the trajectories of two scenes, whose vehicles are paired by their order at the start."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from rearl_jax.metrics.frechet import frechet_distances, reversed_between_infinities
from rearl_jax.metrics.measure import Measure, ratio, safe_sqrt, scene_mean, unrolled_sum


class Paths(eqx.Module):
    """Positions of the vehicles of a scene, second by second, the most upstream one of the first snapshot first.

    Attributes:
        along: Centre along the driving direction [m].
        across: Centre of the lane across the road [m].
        known: Whether the position of the vehicle is known.
    """

    along: Float[Array | np.ndarray, "seconds vehicles *scenarios"]
    across: Float[Array | np.ndarray, "seconds vehicles *scenarios"]
    known: Bool[Array | np.ndarray, "seconds vehicles *scenarios"]


def displacement(first: Paths, second: Paths) -> Measure:
    """Mean Euclidean distance of paired vehicles [m], over vehicles and seconds in which both positions are known.

    Source: Montali et al., NeurIPS 2023 Datasets and Benchmarks: average displacement error.
    """
    dx, dy = jnp.subtract(first.along, second.along), jnp.subtract(first.across, second.across)
    return scene_mean(safe_sqrt(dx * dx + dy * dy), jnp.logical_and(first.known, second.known))


def frechet(first: Paths, second: Paths) -> Measure:
    """Mean over paired vehicles of the discrete Frechet distance of their trajectories [m].

    A trajectory consists of the positions in those seconds in which both positions of a pair are known; pairs without
    such a second do not count.
    """
    known = jnp.logical_and(first.known, second.known)
    both = (_filled_positions(paths, known) for paths in (first, second))
    curves, vertices = (points.reshape(*points.shape[:2], -1) for points in both)
    distance = frechet_distances(vertices, reversed_between_infinities(curves, vertices.shape[1]))
    is_there = jnp.any(known, axis=0)
    total = unrolled_sum(jnp.where(is_there, distance.reshape(is_there.shape), 0), 0)
    return ratio(total, unrolled_sum(is_there.astype(jnp.int32), 0), distance.dtype)


def _filled_positions(
    paths: Paths, known: Bool[Array, "seconds vehicles *scenarios"]
) -> Float[Array, "features seconds vehicles *scenarios"]:
    """Positions, the unknown ones replaced by the last known one or, before it, by the first known one.

    Repeated points do not change the discrete Frechet distance: they are coupled like the point they repeat.
    """
    points = jnp.stack([paths.along, paths.across])

    def keep_last(kept, point_of_second):
        point, is_known = point_of_second
        kept = jnp.where(is_known, point, kept)
        return kept, kept

    seconds = (jnp.moveaxis(points, 1, 0), known)
    # The reverse scan ends with the first known point, from which the forward scan begins.
    earliest, _ = jax.lax.scan(keep_last, points[:, 0], seconds, reverse=True)
    _, filled = jax.lax.scan(keep_last, earliest, seconds)
    return jnp.moveaxis(filled, 0, 1)
