"""Distances between the trajectories of the vehicles of two scenes, which are paired by their places at the start."""

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


def displacement(one: Paths, other: Paths) -> Measure:
    """Measure mean Euclidean distance of paired vehicles [m], over vehicles and seconds in which both are known.

    Source: Montali et al., NeurIPS 2023 Datasets and Benchmarks: average displacement error.
    """
    dx, dy = jnp.subtract(one.along, other.along), jnp.subtract(one.across, other.across)
    return scene_mean(safe_sqrt(dx * dx + dy * dy), jnp.logical_and(one.known, other.known))


def frechet(one: Paths, other: Paths) -> Measure:
    """Measure mean over paired vehicles of the discrete Frechet distance of their trajectories [m].

    A trajectory is the sequence of positions in the seconds in which both are known; vehicles without any do not count.
    """
    known = jnp.logical_and(one.known, other.known)
    first, second = (_points(paths, known) for paths in (one, other))
    curves, vertices = (points.reshape(*points.shape[:2], -1) for points in (first, second))
    distance = frechet_distances(vertices, reversed_between_infinities(curves, vertices.shape[1]))
    is_there = jnp.any(known, axis=0)
    total = unrolled_sum(jnp.where(is_there, distance.reshape(is_there.shape), 0), 0)
    return ratio(total, unrolled_sum(is_there.astype(jnp.int32), 0), distance.dtype)


def _points(
    paths: Paths, known: Bool[Array, "seconds vehicles *scenarios"]
) -> Float[Array, "features seconds vehicles *scenarios"]:
    """Positions with the last known one where it is unknown, before the first known one that one.

    Points that are repeated change no discrete Frechet distance: they are coupled as the point they repeat.
    """
    points = jnp.stack([paths.along, paths.across])

    def keep(kept, second):
        point, is_known = second
        kept = jnp.where(is_known, point, kept)
        return kept, kept

    seconds = (jnp.moveaxis(points, 1, 0), known)
    # From behind first, which ends with the first known point; then on from it.
    earliest, _ = jax.lax.scan(keep, points[:, 0], seconds, reverse=True)
    _, filled = jax.lax.scan(keep, earliest, seconds)
    return jnp.moveaxis(filled, 0, 1)
